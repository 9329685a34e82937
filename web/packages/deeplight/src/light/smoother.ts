/** Smooths estimates over time, in log radiance, with the light held still in the world. */
import { Lighting } from "./lighting.ts";
import { IDENTITY, type Matrix3x3, product, transposed } from "./matrix.ts";

const STILL_RAD = 0.01; // less than a sixteenth of a ball pixel: not worth resampling
const ANCHOR_RAD = 0.25; // resampling blurs by a pixel, so it is done once per turn this far
const FORGET_MS = 2000; // after a longer gap the scene may be another one

interface State {
  readonly lighting: Lighting; // in the frame of the camera at `worldFromAnchor`
  readonly worldFromAnchor: Matrix3x3;
  readonly timeMs: number;
}

export class Smoother {
  #state: State | undefined;
  readonly #timeConstantMs: number;

  /** @param timeConstantMs after which 63 % of a change has been taken over. */
  constructor(timeConstantMs = 300) {
    this.#timeConstantMs = timeConstantMs;
  }

  /** The smoothed light in the frame of this moment's camera. */
  next(light: Lighting, timeMs: number, worldFromCamera: Matrix3x3 = IDENTITY): Lighting {
    const old = this.#state;
    const passed = old === undefined ? Number.POSITIVE_INFINITY : timeMs - old.timeMs;
    if (old === undefined || old.lighting.size !== light.size || passed < 0 || passed > FORGET_MS) {
      this.#state = { lighting: light, worldFromAnchor: worldFromCamera, timeMs };
      return light;
    }
    const cameraFromAnchor = product(transposed(worldFromCamera), old.worldFromAnchor);
    const moved = angleOf(cameraFromAnchor) > ANCHOR_RAD;
    const before = moved ? old.lighting.turned(cameraFromAnchor) : old.lighting;
    const worldFromAnchor = moved ? worldFromCamera : old.worldFromAnchor;
    const anchorFromCamera = product(transposed(worldFromAnchor), worldFromCamera);
    const share = 1 - Math.exp(-passed / this.#timeConstantMs);
    const lighting = blended(before, steady(light, anchorFromCamera), share);
    this.#state = { lighting, worldFromAnchor, timeMs };
    return steady(lighting, transposed(anchorFromCamera));
  }

  /** Forgets everything: another camera, another photo. */
  reset(): void {
    this.#state = undefined;
  }
}

function blended(old: Lighting, fresh: Lighting, share: number): Lighting {
  return new Lighting(
    old.logRadiance.map((value, i) => value + share * (fresh.logRadiance[i]! - value)),
  );
}

function steady(light: Lighting, turn: Matrix3x3): Lighting {
  return angleOf(turn) > STILL_RAD ? light.turned(turn) : light;
}

function angleOf(rotation: Matrix3x3): number {
  const cosine = (rotation[0] + rotation[4] + rotation[8] - 1) / 2;
  return Math.acos(Math.min(Math.max(cosine, -1), 1));
}

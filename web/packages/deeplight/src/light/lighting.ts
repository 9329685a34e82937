/**
 * Light from all directions on the mirror ball, in the camera frame: +X right, +Y up, +Z towards
 * the camera, which looks along -Z. Radiance is linear and relative to the camera's white.
 */
import { pixelFromRadiance } from "./camera-response.ts";
import type { Environment } from "./environment.ts";
import { equirectFromBall } from "./equirect.ts";
import { project } from "./harmonics.ts";
import type { Lamp } from "./lamp.ts";
import { findMainLight, type MainLight, mainLightOf } from "./main-light.ts";
import type { Matrix3x3 } from "./matrix.ts";
import { coverage, radianceOfBall, turnedBall } from "./mirror-ball.ts";
import { relit, SPHERE_SIZE, type SphereName } from "./spheres.ts";

const DARKEST = 1e-30; // black has no logarithm

export class Lighting {
  /** Natural logarithm of radiance: rows from the top, RGB. Off the disc it means nothing. */
  readonly logRadiance: Float32Array;
  readonly size: number;
  #radiance: Float32Array | undefined;

  /** @throws RangeError where it is no square RGB ball of finite light. */
  constructor(logRadiance: Float32Array) {
    this.size = Math.sqrt(logRadiance.length / 3);
    if (!Number.isInteger(this.size) || this.size === 0) {
      throw new RangeError(`expected a square RGB ball, got ${logRadiance.length} values`);
    }
    // Not `>=`: that would let NaN pass. e^88.7 is what a 32-bit float holds.
    if (!logRadiance.every((value) => value < 88.7)) throw new RangeError("expected finite light");
    this.logRadiance = logRadiance;
  }

  static fromRadiance(radiance: Float32Array): Lighting {
    return new Lighting(radiance.map((value) => Math.log(Math.max(value, DARKEST))));
  }

  /** Linear; 0 off the disc. The same array each time: not to be written to. */
  radiance(): Float32Array {
    this.#radiance ??= radianceOfBall(this.logRadiance, this.size);
    return this.#radiance;
  }

  /** The same light in a turned frame: `mapFromCamera` takes our directions to the new frame's. */
  turned(mapFromCamera: Matrix3x3): Lighting {
    return Lighting.fromRadiance(turnedBall(this.radiance(), this.size, mapFromCamera));
  }

  /** Radiance coefficients up to `order`, (order + 1)^2 times RGB; signs as in harmonics.py. */
  harmonics(order: number): Float32Array {
    return project(this.radiance(), this.size, order);
  }

  /** Linear panorama, RGB; centre = the view, right of it +X, top row up. */
  equirect(height: number, width = 2 * height): Float32Array {
    if (width !== 2 * height) throw new RangeError(`expected width 2 x height, got ${width}`);
    return equirectFromBall(this.radiance(), this.size, height);
  }

  /** A reference sphere as the camera would show it, transparent around it. */
  sphere(which: SphereName): ImageData {
    return new ImageData(this.spherePixels(which), SPHERE_SIZE, SPHERE_SIZE);
  }

  /** The pixels of `sphere`, RGBA. */
  spherePixels(which: SphereName): Uint8ClampedArray<ArrayBuffer> {
    const rendered = relit(which, this.radiance());
    const pixels = new Uint8ClampedArray(4 * SPHERE_SIZE ** 2);
    coverage(SPHERE_SIZE).forEach((share, pixel) => {
      for (let c = 0; c < 3; c++) {
        pixels[4 * pixel + c] = 255 * pixelFromRadiance(rendered[3 * pixel + c]!);
      }
      pixels[4 * pixel + 3] = 255 * share;
    });
    return pixels;
  }

  /** The light that stands out: this lamp, if the light has lamps, else what is found on the ball. */
  mainLight(lamp?: Lamp, panorama: Environment | null = null): MainLight {
    if (lamp) return mainLightOf(lamp, this.radiance(), this.size, panorama);
    return findMainLight(this.radiance(), this.size);
  }
}

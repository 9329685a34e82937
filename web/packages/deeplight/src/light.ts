/** What an estimate gives: one light, in the forms that renderers take. */
import { CONDON_SHORTLEY, LIGHTING_SIZE } from "./contract/generated.ts";
import { type Environment, resized, seenShare, turnedEnvironment } from "./light/environment.ts";
import type { Lamp } from "./light/lamp.ts";
import { Lighting } from "./light/lighting.ts";
import type { MainLight } from "./light/main-light.ts";
import { type Matrix3x3, turned as turnedVector, type Vector3 } from "./light/matrix.ts";
import { ballFromPanorama } from "./light/panorama.ts";
import { hdrFile, panoramaFile, rolled } from "./save/hdr-file.ts";
import { type About, jsonFile } from "./save/json-file.ts";

/** Radiance coefficients up to order 2, RGB interleaved, in both signs that are in use. */
export interface Harmonics {
  /** All positive: three.js, Ramamoorthi and Hanrahan 2001. */
  readonly allPositive: Float32Array;
  /** 1, 3, 5 and 7 negated: ARCore, so WebXR in Chromium. */
  readonly condonShortley: Float32Array;
}

/**
 * Light from all directions in the frame of the camera that saw the photo: +X right, +Y up, +Z
 * towards the camera. Radiance is linear; 1.0 is where a pixel of the photo just saturates.
 */
export class Light {
  #main: MainLight | undefined;

  constructor(
    /** On the mirror ball, as the network gives it. */
    readonly lighting: Lighting,
    /** Where it comes from; null after `turned`, which leaves the camera's frame. */
    readonly about: About | null,
    /** Compact lights, the main light first, in the light already; none where none are known. */
    readonly lamps: readonly Lamp[] = [],
    /** The light at its own resolution, with what a camera saw; null for the network's ball alone. */
    readonly panorama: Environment | null = null,
  ) {}

  /** Of a light with a panorama; the ball is made of that. */
  static of(panorama: Environment, about: About | null, lamps: readonly Lamp[] = []): Light {
    const ball = ballFromPanorama(panorama.radiance, panorama.height, LIGHTING_SIZE);
    return new Light(Lighting.fromRadiance(ball), about, lamps, panorama);
  }

  /** Part of all directions that a camera saw, 0 to 1; elsewhere the light is estimated. */
  get seenShare(): number {
    return this.panorama ? seenShare(this.panorama) : 0;
  }

  /** Of the whole environment, the main light included. */
  get harmonics(): Harmonics {
    return inBothSigns(this.lighting.harmonics(2));
  }

  /** The first of `lamps`; where there are none, what stands out of the surroundings. */
  get mainLight(): MainLight {
    this.#main ??= this.lighting.mainLight(this.lamps[0], this.panorama);
    return this.#main;
  }

  /** The light without its main light, for renderers that draw that one by itself. */
  get withoutMainLight(): Light {
    return new Light(Lighting.fromRadiance(this.mainLight.remainder), null);
  }

  /** WebXR's `XRLightEstimate`: unit vector towards the main light. */
  get primaryLightDirection(): Vector3 {
    return this.mainLight.direction;
  }

  /** WebXR's: RGB irradiance on a surface that faces the main light. */
  get primaryLightIntensity(): Vector3 {
    return this.mainLight.irradiance;
  }

  /** WebXR's, with the signs that Chromium gives: of the remainder. */
  get sphericalHarmonicsCoefficients(): Float32Array {
    return this.withoutMainLight.harmonics.condonShortley;
  }

  /**
   * Linear panorama of `height` x 2 `height` RGB pixels, the top row up: the view in the centre and
   * +X right of it.
   *
   * @param viewU where the view stands instead, 0 to 1 from the left edge: 0.25 for three.js.
   */
  environment(height = 256, viewU = 0.5): Float32Array {
    const { panorama, lighting } = this;
    const level = panorama
      ? resized(panorama.radiance, panorama.height, height)
      : lighting.equirect(height);
    return rolled(level, 2 * height, viewU - 0.5);
  }

  /** A Radiance file, as `deeplight estimate` writes it: 256 x 512 pixels, or the panorama's own size. */
  hdr(viewU = 0.5): Blob {
    const { panorama } = this;
    if (!panorama) return hdrFile(this.lighting, viewU);
    return panoramaFile(panorama.radiance, panorama.height, viewU);
  }

  /** The JSON file of `deeplight estimate`. @throws TypeError after `turned`. */
  json(): Blob {
    if (!this.about)
      throw new TypeError("expected a light in its camera's frame, got a turned one");
    return jsonFile(this.lighting, this.about, { lamps: this.lamps, environment: this.panorama });
  }

  /** The same light in another frame: `newFromCamera` takes our directions to that frame's. */
  turned(newFromCamera: Matrix3x3): Light {
    const lamps = this.lamps.map((lamp) => ({
      ...lamp,
      direction: turnedVector(newFromCamera, lamp.direction),
    }));
    const { panorama } = this;
    if (!panorama) return new Light(this.lighting.turned(newFromCamera), null, lamps);
    return Light.of(turnedEnvironment(panorama, newFromCamera), null, lamps);
  }
}

function inBothSigns(allPositive: Float32Array): Harmonics {
  const condonShortley = allPositive.map((value, i) => value * CONDON_SHORTLEY[Math.floor(i / 3)]!);
  return { allPositive, condonShortley };
}

/** A light probe of the platform (WebXR's `XRLightEstimate`), and what of it goes into a light of ours. */
import { CONDON_SHORTLEY, FUSE } from "../contract/generated.ts";
import type { Environment } from "./environment.ts";
import { basis } from "./harmonics.ts";
import { luminance } from "./main-light.ts";
import { dot, normalised, type Vector3 } from "./matrix.ts";
import { enlarged, rowSolidAngles, texelDirections } from "./panorama.ts";
import { remembered } from "./remembered.ts";

/** What the platform says of the light, in the world's frame; its unit is its own. */
export interface Probe {
  /** Radiance up to order 2 without the main light, RGB interleaved, all signs positive. */
  readonly harmonics: Float32Array;
  /** Unit vector towards the main light. */
  readonly direction: Vector3;
  /** RGB, on a surface that faces the main light. */
  readonly irradiance: Vector3;
}

/** How much of the unseen light the platform's word is: as much as the network's. */
const SHARE = 0.5;
/** With less of the sphere seen than this, the two are compared over all of it. */
const LEAST_SEEN_SR = 0.3;
/** Enough for harmonics of order 2. */
const SMOOTH_ROWS = 32;

/** Of an `XRLightEstimate`: Chromium gives ARCore's coefficients as they are, so Condon-Shortley's signs. */
export function probeOf(estimate: {
  readonly sphericalHarmonicsCoefficients: ArrayLike<number>;
  readonly primaryLightDirection: { readonly x: number; readonly y: number; readonly z: number };
  readonly primaryLightIntensity: { readonly x: number; readonly y: number; readonly z: number };
}): Probe {
  const { primaryLightDirection: towards, primaryLightIntensity: intensity } = estimate;
  const { x, y, z } = towards;
  const harmonics = Float32Array.from(
    estimate.sphericalHarmonicsCoefficients,
    (value, i) => value * CONDON_SHORTLEY[Math.floor(i / 3)]!,
  );
  return {
    harmonics,
    direction: x || y || z ? normalised([x, y, z]) : [0, 1, 0],
    irradiance: [intensity.x, intensity.y, intensity.z],
  };
}

/** The probe alone as a panorama: nothing seen. */
export function environmentOfProbe(probe: Probe, height: number): Environment {
  const radiance = drawn(probe, height);
  return { radiance, height, seen: new Float32Array(2 * height * height) };
}

/**
 * A light whose unseen part is in equal shares ours and the platform's. What was seen stays; the
 * probe's unit, which no standard names, is taken from where both know the light.
 */
export function withProbe(light: Environment, probe: Probe): Environment {
  const { radiance, seen, height } = light;
  const theirs = drawn(probe, height);
  const gain = gainBetween(light, theirs);
  const fused = radiance.map((own, i) => {
    const unseen = 1 - seen[Math.floor(i / 3)]!;
    return own + unseen * SHARE * (gain * theirs[i]! - own);
  });
  return { radiance: fused, seen, height };
}

/** How much brighter ours is where something was seen; over everything where that is little. */
function gainBetween({ radiance, seen, height }: Environment, theirs: Float32Array): number {
  const sr = rowSolidAngles(height);
  let [known, ours, other, allOurs, allOther] = [0, 0, 0, 0, 0];
  for (let i = 0; i < seen.length; i++) {
    const weight = sr[Math.floor(i / (2 * height))]!;
    const [a, b] = [weight * luminance(radiance, i), weight * luminance(theirs, i)];
    known += weight * seen[i]!;
    ours += seen[i]! * a;
    other += seen[i]! * b;
    allOurs += a;
    allOther += b;
  }
  if (known >= LEAST_SEEN_SR && other > 0) return ours / other;
  return allOther > 0 ? allOurs / allOther : 0;
}

/** Harmonics, nowhere negative, and the main light as a lobe of the size that lost power has. */
function drawn({ harmonics, direction, irradiance }: Probe, height: number): Float32Array {
  const rows = Math.min(SMOOTH_ROWS, height);
  const known = harmonicsOfTexels(rows);
  const smooth = Float32Array.from({ length: 6 * rows * rows }, (_, i) => {
    const [texel, c] = [Math.floor(i / 3), i % 3];
    let sum = 0;
    for (let k = 0; k < 9; k++) sum += known[9 * texel + k]! * harmonics[3 * k + c]!;
    return Math.max(sum, 0);
  });
  const radiance = enlarged(smooth, rows, height);
  const directions = texelDirections(height);
  const sr = rowSolidAngles(height);
  let facing = 0;
  const lobe = Float32Array.from({ length: radiance.length / 3 }, (_, i) => {
    const towards = [directions[3 * i]!, directions[3 * i + 1]!, directions[3 * i + 2]!] as const;
    const cosine = dot(towards, direction);
    const value = Math.exp(FUSE.LOBE_KAPPA * (cosine - 1));
    facing += value * Math.max(cosine, 0) * sr[Math.floor(i / (2 * height))]!;
    return value;
  });
  for (let i = 0; i < radiance.length; i++) {
    radiance[i]! += (lobe[Math.floor(i / 3)]! * irradiance[i % 3]!) / facing;
  }
  return radiance;
}

/** The nine harmonics in each texel's direction. */
const harmonicsOfTexels = remembered((rows: number): Float32Array => {
  const directions = texelDirections(rows);
  const result = new Float32Array(18 * rows * rows);
  for (let i = 0; i < directions.length / 3; i++) {
    const at = [directions[3 * i]!, directions[3 * i + 1]!, directions[3 * i + 2]!] as const;
    result.set(basis(at, 2), 9 * i);
  }
  return result;
});

/** Light from all directions at its own resolution, and what of it a camera saw: environment.py. */

import type { Matrix3x3 } from "./matrix.ts";
import { cellMeans } from "./means.ts";
import { enlarged, rowSolidAngles, sampled, texelDirections } from "./panorama.ts";

/** A panorama of `height` x 2 `height`, linear RGB: centre = the view, right of it +X, top row up. */
export interface Environment {
  readonly radiance: Float32Array;
  readonly height: number;
  /** How much of each texel pixels of a camera show, 0 to 1; elsewhere the light is estimated. */
  readonly seen: Float32Array;
  /** Of one photo: whose detail was made up elsewhere; null where that is smooth. */
  readonly detailOf?: string | null;
}

/** Part of all directions that was seen, by solid angle: 0 to 1. */
export function seenShare({ seen, height }: Environment): number {
  const sr = rowSolidAngles(height);
  let sum = 0;
  for (let i = 0; i < seen.length; i++) sum += seen[i]! * sr[Math.floor(i / (2 * height))]!;
  return sum / (4 * Math.PI);
}

/** A panorama averaged by solid angle, or interpolated, to a number of rows. */
export function resized(
  values: Float32Array,
  height: number,
  rows: number,
  channels = 3,
): Float32Array {
  if (rows >= height) return enlarged(values, height, rows, channels);
  const sr = rowSolidAngles(height);
  const weights = new Float32Array(2 * height * height);
  sr.forEach((own, row) => {
    weights.fill(own, 2 * height * row, 2 * height * (row + 1));
  });
  const weighted = values.map((value, i) => value * weights[Math.floor(i / channels)]!);
  const [from, to] = [
    { height, width: 2 * height },
    { height: rows, width: 2 * rows },
  ];
  const [power, weight] = [
    cellMeans(weighted, from, to, channels),
    cellMeans(weights, from, to, 1),
  ];
  return power.map((value, i) => value / weight[Math.floor(i / channels)]!);
}

/** The same light in a turned frame; a look-up between texels, not an average. */
export function turnedEnvironment(
  { radiance, height, seen }: Environment,
  newFromOld: Matrix3x3,
): Environment {
  const m = newFromOld;
  const directions = texelDirections(height);
  const thrice = Float32Array.from({ length: 3 * seen.length }, (_, i) => seen[Math.floor(i / 3)]!);
  const result = {
    radiance: new Float32Array(radiance.length),
    seen: new Float32Array(seen.length),
  };
  for (let i = 0; i < seen.length; i++) {
    const [x, y, z] = [directions[3 * i]!, directions[3 * i + 1]!, directions[3 * i + 2]!];
    const old = [
      m[0] * x + m[3] * y + m[6] * z, // the transpose turns back
      m[1] * x + m[4] * y + m[7] * z,
      m[2] * x + m[5] * y + m[8] * z,
    ] as const;
    result.radiance.set(sampled(radiance, height, ...old), 3 * i);
    result.seen[i] = sampled(thrice, height, ...old)[0];
  }
  return { ...result, height };
}

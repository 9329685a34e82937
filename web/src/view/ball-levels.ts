/** A ball of light and its ever coarser averages, down to one pixel. */
import { coverage, nearestLit } from "deeplight/core";

export interface Level {
  readonly size: number;
  /** Radiance, rows from the top; off the disc that of the nearest pixel on it. */
  readonly rgb: Float32Array;
}

export function ballLevels(radiance: Float32Array, size: number): Level[] {
  const nearest = nearestLit(size);
  let rgb: Float32Array = radiance.map(
    (_, i) => radiance[3 * nearest[Math.floor(i / 3)]! + (i % 3)]!,
  );
  let weight: Float64Array = coverage(size);
  const levels: Level[] = [{ size, rgb }];
  for (let half = size / 2; half >= 1; half /= 2) {
    [rgb, weight] = halved(rgb, weight, half);
    levels.push({ size: half, rgb });
  }
  return levels;
}

/** Averages of 2 x 2 pixels, by how much of each lies on the disc. */
function halved(
  rgb: Float32Array,
  weight: Float64Array,
  size: number,
): [Float32Array, Float64Array] {
  const [small, sums] = [new Float32Array(3 * size * size), new Float64Array(size * size)];
  for (let pixel = 0; pixel < size * size; pixel++) {
    const corner = 4 * size * Math.floor(pixel / size) + 2 * (pixel % size);
    const four = [corner, corner + 1, corner + 2 * size, corner + 2 * size + 1];
    const sum = four.reduce((all, from) => all + weight[from]!, 0);
    sums[pixel] = sum;
    for (const from of four) {
      const share = sum > 0 ? weight[from]! / sum : 1 / 4;
      for (let c = 0; c < 3; c++) small[3 * pixel + c]! += share * rgb[3 * from + c]!;
    }
  }
  return [small, sums];
}

/**
 * From the ball to the equirectangular mapping, as resample.latlong_from_ball does: a smooth
 * panorama that holds the energy of each ball pixel. Centre column = the view (-Z), right of it
 * +X, top +Y.
 */
import type { Vector3 } from "./matrix.ts";
import { nearestLit, pixelOfDirection, uvFromDirection } from "./mirror-ball.ts";
import { remembered } from "./remembered.ts";

/** Where the panorama's pixels look: which ball pixel, and what interpolates there. */
interface Grid {
  readonly pixel: Int32Array;
  readonly taps: Int32Array; // four ball pixels for each
  readonly weights: Float32Array; // of the four
  readonly solidAngle: Float64Array; // of a pixel in each row
  readonly area: Float64Array; // solid angle that falls into each ball pixel, thrice
}

/** The ball as a `height` x 2 `height` panorama, RGB. */
export function equirectFromBall(ball: Float32Array, size: number, height: number): Float32Array {
  // Made finer and averaged: at 256 rows a ball pixel catches some 100 texels, and their count
  // would misstate its solid angle, so a lone sun's power, by up to 5 %.
  if (height >= 512) return enlarged(ball, size, height);
  return halved(enlarged(ball, size, 2 * height), height);
}

/** Unit direction of a pixel's centre. */
export function directionOfPixel(row: number, column: number, height: number): Vector3 {
  const theta = (row + 0.5) * (Math.PI / height);
  const phi = (column + 0.5) * (Math.PI / height) - Math.PI;
  return [Math.sin(theta) * Math.sin(phi), Math.cos(theta), -Math.sin(theta) * Math.cos(phi)];
}

/** Solid angle of a pixel in a row, exact for its band. */
export function rowSolidAngle(row: number, height: number): number {
  const [upper, lower] = [row, row + 1].map((edge) => Math.cos(edge * (Math.PI / height)));
  return (upper! - lower!) * (Math.PI / height);
}

function enlarged(ball: Float32Array, size: number, height: number): Float32Array {
  const wanted = spreadOverRim(ball, size);
  const grid = gridOf(size, height);
  const result = interpolatedExp(smoothLog(wanted, size, grid), grid);
  multiplyByPixel(result, shortfall(wanted, result, grid, size), grid);
  return result;
}

/** Logarithms for the ball's pixels which, interpolated, nearly give each pixel its energy. */
function smoothLog(wanted: Float32Array, size: number, grid: Grid): Float32Array {
  // Logarithms do not carry the sun into its neighbours, which would then need a dark halo.
  const darkest = Math.max(1e-6 * wanted.reduce((a, b) => Math.max(a, b), 0), 1e-30);
  const log = wanted.map((value) => Math.log(Math.max(value, darkest)));
  for (let pass = 0; pass < 3; pass++) {
    const factor = shortfall(wanted, interpolatedExp(log, grid), grid, size);
    for (let i = 0; i < log.length; i++) {
      log[i]! += Math.log(Math.min(Math.max(factor[i]!, 0.05), 20));
    }
  }
  return log;
}

/** By how much each ball pixel's power is missed. */
function shortfall(
  wanted: Float32Array,
  values: Float32Array,
  grid: Grid,
  size: number,
): Float32Array {
  const power = binned(values, grid, size);
  return wanted.map((value, i) => (power[i]! > 0 ? (value * grid.area[i]!) / power[i]! : 1));
}

/** Power that falls into each ball pixel, per channel. */
function binned(
  values: Float32Array,
  { pixel, solidAngle }: Pick<Grid, "pixel" | "solidAngle">,
  size: number,
): Float64Array {
  const sums = new Float64Array(3 * size * size);
  const width = pixel.length / solidAngle.length;
  for (let row = 0, i = 0; row < solidAngle.length; row++) {
    const weight = solidAngle[row]!;
    for (const end = i + width; i < end; i++) {
      const to = 3 * pixel[i]!;
      sums[to]! += weight * values[3 * i]!;
      sums[to + 1]! += weight * values[3 * i + 1]!;
      sums[to + 2]! += weight * values[3 * i + 2]!;
    }
  }
  return sums;
}

/** Values whose logarithm is interpolated between the ball's pixels. */
function interpolatedExp(log: Float32Array, { pixel, taps, weights }: Grid): Float32Array {
  const values = new Float32Array(3 * pixel.length);
  for (let i = 0; i < pixel.length; i++) {
    let red = 0;
    let green = 0;
    let blue = 0;
    for (let k = 4 * i; k < 4 * i + 4; k++) {
      const weight = weights[k]!;
      const from = 3 * taps[k]!;
      red += weight * log[from]!;
      green += weight * log[from + 1]!;
      blue += weight * log[from + 2]!;
    }
    values[3 * i] = Math.exp(red);
    values[3 * i + 1] = Math.exp(green);
    values[3 * i + 2] = Math.exp(blue);
  }
  return values;
}

function multiplyByPixel(values: Float32Array, factor: Float32Array, { pixel }: Grid): void {
  for (let i = 0; i < pixel.length; i++) {
    const from = 3 * pixel[i]!;
    values[3 * i]! *= factor[from]!;
    values[3 * i + 1]! *= factor[from + 1]!;
    values[3 * i + 2]! *= factor[from + 2]!;
  }
}

/** The ball with pixels off the disc set to their nearest pixel on it. */
function spreadOverRim(ball: Float32Array, size: number): Float32Array {
  const nearest = nearestLit(size);
  return ball.map((_, i) => ball[3 * nearest[Math.floor(i / 3)]! + (i % 3)]!);
}

const gridOf = remembered((size: number, height: number): Grid => {
  const count = 2 * height * height;
  const [pixel, taps] = [new Int32Array(count), new Int32Array(4 * count)];
  const weights = new Float32Array(4 * count);
  const clamped = (index: number) => Math.min(Math.max(index, 0), size - 1);
  for (let i = 0; i < count; i++) {
    const direction = directionOfPixel(Math.floor(i / (2 * height)), i % (2 * height), height);
    pixel[i] = pixelOfDirection(direction, size);
    const [u, v] = uvFromDirection(direction);
    const [column, row] = [((u + 1) * size) / 2 - 0.5, ((1 - v) * size) / 2 - 0.5];
    const [left, top] = [Math.floor(column), Math.floor(row)];
    for (let k = 0; k < 4; k++) {
      const [down, right] = [k >> 1, k & 1];
      taps[4 * i + k] = clamped(top + down) * size + clamped(left + right);
      weights[4 * i + k] =
        (down ? row - top : 1 - (row - top)) * (right ? column - left : 1 - (column - left));
    }
  }
  const solidAngle = Float64Array.from({ length: height }, (_, row) => rowSolidAngle(row, height));
  const area = binned(new Float32Array(3 * count).fill(1), { pixel, solidAngle }, size);
  return { pixel, taps, weights, solidAngle, area };
});

/** A panorama of twice `height` rows averaged to `height`, by solid angle. */
function halved(fine: Float32Array, height: number): Float32Array {
  const result = new Float32Array(6 * height * height);
  for (let row = 0; row < height; row++) {
    const upper = rowSolidAngle(2 * row, 2 * height);
    const lower = rowSolidAngle(2 * row + 1, 2 * height);
    for (let i = 0; i < 6 * height; i++) {
      const [column, c] = [Math.floor(i / 3), i % 3];
      const at = 3 * (2 * row * 4 * height + 2 * column) + c;
      const below = at + 12 * height;
      const sum = upper * (fine[at]! + fine[at + 3]!) + lower * (fine[below]! + fine[below + 3]!);
      result[row * 6 * height + i] = sum / (2 * (upper + lower));
    }
  }
  return result;
}

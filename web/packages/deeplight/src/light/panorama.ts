/**
 * The equirectangular mapping, latlong.py, and what resample.py does to it. Centre column = the view
 * (-Z), right of it +X, top row +Y. Values are row-major; radiance is RGB.
 */
import { directionOfPixel, rowSolidAngle } from "./equirect.ts";
import type { Vector3 } from "./matrix.ts";
import { cellMeans } from "./means.ts";
import { pixelDirection, pixelOfDirection, solidAngles } from "./mirror-ball.ts";
import { remembered } from "./remembered.ts";

/** Unit direction of every texel of `height` x 2 `height`: x, y, z. */
export const texelDirections = remembered((height: number): Float32Array => {
  const result = new Float32Array(6 * height * height);
  for (let i = 0; i < 2 * height * height; i++) {
    result.set(directionOfPixel(Math.floor(i / (2 * height)), i % (2 * height), height), 3 * i);
  }
  return result;
});

/** Solid angle of a texel in each row; times their number they sum to 4 pi. */
export const rowSolidAngles = remembered(
  (height: number): Float64Array =>
    Float64Array.from({ length: height }, (_, row) => rowSolidAngle(row, height)),
);

/** Row and column of a direction of any length, continuous: 0 is the centre of the first texel. */
export function positionOf(x: number, y: number, z: number, height: number): [number, number] {
  const row = Math.atan2(Math.hypot(x, z), y) * (height / Math.PI) - 0.5;
  const column = (Math.atan2(x, -z) + Math.PI) * (height / Math.PI) - 0.5;
  return [row, column];
}

/** Index of the texel that a direction falls into. */
export function texelOf(x: number, y: number, z: number, height: number): number {
  // As `positionOf`, without an array for each of many pixels.
  const row = Math.atan2(Math.sqrt(x * x + z * z), y) * (height / Math.PI) - 0.5;
  const column = (Math.atan2(x, -z) + Math.PI) * (height / Math.PI) - 0.5;
  const at = Math.min(Math.max(Math.round(row), 0), height - 1);
  return at * 2 * height + (Math.round(column) % (2 * height));
}

/** Radiance summed over all directions, for each channel. */
export function powerOf(radiance: Float32Array, height: number): Vector3 {
  const weights = rowSolidAngles(height);
  const sum: [number, number, number] = [0, 0, 0];
  for (let row = 0, i = 0; row < height; row++) {
    const within = [0, 0, 0];
    for (const end = i + 6 * height; i < end; i += 3) {
      within[0]! += radiance[i]!;
      within[1]! += radiance[i + 1]!;
      within[2]! += radiance[i + 2]!;
    }
    for (const c of [0, 1, 2] as const) sum[c] += weights[row]! * within[c]!;
  }
  return sum;
}

/** A panorama, which is changed, times what brings each channel's sum over the sphere to `power`. */
export function keepPower(radiance: Float32Array, height: number, power: Vector3): Float32Array {
  const have = powerOf(radiance, height);
  const factor = power.map((want, c) => want / Math.max(have[c]!, 1e-30));
  for (let i = 0; i < radiance.length; i++) radiance[i]! *= factor[i % 3]!;
  return radiance;
}

/** Bilinear between the texels of a coarser panorama of `rows`, around the back. */
export function enlarged(
  small: Float32Array,
  rows: number,
  height: number,
  channels = 3,
): Float32Array {
  if (rows === height) return small;
  const [columns, width] = [2 * rows, 2 * height];
  const result = new Float32Array(channels * width * height);
  for (let row = 0, to = 0; row < height; row++) {
    const at = Math.min(Math.max((row + 0.5) * (rows / height) - 0.5, 0), rows - 1);
    const top = Math.floor(at);
    const down = at - top;
    const low = Math.min(top + 1, rows - 1);
    for (let column = 0; column < width; column++) {
      const across = (column + 0.5) * (columns / width) - 0.5;
      const left = Math.floor(across);
      const right = across - left;
      const [a, b] = [(left + columns) % columns, (left + 1) % columns];
      for (let c = 0; c < channels; c++, to++) {
        const upper =
          small[channels * (top * columns + a) + c]! * (1 - right) +
          small[channels * (top * columns + b) + c]! * right;
        const lower =
          small[channels * (low * columns + a) + c]! * (1 - right) +
          small[channels * (low * columns + b) + c]! * right;
        result[to] = upper * (1 - down) + lower * down;
      }
    }
  }
  return result;
}

/** Means over exact, also fractional, areas: a panorama of `height` at fewer rows. */
export function shrunk(
  values: Float32Array,
  height: number,
  rows: number,
  channels = 3,
): Float32Array {
  const [from, to] = [
    { height, width: 2 * height },
    { height: rows, width: 2 * rows },
  ];
  return cellMeans(values, from, to, channels);
}

/** Bilinear values of a panorama in a direction, around the back and held at the poles. */
export function sampled(
  panorama: Float32Array,
  height: number,
  x: number,
  y: number,
  z: number,
): [number, number, number] {
  const found = new Float64Array(3);
  sampleInto(found, panorama, height, [x, y, z], 0);
  return [found[0]!, found[1]!, found[2]!];
}

/** The same of as many channels as `found` takes, in the direction that begins at `at` of many. */
export function sampleInto(
  found: Float64Array,
  panorama: Float32Array,
  height: number,
  directions: ArrayLike<number>,
  at: number,
): void {
  const [width, channels] = [2 * height, found.length];
  const [row, column] = positionOf(
    directions[at]!,
    directions[at + 1]!,
    directions[at + 2]!,
    height,
  );
  const [top, left] = [Math.floor(row), Math.floor(column)];
  const [down, right] = [row - top, column - left];
  found.fill(0);
  for (let k = 0; k < 4; k++) {
    const line = Math.min(Math.max(top + (k >> 1), 0), height - 1);
    const from = channels * (line * width + ((left + (k & 1) + width) % width));
    const weight = (k >> 1 ? down : 1 - down) * (k & 1 ? right : 1 - right);
    for (let c = 0; c < channels; c++) found[c]! += weight * panorama[from + c]!;
  }
}

/** Below this many texels to a pixel of the ball they are split before they are summed up. */
const TEXELS_PER_PIXEL = 200;

/**
 * The mirror ball of a panorama, as `Lighting.from_latlong`: what stands out of a pixel's darkest
 * texel is divided by the pixel's own solid angle, so the power is exact and even light stays even.
 */
export function ballFromPanorama(
  radiance: Float32Array,
  height: number,
  size: number,
): Float32Array {
  const { pixel, area, parts } = binsOf(height, size);
  const whole = solidAngles(size);
  const share = rowSolidAngles(height * parts);
  const power = new Float64Array(3 * size * size);
  const darkest = new Float64Array(3 * size * size).fill(Number.POSITIVE_INFINITY);
  const width = 2 * height * parts;
  for (let i = 0; i < pixel.length; i++) {
    const row = Math.floor(i / width);
    const from = 3 * (Math.floor(row / parts) * 2 * height + Math.floor((i % width) / parts));
    const to = 3 * pixel[i]!;
    for (let c = 0; c < 3; c++) {
      const value = radiance[from + c]!;
      power[to + c]! += share[row]! * value;
      if (value < darkest[to + c]!) darkest[to + c] = value;
    }
  }
  const ball = new Float32Array(3 * size * size);
  for (let i = 0; i < ball.length; i++) {
    const own = Math.floor(i / 3);
    if (area[own] === 0) continue;
    const least = darkest[i]!;
    const above = Math.max(power[i]! - least * area[own]!, 0);
    ball[i] = least + (whole[own]! > 0 ? above / whole[own]! : 0);
  }
  area.forEach((sr, own) => {
    if (sr > 0 || whole[own] === 0) return; // a sliver at the rim that caught no texel
    ball.set(sampled(radiance, height, ...pixelDirection(own, size)), 3 * own);
  });
  return ball;
}

interface Bins {
  readonly pixel: Int32Array; // of the ball, for each part of a texel
  readonly area: Float64Array; // solid angle that falls into each pixel of the ball
  readonly parts: number; // along a texel's side
}

const binsOf = remembered((height: number, size: number): Bins => {
  const wanted = (TEXELS_PER_PIXEL * size * size) / (2 * height * height);
  const parts = Math.max(1, Math.ceil(Math.sqrt(wanted)));
  const fine = height * parts;
  const pixel = new Int32Array(2 * fine * fine);
  const area = new Float64Array(size * size);
  const share = rowSolidAngles(fine);
  for (let i = 0; i < pixel.length; i++) {
    const row = Math.floor(i / (2 * fine));
    pixel[i] = pixelOfDirection(directionOfPixel(row, i % (2 * fine), fine), size);
    area[pixel[i]!]! += share[row]!;
  }
  return { pixel, area, parts };
});

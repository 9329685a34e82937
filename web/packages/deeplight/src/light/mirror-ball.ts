/**
 * The mirror ball mapping: all directions seen in a chrome ball from far away, as in
 * mirror_ball.py. u right, v up; row 0 is the top. The centre shows the light from behind the
 * camera (+Z), the rim what lies straight ahead (-Z). Pixels are row-major.
 */
import type { Matrix3x3, Vector3 } from "./matrix.ts";
import { remembered } from "./remembered.ts";

const FINE = 64; // steps along u in a pixel, to integrate its coverage
const SLIVER = 1e-4; // too thin to hold light

/** Unit direction reflected at ball position (u, v); positions off the disc are taken at its rim. */
export function directionFromUv(u: number, v: number): Vector3 {
  const radius = Math.max(Math.hypot(u, v), 1);
  const [x, y] = [u / radius, v / radius];
  const z = Math.sqrt(Math.max(1 - x * x - y * y, 0));
  return [2 * z * x, 2 * z * y, 2 * z * z - 1];
}

/** Ball position of a unit direction. Straight ahead is the whole rim; its answer is the top. */
export function uvFromDirection([x, y, z]: Vector3): [number, number] {
  const across = Math.hypot(x, y);
  const radius = Math.sqrt(Math.min(Math.max((1 - z) / 2, 0), 1));
  return across < 1e-12 ? [0, radius] : [(x / across) * radius, (y / across) * radius];
}

/** Index of the pixel that a direction falls into. */
export function pixelOfDirection(direction: Vector3, size: number): number {
  return litPixel(direction, size, nearestLit(size));
}

/** Direction of a pixel's centre; a centre off the disc gives the nearest rim direction. */
export function pixelDirection(pixel: number, size: number): Vector3 {
  const [row, column] = [Math.floor(pixel / size), pixel % size];
  return directionFromUv((2 * (column + 0.5)) / size - 1, 1 - (2 * (row + 0.5)) / size);
}

/** Share of each pixel's area that lies on the disc, 0 to 1. */
export const coverage = remembered((size: number): Float64Array => {
  const area = new Float64Array(size * size);
  for (let column = 0; column < size * FINE; column++) {
    const u = Math.abs((column + 0.5) * (2 / (size * FINE)) - 1);
    const halfHeight = Math.sqrt(1 - u * u);
    for (let row = 0; row < size; row++) {
      const top = 1 - row * (2 / size);
      const low = Math.min(Math.abs(top), Math.abs(top - 2 / size));
      const middle = size % 2 === 1 && row === (size - 1) / 2; // straddles the horizon
      const share = middle ? halfHeight * size : ((halfHeight - low) * size) / 2;
      area[row * size + Math.floor(column / FINE)]! += Math.min(Math.max(share, 0), 1) / FINE;
    }
  }
  return area.map((share) => (share < SLIVER ? 0 : share));
});

/** Linear radiance of a ball of ln radiance; 0 off the disc. */
export function radianceOfBall(logRadiance: Float32Array, size: number): Float32Array {
  const lit = coverage(size);
  return logRadiance.map((value, i) => (lit[Math.floor(i / 3)]! > 0 ? Math.exp(value) : 0));
}

/** Solid angle of each pixel in sr; they sum to 4 pi. */
export const solidAngles = remembered(
  (size: number): Float64Array => coverage(size).map((share) => share * (16 / size ** 2)),
);

/** Radiance of a ball summed over all directions, RGB. */
export function powerOfBall(ball: Float32Array, size: number): Vector3 {
  const sum: [number, number, number] = [0, 0, 0];
  solidAngles(size).forEach((sr, i) => {
    for (const c of [0, 1, 2] as const) sum[c] += sr * ball[3 * i + c]!;
  });
  return sum;
}

/** For each pixel the index of itself, or of the pixel at the rim towards the centre. */
export const nearestLit = remembered((size: number): Int32Array => {
  const index = new Int32Array(size * size);
  const lit = coverage(size);
  for (let pixel = 0; pixel < index.length; pixel++) {
    const u = (2 * ((pixel % size) + 0.5)) / size - 1;
    const v = 1 - (2 * (Math.floor(pixel / size) + 0.5)) / size;
    const inward = Math.min(1, (1 - 1 / size) / Math.max(Math.hypot(u, v), 1e-9));
    index[pixel] = lit[pixel]! > 0 ? pixel : pixelAt(u * inward, v * inward, size);
  }
  return index;
});

/** Places spread evenly over the lit pixels: which pixel each is in, its direction, its share. */
export interface Subpixels {
  readonly pixel: Int32Array;
  readonly direction: Float64Array; // x, y, z of each
  readonly solidAngle: Float64Array; // sr; those of one pixel sum to the pixel's
}

/** Places in every lit pixel, `along`^2 where it lies wholly on the disc, else those on it. */
export const subpixels = remembered((size: number, along = 4): Subpixels => {
  const pixels: number[] = [];
  const directions: number[] = [];
  const shares: number[] = [];
  const whole = solidAngles(size);
  for (let pixel = 0; pixel < size * size; pixel++) {
    if (whole[pixel] === 0) continue;
    const places = placesOnDisc(pixel, size, along);
    for (const [u, v] of places) {
      pixels.push(pixel);
      directions.push(...directionFromUv(u, v));
      shares.push(whole[pixel]! / places.length);
    }
  }
  return {
    pixel: Int32Array.from(pixels),
    direction: Float64Array.from(directions),
    solidAngle: Float64Array.from(shares),
  };
});

/** Value of a mirror ball in a direction, bilinear; pixels off the disc are not looked at. */
export function onBall(
  ball: Float32Array,
  direction: Vector3,
  into: [number, number, number],
): void {
  const size = Math.sqrt(ball.length / 3);
  const nearest = nearestLit(size);
  const [u, v] = uvFromDirection(direction);
  const [column, row] = [(u + 1) * (size / 2) - 0.5, (1 - v) * (size / 2) - 0.5];
  const [left, top] = [Math.floor(column), Math.floor(row)];
  const [right, down] = [column - left, row - top];
  into[0] = into[1] = into[2] = 0;
  for (let k = 0; k < 4; k++) {
    const r = Math.min(Math.max(top + (k >> 1), 0), size - 1);
    const c = Math.min(Math.max(left + (k & 1), 0), size - 1);
    const from = 3 * nearest[r * size + c]!;
    const part = (k >> 1 ? down : 1 - down) * (k & 1 ? right : 1 - right);
    into[0] += part * ball[from]!;
    into[1] += part * ball[from + 1]!;
    into[2] += part * ball[from + 2]!;
  }
}

/** A ball of `channels` values per pixel in a turned frame: area averages, energy kept to 1 %. */
export function turnedBall(
  ball: Float32Array,
  size: number,
  newFromOld: Matrix3x3,
  along = 4,
): Float32Array {
  const places = subpixels(size, along);
  const result = new Float32Array(ball.length);
  const [m, whole, nearest] = [newFromOld, solidAngles(size), nearestLit(size)];
  const old: [number, number, number] = [0, 0, 0];
  for (let i = 0; i < places.pixel.length; i++) {
    const [x, y, z] = directionAt(places, i);
    old[0] = m[0] * x + m[3] * y + m[6] * z; // the transpose turns back
    old[1] = m[1] * x + m[4] * y + m[7] * z;
    old[2] = m[2] * x + m[5] * y + m[8] * z;
    const [to, from] = [3 * places.pixel[i]!, 3 * litPixel(old, size, nearest)];
    const share = places.solidAngle[i]! / whole[places.pixel[i]!]!;
    result[to]! += share * ball[from]!;
    result[to + 1]! += share * ball[from + 1]!;
    result[to + 2]! += share * ball[from + 2]!;
  }
  return result;
}

export function directionAt(places: Subpixels, i: number): Vector3 {
  const { direction } = places;
  return [direction[3 * i]!, direction[3 * i + 1]!, direction[3 * i + 2]!];
}

function litPixel(direction: Vector3, size: number, nearest: Int32Array): number {
  const [u, v] = uvFromDirection(direction);
  // A direction on the very rim can round into a corner pixel that holds no light.
  return nearest[pixelAt(u, v, size)]!;
}

function pixelAt(u: number, v: number, size: number): number {
  const column = Math.min(Math.max(Math.trunc(((u + 1) * size) / 2), 0), size - 1);
  const row = Math.min(Math.max(Math.trunc(((1 - v) * size) / 2), 0), size - 1);
  return row * size + column;
}

function placesOnDisc(pixel: number, size: number, along: number): [number, number][] {
  const places: [number, number][] = [];
  for (let i = 0; i < along * along; i++) {
    const column = (pixel % size) * along + (i % along);
    const row = Math.floor(pixel / size) * along + Math.floor(i / along);
    places.push([
      (2 * (column + 0.5)) / (size * along) - 1,
      1 - (2 * (row + 0.5)) / (size * along),
    ]);
  }
  const radius = ([u, v]: [number, number]) => Math.hypot(u, v);
  const inside = places.filter((place) => radius(place) <= 1);
  // A sliver whose places all miss the disc keeps the one nearest the rim, moved onto it.
  return inside.length > 0 ? inside : [places.reduce((a, b) => (radius(b) < radius(a) ? b : a))];
}

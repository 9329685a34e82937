/**
 * What lies around the photo: the network's ball as a smooth panorama that fits the photo's edge.
 * surroundings.py says why it is smoothed so.
 */
import { PHOTO_LIGHT } from "../contract/generated.ts";
import { radianceFromPixel } from "../light/camera-response.ts";
import { dot, normalised, type Vector3 } from "../light/matrix.ts";
import { cellMeans } from "../light/means.ts";
import { solidAngles, subpixels } from "../light/mirror-ball.ts";
import {
  enlarged,
  keepPower,
  powerOf,
  rowSolidAngles,
  sampled,
  texelDirections,
} from "../light/panorama.ts";
import { remembered } from "../light/remembered.ts";
import { evenly, type PlacedPhoto, smoothstep } from "./image-plane.ts";

const { BLUR_RAD, CLIPPED, DARKEST, MAP_ROWS, MOST_ADAPTED, MOST_SHOWN, REACH_RAD } = PHOTO_LIGHT;
const { RING_CELLS, ROWS, STAR_BLUR_RAD, STAR_FROM_RAD, STAR_TO_RAD } = PHOTO_LIGHT;
const COLUMNS = 2 * ROWS;
const PASSES = 12;

/** Rows at which the map is fitted to the photo; finer ones lie between these. */
export function mapRows(height: number): number {
  return Math.min(MAP_ROWS, height);
}

/** A panorama of the ball without pixels and without spokes straight ahead; its power is kept. */
export function smoothMap(ball: Float32Array, size: number, height: number): Float32Array {
  const small = spread(ball, size);
  return keepPower(enlarged(small, ROWS, height), height, powerOf(small, ROWS));
}

/**
 * How each texel of the map is mixed from the ball's pixels, of one quarter of the map: the others
 * mirror it. Rows sum to 1, so even light stays even; columns hold their pixel's solid angle, so its
 * power is kept (Sinkhorn 1964).
 */
const quarterOf = remembered((size: number): Float32Array => {
  const lit = solidAngles(size);
  const count = size * size;
  const kernel = lobes(size);
  const weights = rowSolidAngles(ROWS);
  for (let pass = 0; pass < PASSES; pass++) {
    const held = new Float64Array(count);
    for (let texel = 0; texel < kernel.length / count; texel++) {
      const row = kernel.subarray(texel * count, (texel + 1) * count);
      let sum = 0;
      for (let i = 0; i < count; i++) sum += row[i]!;
      const weight = weights[Math.floor(texel / ROWS)]!;
      for (let i = 0; i < count; i++) {
        row[i]! /= sum;
        held[i]! += weight * row[i]!;
      }
    }
    const whole = mirroredSums(held, size);
    const factor = lit.map((sr, i) => (whole[i]! > 0 ? sr / whole[i]! : 0));
    for (let i = 0; i < kernel.length; i++) kernel[i]! *= factor[i % count]!;
  }
  return kernel;
});

/** What all four quarters hold of each pixel, from what one does. */
function mirroredSums(held: Float64Array, size: number): Float64Array {
  return held.map((_, i) => {
    const [row, column] = [Math.floor(i / size), i % size];
    let sum = 0;
    for (const r of [row, size - 1 - row]) {
      for (const c of [column, size - 1 - column]) sum += held[r * size + c]!;
    }
    return sum;
  });
}

/** Smooth lobes of every pixel on the quarter of the map that lies up and left. */
function lobes(size: number): Float32Array {
  const { pixel, direction } = subpixels(size, 2);
  const lit = solidAngles(size);
  const directions = texelDirections(ROWS);
  const kernel = new Float32Array((ROWS / 2) * ROWS * size * size);
  for (let texel = 0; texel < (ROWS / 2) * ROWS; texel++) {
    const from = 3 * (Math.floor(texel / ROWS) * COLUMNS + (texel % ROWS));
    const [x, y, z] = [directions[from]!, directions[from + 1]!, directions[from + 2]!];
    const away = Math.acos(Math.min(Math.max(z, -1), 1));
    const star = smoothstep((away - STAR_FROM_RAD) / (STAR_TO_RAD - STAR_FROM_RAD));
    const sharpness = 1 / (BLUR_RAD + (STAR_BLUR_RAD - BLUR_RAD) * star) ** 2;
    const to = texel * size * size;
    for (let i = 0; i < pixel.length; i++) {
      const own = pixel[i]!;
      if (lit[own] === 0) continue;
      const cosine = x * direction[3 * i]! + y * direction[3 * i + 1]! + z * direction[3 * i + 2]!;
      const exponent = (cosine - 1) * sharpness;
      if (exponent > -60) kernel[to + own]! += Math.exp(exponent);
    }
  }
  return kernel;
}

function spread(ball: Float32Array, size: number): Float32Array {
  const kernel = quarterOf(size);
  const count = size * size;
  const result = new Float32Array(3 * ROWS * COLUMNS);
  const sums = new Float64Array(12);
  for (let texel = 0; texel < (ROWS / 2) * ROWS; texel++) {
    const [row, column] = [Math.floor(texel / ROWS), texel % ROWS];
    sums.fill(0);
    for (let i = 0, from = texel * count; i < count; i++, from++) {
      const weight = kernel[from]!;
      if (weight < 1e-9) continue;
      const [r, c] = [Math.floor(i / size), i % size];
      addMirrored(sums, ball, weight, r, c, size);
    }
    for (let quarter = 0; quarter < 4; quarter++) {
      const to = quarter & 2 ? ROWS - 1 - row : row;
      const at = quarter & 1 ? COLUMNS - 1 - column : column;
      result.set(sums.subarray(3 * quarter, 3 * quarter + 3), 3 * (to * COLUMNS + at));
    }
  }
  return result;
}

function addMirrored(
  sums: Float64Array,
  ball: Float32Array,
  weight: number,
  row: number,
  column: number,
  size: number,
): void {
  for (let quarter = 0; quarter < 4; quarter++) {
    const r = quarter & 2 ? size - 1 - row : row;
    const c = quarter & 1 ? size - 1 - column : column;
    const from = 3 * (r * size + c);
    for (let k = 0; k < 3; k++) sums[3 * quarter + k]! += weight * ball[from + k]!;
  }
}

/** What the photo shows along its edge. */
interface Edge {
  readonly directions: readonly Vector3[];
  /** ln of photo over map, RGB. */
  readonly ratio: readonly number[];
}

/**
 * The map brought to what the photo shows at its edge, less and less away from it: the ratio of the
 * two along the edge, interpolated with weights that fall with the angle (Shepard 1968), as the one of
 * its geometric and its arithmetic mean that changes the map less.
 */
export function adapted(map: Float32Array, rows: number, photo: PlacedPhoto): Float32Array {
  const edge = edgeOf(map, rows, photo);
  const { directions } = edge;
  const middle = normalised(
    directions.reduce<Vector3>(
      (sum, d) => [sum[0] + d[0], sum[1] + d[1], sum[2] + d[2]],
      [0, 0, 0],
    ),
  );
  const least = Math.min(...directions.map((d) => dot(d, middle)));
  const farthest = Math.cos(Math.min(Math.acos(Math.max(least, -1)) + REACH_RAD, Math.PI));
  const shorter = 2 * Math.min(photo.plane.halfWidth, photo.plane.halfHeight);
  const softness = (shorter / RING_CELLS) ** 2 / 4;
  const texels = texelDirections(rows);
  const result = map.slice();
  for (let i = 0; i < texels.length; i += 3) {
    const texel: Vector3 = [texels[i]!, texels[i + 1]!, texels[i + 2]!];
    if (!(dot(texel, middle) > farthest)) continue;
    const { logs, mean, away } = meanRatio(edge, texel, softness);
    const fade = smoothstep(1 - away / REACH_RAD) ** 2;
    for (let c = 0; c < 3; c++) {
      // Of two ways to fade, too, the one that reaches less far, for brighter and for darker.
      result[i + c]! *=
        Math.exp(fade * Math.max(logs[c]!, 0)) * (1 - fade * Math.max(1 - mean[c]!, 0));
    }
  }
  return result;
}

function meanRatio({ directions, ratio }: Edge, texel: Vector3, softness: number) {
  const logs = [0, 0, 0];
  const mean = [0, 0, 0];
  let [whole, nearest] = [0, 4];
  directions.forEach((direction, k) => {
    const squared = 2 - 2 * Math.min(Math.max(dot(texel, direction), -1), 1);
    nearest = Math.min(nearest, squared);
    const weight = 1 / (squared + softness) ** 1.5;
    whole += weight;
    for (const c of [0, 1, 2]) {
      logs[c]! += weight * ratio[3 * k + c]!;
      mean[c]! += weight * Math.exp(ratio[3 * k + c]!);
    }
  });
  const away = 2 * Math.asin(Math.sqrt(nearest) / 2);
  const over = (sums: number[]) => sums.map((sum) => sum / whole);
  return { logs: over(logs), mean: over(mean), away };
}

function edgeOf(map: Float32Array, rows: number, photo: PlacedPhoto): Edge {
  const cell = Math.min(photo.height, photo.width) / RING_CELLS;
  const counts = {
    height: Math.max(3, evenly(photo.height / cell)),
    width: Math.max(3, evenly(photo.width / cell)),
  };
  const encoded = cellMeans(photo.pixels, photo, counts);
  const { halfWidth, halfHeight } = photo.plane;
  const directions: Vector3[] = [];
  const ratio: number[] = [];
  for (let i = 0; i < counts.height * counts.width; i++) {
    const [row, column] = [Math.floor(i / counts.width), i % counts.width];
    const onRing = row % (counts.height - 1) === 0 || column % (counts.width - 1) === 0;
    if (!onRing) continue;
    const direction = normalised([
      ((column + 0.5) * (2 / counts.width) - 1) * halfWidth,
      (1 - (row + 0.5) * (2 / counts.height)) * halfHeight,
      -1,
    ]);
    directions.push(direction);
    const here = sampled(map, rows, ...direction);
    for (let c = 0; c < 3; c++) ratio.push(ratioOf(encoded[3 * i + c]!, here[c]!));
  }
  return { directions, ratio };
}

function ratioOf(encoded: number, here: number): number {
  const linear = Math.min(radianceFromPixel(encoded), MOST_SHOWN);
  const ln = Math.log(Math.max(linear, DARKEST) / Math.max(here, DARKEST));
  const within = Math.min(Math.max(ln, -MOST_ADAPTED), MOST_ADAPTED);
  return encoded > 0.9 * CLIPPED ? Math.max(within, 0) : within; // there it only says "at least"
}

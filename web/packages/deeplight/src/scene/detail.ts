/** Made-up detail for the directions that no photo saw, so that reflections look like a place. fill.py. */
import { DETAIL, LUMINANCE } from "../contract/generated.ts";
import {
  cross,
  type Matrix3x3,
  normalised,
  transposed,
  turned,
  type Vector3,
} from "../light/matrix.ts";
import {
  enlarged,
  rowSolidAngles,
  sampled,
  shrunk,
  texelDirections,
  texelOf,
} from "../light/panorama.ts";
import { hiddenKept } from "./continuation.ts";
import type { ProjectedPhoto } from "./image-plane.ts";
import type { Detail } from "./scene-light.ts";

const { BRIGHTEST, COLOUR_COUNTS, DARKEST, DETAIL_ROWS, ROWS } = DETAIL;
const { LARGEST_RATIO, SEEN_COUNTS, STRAY, SURE } = DETAIL;
const [COLUMNS, DETAIL_COLUMNS] = [2 * ROWS, 2 * DETAIL_ROWS];
const TEXELS = ROWS * COLUMNS;

export type Kind = "indoor" | "outdoor";

/** One panorama of the library. */
export interface LibraryPlace {
  readonly name: string;
  readonly kind: string;
  /** ln of its light at `ROWS` rows, RGB. */
  readonly smooth: Float32Array;
  /** ln of its detail's ratio at `DETAIL_ROWS` rows, 128 for none, RGBA. */
  readonly levels: Uint8Array | Uint8ClampedArray;
}

/** Of what kind a place is for sure; null where the network does not know, or says nothing of it. */
export function sureKind(heads: Readonly<Record<string, number>> | null): Kind | null {
  const indoors = heads?.indoors ?? 0.5;
  if (Math.max(indoors, 1 - indoors) < SURE) return null;
  return indoors > 0.5 ? "indoor" : "outdoor";
}

/**
 * Smooth surroundings with the detail of the place that fits them best, of `DETAIL_ROWS`, and that
 * place's name. The smooth light stays, and the power of what the photo does not show.
 *
 * @param map linear radiance without lamps, camera frame, of `rows`.
 * @param up against gravity, so that horizons lie level.
 */
export function detailed(
  map: Float32Array,
  rows: number,
  shown: ProjectedPhoto,
  up: Vector3,
  places: readonly LibraryPlace[],
): ReturnType<Detail> {
  const levelFromCamera = levelBy(up);
  const [smooth, seen] = levelled(map, rows, shown, transposed(levelFromCamera));
  const { place, columns, flip } = bestPlace(smooth, seen, places);
  const detail = detailOf(place, (DETAIL_ROWS / ROWS) * columns, flip);
  const plain = enlarged(map, rows, DETAIL_ROWS);
  const rich = plain.slice();
  const texels = texelDirections(DETAIL_ROWS);
  for (let i = 0; i < rich.length; i += 3) {
    const texel = turned(levelFromCamera, vectorAt(texels, i));
    sampled(detail, DETAIL_ROWS, ...texel).forEach((ratio, c) => {
      rich[i + c]! *= Math.exp(ratio);
    });
  }
  const after = shrunk(rich, DETAIL_ROWS, ROWS);
  const change = shrunk(plain, DETAIL_ROWS, ROWS).map((was, i) => was / Math.max(after[i]!, STRAY));
  const back = enlarged(change, ROWS, DETAIL_ROWS);
  for (let i = 0; i < rich.length; i++) rich[i]! *= back[i]!;
  const radiance = hiddenKept(rich, plain, DETAIL_ROWS, shown);
  return { radiance, rows: DETAIL_ROWS, name: place.name };
}

/** The frame whose +Y is up and whose +X is level, the view above or below -Z. */
function levelBy(up: Vector3): Matrix3x3 {
  const right = normalised([up[1] || 1e-9, -up[0], 0]);
  return [...right, ...up, ...cross(right, up)] as unknown as Matrix3x3;
}

/** ln radiance with the photo in it, horizon level, at `ROWS` rows, and how much of it is seen. */
function levelled(
  map: Float32Array,
  rows: number,
  shown: ProjectedPhoto,
  cameraFromLevel: Matrix3x3,
): [smooth: Float32Array, seen: Float32Array] {
  const texels = texelDirections(4 * ROWS);
  const light = new Float32Array(texels.length);
  const seen = new Float32Array(texels.length / 3);
  for (let i = 0; i < texels.length; i += 3) {
    const direction = turned(cameraFromLevel, vectorAt(texels, i));
    const at = texelOf(...direction, shown.height);
    seen[i / 3] = shown.seen[at]!;
    sampled(map, rows, ...direction).forEach((value, c) => {
      light[i + c] = value + (shown.radiance[3 * at + c]! - value) * shown.seen[at]!;
    });
  }
  return [shrunk(limitedLog(light), 4 * ROWS, ROWS), shrunk(seen, 4 * ROWS, ROWS, 1)];
}

/** ln of radiance over its median, lamps limited. */
function limitedLog(radiance: Float32Array): Float32Array {
  const bright = new Float64Array(radiance.length / 3).map((_, i) =>
    LUMINANCE.reduce((sum, weight, c) => sum + weight * radiance[3 * i + c]!, 0),
  );
  bright.sort();
  const middle = bright.length / 2; // an even number
  const median = Math.max((bright[middle - 1]! + bright[middle]!) / 2, 1e-9);
  return radiance.map((v) => Math.log(Math.min(Math.max(v / median, DARKEST), BRIGHTEST)));
}

/**
 * The place nearest to a smooth light, by how many columns to turn it, and whether mirrored: by the
 * correlation over the sphere, seen directions counting for more.
 */
export function bestPlace(
  smooth: Float32Array,
  seen: Float32Array,
  places: readonly LibraryPlace[],
) {
  const sr = rowSolidAngles(ROWS);
  const weight = Float64Array.from(
    seen,
    (part, i) => sr[Math.floor(i / COLUMNS)]! * (1 + SEEN_COUNTS * part),
  );
  const whole = weight.reduce((sum, value) => sum + value);
  for (let i = 0; i < TEXELS; i++) weight[i]! /= whole;
  const wanted = lessColour(smooth);
  const means = [0, 0, 0];
  for (let i = 0; i < wanted.length; i++) means[i % 3]! += wanted[i]! * weight[Math.floor(i / 3)]!;
  for (let i = 0; i < wanted.length; i++) wanted[i]! -= means[i % 3]!;
  let best = { place: places[0]!, columns: 0, flip: false };
  let most = Number.NEGATIVE_INFINITY;
  for (const flip of [false, true]) {
    for (const place of places) {
      const map = lessColour(flip ? mirrored(place.smooth, 3, COLUMNS) : place.smooth);
      for (let columns = 0; columns < COLUMNS; columns++) {
        const alike = likeness(map, wanted, weight, columns);
        if (alike <= most) continue;
        most = alike;
        best = { place, columns, flip };
      }
    }
  }
  return best;
}

/** Correlation of a map that is turned by a number of columns with what is wanted. */
function likeness(
  map: Float32Array,
  wanted: Float32Array,
  weight: Float64Array,
  columns: number,
): number {
  const means = [0, 0, 0];
  let [alike, squares] = [0, 0];
  for (let texel = 0; texel < TEXELS; texel++) {
    const to = texel - (texel % COLUMNS) + ((texel + columns) % COLUMNS);
    for (let c = 0; c < 3; c++) {
      const weighted = map[3 * texel + c]! * weight[to]!;
      alike += weighted * wanted[3 * to + c]!;
      squares += weighted * map[3 * texel + c]!;
      means[c]! += weighted;
    }
  }
  const spread = squares - means.reduce((sum, mean) => sum + mean ** 2, 0);
  return alike / Math.sqrt(Math.max(spread, 1e-12));
}

/** Channels whose sum of squares counts colour less than luminance. */
function lessColour(logs: Float32Array): Float32Array {
  return logs.map((value, i) => {
    const first = i - (i % 3);
    const mean = (logs[first]! + logs[first + 1]! + logs[first + 2]!) / 3;
    return mean + COLOUR_COUNTS * (value - mean);
  });
}

/** ln of a place's ratios, RGB, mirrored where that is wanted, then turned to the right. */
function detailOf({ levels }: LibraryPlace, columns: number, flip: boolean): Float32Array {
  const unit = Math.log(LARGEST_RATIO) / 127;
  const from = flip ? mirrored(levels, 4, DETAIL_COLUMNS) : levels;
  return Float32Array.from({ length: 3 * DETAIL_ROWS * DETAIL_COLUMNS }, (_, i) => {
    const texel = Math.floor(i / 3);
    const column = (texel + DETAIL_COLUMNS - columns) % DETAIL_COLUMNS;
    return (from[4 * (texel - (texel % DETAIL_COLUMNS) + column) + (i % 3)]! - 128) * unit;
  });
}

function mirrored<T extends Float32Array | Uint8Array | Uint8ClampedArray>(
  values: T,
  channels: number,
  width: number,
): T {
  return values.map((_, i) => {
    const texel = Math.floor(i / channels);
    const column = texel % width;
    return values[channels * (texel + width - 1 - 2 * column) + (i % channels)]!;
  }) as T;
}

function vectorAt(values: Float32Array, i: number): Vector3 {
  return [values[i]!, values[i + 1]!, values[i + 2]!];
}

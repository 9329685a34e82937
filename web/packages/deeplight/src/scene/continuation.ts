/**
 * The photo continued all around, so that what it does not show looks like the same place: each level
 * row goes on to both sides as its own mirror images. continuation.py says why.
 */
import { CONTINUATION } from "../contract/generated.ts";
import { cross, type Matrix3x3, normalised, transposed, type Vector3 } from "../light/matrix.ts";
import { keepPower, powerOf, sampleInto, shrunk, texelDirections } from "../light/panorama.ts";
import { type ProjectedPhoto, smoothstep } from "./image-plane.ts";

const { COLOUR, DARKEST, DETAIL_LEFT, DETAIL_TO_RAD, FADE_RAD, GROUND_RAD } = CONTINUATION;
const { LEAST_OF_WIDEST, LEAST_TURN_RAD, SHOWN, STEEPEST, WEIGHT } = CONTINUATION;

/** Of a level panorama the texels of each row that the photo shows without a gap around the middle. */
interface LevelPhoto {
  readonly rows: number;
  /** Columns; of rows that show nothing the last comes before the first. */
  readonly first: Int32Array;
  readonly last: Int32Array;
  /** ln radiance, RGB, from the first to the last. */
  readonly logs: Float32Array;
}

/**
 * The map blended with the photo's level rows, continued to both sides; what lies where the photo
 * looks stays, and so does the power of the rest.
 *
 * @param map linear radiance, camera frame, of `rows`.
 * @param up of length 1, camera frame.
 */
export function continued(
  map: Float32Array,
  rows: number,
  shown: ProjectedPhoto,
  up: Vector3,
): Float32Array {
  const cameraFromLevel = levelOf(up);
  if (!cameraFromLevel) return map;
  const seen = shrunk(shown.seen, shown.height, rows, 1);
  const around = continuedRows(levelPhoto(shown, seen, rows, cameraFromLevel));
  if (!around) return map;
  const unseen = map.map((value, i) => value * (1 - seen[Math.floor(i / 3)]!));
  const power = powerOf(unseen, rows);
  const levels = turnedTexels(rows, transposed(cameraFromLevel));
  const found = new Float64Array(4);
  for (let i = 0; i < map.length; i += 3) {
    const free = 1 - seen[i / 3]!;
    if (free === 0) continue;
    sampleInto(found, around, rows, levels, i);
    const weight = found[3]!;
    if (weight === 0) continue;
    let mean = 0;
    for (let c = 0; c < 3; c++) {
      found[c] = free * (found[c]! - weight * Math.log(Math.max(map[i + c]!, DARKEST)));
      mean += found[c]! / 3;
    }
    for (let c = 0; c < 3; c++) unseen[i + c]! *= Math.exp(mean + COLOUR * (found[c]! - mean));
  }
  const result = keepPower(unseen, rows, power);
  for (let i = 0; i < map.length; i++) result[i]! += map[i]! * seen[Math.floor(i / 3)]!;
  return result;
}

/** Camera from level, where +Y is up and -Z straight ahead; null where no side is ahead. */
function levelOf(up: Vector3): Matrix3x3 | null {
  if (Math.abs(up[2]) > STEEPEST) return null;
  const right = normalised(cross([0, 0, -1], up));
  const back = cross(right, up);
  return transposed([...right, ...up, ...back]);
}

/** Directions of all texels of a panorama, in another frame. */
function turnedTexels(rows: number, newFromOld: Matrix3x3): Float32Array {
  const old = texelDirections(rows);
  return old.map((_, i) => {
    const [row, from] = [3 * (i % 3), i - (i % 3)];
    return (
      newFromOld[row]! * old[from]! +
      newFromOld[row + 1]! * old[from + 1]! +
      newFromOld[row + 2]! * old[from + 2]!
    );
  });
}

function levelPhoto(
  photo: ProjectedPhoto,
  seen: Float32Array,
  rows: number,
  cameraFromLevel: Matrix3x3,
): LevelPhoto {
  const isFine = photo.height > 2 * rows; // looked up point by point, that would be noise
  const radiance = isFine ? shrunk(photo.radiance, photo.height, rows) : photo.radiance;
  const height = isFine ? rows : photo.height;
  const directions = turnedTexels(rows, cameraFromLevel);
  const logs = new Float32Array(6 * rows * rows);
  const [covered, found] = [new Float64Array(1), new Float64Array(3)];
  /** Whether the photo shows a texel, whose values it notes. */
  const shows = (row: number, column: number): boolean => {
    const i = 3 * (row * 2 * rows + column);
    sampleInto(covered, seen, rows, directions, i);
    if (covered[0]! <= SHOWN) return false;
    sampleInto(found, radiance, height, directions, i);
    for (let c = 0; c < 3; c++) logs[i + c] = Math.log(Math.max(found[c]!, DARKEST));
    return true;
  };
  const [first, last] = [new Int32Array(rows).fill(rows), new Int32Array(rows).fill(rows - 1)];
  for (let row = 0; row < rows; row++) {
    while (last[row]! + 1 < 2 * rows && shows(row, last[row]! + 1)) last[row]!++;
    while (first[row]! > 0 && shows(row, first[row]! - 1)) first[row]!--;
  }
  return { rows, first, last, logs };
}

/**
 * A level panorama of the photo going on to all sides: ln radiance times weight, and weight. Null
 * where the photo is too small to go on.
 */
function continuedRows(photo: LevelPhoto): Float32Array | null {
  const { rows, first, last } = photo;
  const length = last.map((column, row) => column - first[row]! + 1);
  const widest = Math.max(...length);
  const least = Math.max((LEAST_TURN_RAD * rows) / Math.PI, LEAST_OF_WIDEST * (widest - 1));
  const known: number[] = [];
  length.forEach((columns, row) => {
    if (columns - 1 >= least) known.push(row);
  });
  if (known.length === 0) return null;
  const lowest = known.at(-1)!;
  const result = new Float32Array(8 * rows * rows);
  for (let row = 0, next = 0; row < rows; row++) {
    while (known[next]! < Math.min(row, lowest)) next++;
    continueRow(result, photo, row, known[next]!, row >= lowest);
  }
  return result;
}

/** Fills a row with what the photo shows in another, back and forth. */
function continueRow(
  result: Float32Array,
  { rows, first, last, logs }: LevelPhoto,
  row: number,
  from: number,
  isLowest: boolean,
): void {
  const texel = Math.PI / rows;
  const fade = smoothstep(1 - (Math.abs(row - from) * texel) / FADE_RAD);
  const weight = WEIGHT * Math.max(fade, isLowest ? groundAt((from + 0.5) * texel) : 0);
  if (weight === 0) return;
  const [start, end] = [first[from]!, last[from]!];
  const span = end - start + 1;
  const mean = rowMean(logs, from * 2 * rows + start, span);
  for (let column = 0, to = 8 * row * rows; column < 2 * rows; column++, to += 4) {
    const aside = Math.max(start - column, column - end, 0) * texel;
    const near = DETAIL_LEFT + (1 - DETAIL_LEFT) * smoothstep(1 - aside / DETAIL_TO_RAD);
    const detail = fade * near;
    // The remainder of a negative number is negative here.
    const along = (((column - start) % (2 * span)) + 2 * span) % (2 * span);
    const at = 3 * (from * 2 * rows + start + Math.min(along, 2 * span - 1 - along));
    for (let c = 0; c < 3; c++) {
      result[to + c] = weight * (mean[c]! + detail * (logs[at + c]! - mean[c]!));
    }
    result[to + 3] = weight;
  }
}

/** How far a row counts as ground, by its angle from straight up. */
function groundAt(fromUpRad: number): number {
  const [from, to] = GROUND_RAD;
  return smoothstep((fromUpRad - Math.PI / 2 - from) / (to - from));
}

/** Mean of RGB texels from one on. */
function rowMean(values: Float32Array, from: number, count: number): Float64Array {
  const mean = new Float64Array(3);
  for (let i = 3 * from; i < 3 * (from + count); i++) mean[i % 3]! += values[i]! / count;
  return mean;
}

/**
 * The photo continued all around, so that what it does not show looks like the same place: the map is
 * brought to the means of the photo's level rows. continuation.py says why.
 */
import { CONTINUATION } from "../contract/generated.ts";
import { dot, normalised, type Vector3 } from "../light/matrix.ts";
import { enlarged, powerOf, rowSolidAngles, shrunk, texelDirections } from "../light/panorama.ts";
import { type ProjectedPhoto, smoothstep } from "./image-plane.ts";

const { BEHIND, BLUR_OF_DOUBT, BLUR_RAD, DARKEST, DOUBT_RAD, DOUBTED, EVERY } = CONTINUATION;
const { FADE_RAD, LEAST_OF_WIDEST, LEAST_TURN_RAD, OUTER_RAD, SHOWN, SKY, STEEPEST } = CONTINUATION;
const SEEN_ROWS = 64;

/** How the camera was held. */
export interface Tilt {
  /** Of length 1, camera frame. */
  readonly up: Vector3;
  /** Two of three such pitches are less off; 0 where the tilt is known. */
  readonly scaleRad: number;
}

/**
 * The map brought to the photo's level rows all around, also where the photo looks; the power of the
 * rest is kept.
 *
 * @param map linear radiance, camera frame, of `rows`.
 */
export function continued(
  map: Float32Array,
  rows: number,
  shown: ProjectedPhoto,
  { up, scaleRad }: Tilt,
): Float32Array {
  if (Math.abs(up[2]) > STEEPEST) return map;
  const change = changeOf(rowsOfPhoto(shown, up, rows), rowsOfMap(map, rows, up));
  if (!change) return map;
  const trust = Math.exp(-((scaleRad / DOUBT_RAD) ** 2) / 2);
  const doubtful = blurred(change, BLUR_OF_DOUBT * scaleRad).map((value) => value * (1 - trust));
  const inFront = change.map((value, i) => (value * (1 + trust) + doubtful[i]!) / 2);
  const further = blurred(change, BLUR_RAD);
  const behind = further.map((value, i) => value * BEHIND * trust + doubtful[i]! * DOUBTED);
  const front = normalised([up[0] * up[2], up[1] * up[2], up[2] ** 2 - 1]);
  const result = map.slice();
  const directions = texelDirections(rows);
  for (let i = 0; i < map.length; i += 3) {
    const toFront = ((1 + along(directions, i, front)) / 2) ** 2;
    const [first, part] = rowAndPart(along(directions, i, up), rows);
    for (let c = 0; c < 3; c++) {
      const at = (of: Float32Array) =>
        of[3 * first + c]! * (1 - part) + of[3 * first + 3 + c]! * part;
      result[i + c]! *= Math.exp(at(inFront) * toFront + at(behind) * (1 - toFront));
    }
  }
  return hiddenKept(result, map, rows, shown);
}

/** A changed map times what keeps the power of what the photo does not show, channel by channel. */
export function hiddenKept(
  changed: Float32Array,
  map: Float32Array,
  rows: number,
  shown: ProjectedPhoto,
): Float32Array {
  const seen = enlarged(shrunk(shown.seen, shown.height, SEEN_ROWS, 1), SEEN_ROWS, rows, 1);
  const hidden = (whole: Float32Array) =>
    powerOf(
      whole.map((value, i) => value * (1 - seen[Math.floor(i / 3)]!)),
      rows,
    );
  const [was, is] = [hidden(map), hidden(changed)];
  return changed.map((value, i) => value * (was[i % 3]! / Math.max(is[i % 3]!, 1e-30)));
}

/** Rows of three channels blurred by a Gaussian of elevation; a width of 0 leaves them. */
function blurred(change: Float32Array, sigmaRad: number): Float32Array {
  if (sigmaRad <= 0) return change;
  const rows = change.length / 3;
  const weights = Array.from({ length: rows }, (_, k) => {
    return Math.exp(-(((k * Math.PI) / rows / sigmaRad) ** 2) / 2);
  });
  return change.map((_, i) => {
    let [sum, whole] = [0, 0];
    for (let row = 0; row < rows; row++) {
      const weight = weights[Math.abs(row - Math.floor(i / 3))]!;
      sum += weight * change[3 * row + (i % 3)]!;
      whole += weight;
    }
    return sum / whole;
  });
}

/** Means along the level rows of a panorama, the highest first. */
class LevelRows {
  /** How much of each row they are of, in rad. */
  readonly turn: Float64Array;
  private readonly sums: Float64Array;

  constructor(
    readonly rows: number,
    private readonly channels: number,
  ) {
    this.turn = new Float64Array(rows);
    this.sums = new Float64Array(rows * channels);
  }

  /** Adds a texel in a direction by its cosine from up. */
  add(upwards: number, solidAngle: number, values: readonly number[]): void {
    const [first, part] = rowAndPart(upwards, this.rows);
    const turn =
      (solidAngle * (this.rows / Math.PI)) / Math.sqrt(Math.max(1 - upwards ** 2, DARKEST));
    for (const k of [0, 1]) {
      const share = turn * (k ? part : 1 - part);
      this.turn[first + k]! += share;
      values.forEach((value, c) => {
        this.sums[(first + k) * this.channels + c]! += share * value;
      });
    }
  }

  mean(row: number, channel: number): number {
    return this.sums[row * this.channels + channel]! / Math.max(this.turn[row]!, 1e-9);
  }
}

/** What the photo shows of `rows` level rows: ln radiance, and the part that is clipped. */
function rowsOfPhoto(photo: ProjectedPhoto, up: Vector3, rows: number): LevelRows {
  const result = new LevelRows(rows, 6);
  const directions = texelDirections(photo.height);
  const solidAngle = rowSolidAngles(photo.height);
  photo.seen.forEach((seen, i) => {
    if (seen <= SHOWN) return;
    const row = Math.floor(i / (2 * photo.height));
    const clipped = photo.clipped.subarray(3 * i, 3 * i + 3);
    const values = [...logsAt(photo.radiance, 3 * i), ...clipped];
    result.add(along(directions, 3 * i, up), solidAngle[row]!, values);
  });
  return result;
}

/** The same of a smooth panorama, ln radiance only, at fewer rows. */
function rowsOfMap(map: Float32Array, rows: number, up: Vector3): LevelRows {
  const result = new LevelRows(Math.floor(rows / EVERY), 3);
  const directions = texelDirections(rows);
  const solidAngle = rowSolidAngles(rows);
  for (let row = 0; row < rows; row += EVERY) {
    for (let column = 0; column < 2 * rows; column += EVERY) {
      const i = 3 * (row * 2 * rows + column);
      result.add(along(directions, i, up), solidAngle[row]!, logsAt(map, i));
    }
  }
  return result;
}

/**
 * What brings the map's rows to the photo's, as ln, and goes on beyond them. Null where the photo is
 * too small to go on.
 */
function changeOf(shown: LevelRows, estimated: LevelRows): Float32Array | null {
  const { rows } = shown;
  const texel = Math.PI / rows;
  const wanted = LEAST_OF_WIDEST * Math.max(...shown.turn);
  const least = Math.min(Math.max(wanted, LEAST_TURN_RAD[0]), LEAST_TURN_RAD[1]);
  const known: number[] = [];
  shown.turn.forEach((turn, row) => {
    if (turn >= least) known.push(row);
  });
  const [highest, lowest] = [known[0], known.at(-1)];
  if (highest === undefined || lowest === undefined) return null;
  const result = new Float32Array(3 * rows);
  for (let row = 0, next = 0; row < rows; row++) {
    while (known[next]! < Math.min(row, lowest)) next++;
    const nearest = known[next]!;
    const aboveHorizon = Math.PI / 2 - (nearest + 0.5) * texel;
    const isSky = row < highest && aboveHorizon > 0;
    const isGround = row > lowest && aboveHorizon < 0;
    const outer = smoothstep(
      (Math.abs(aboveHorizon) - OUTER_RAD[0]) / (OUTER_RAD[1] - OUTER_RAD[0]),
    );
    const fade = smoothstep(1 - (Math.abs(row - nearest) * texel) / FADE_RAD);
    const weight = Math.max(fade, isGround ? outer : isSky ? SKY * outer : 0);
    const at = Math.min(Math.max((row + 0.5) / EVERY - 0.5, 0), estimated.rows - 1);
    const above = Math.min(Math.floor(at), estimated.rows - 2);
    for (let c = 0; c < 3; c++) {
      const was =
        estimated.mean(above, c) * (1 - at + above) + estimated.mean(above + 1, c) * (at - above);
      const change = shown.mean(nearest, c) - was;
      // Where the photo is clipped it only says "at least".
      result[3 * row + c] = weight * change * (change < 0 ? 1 - shown.mean(nearest, 3 + c) : 1);
    }
  }
  return result;
}

/** The level row at or above a direction, by its cosine from up, and the next one's part. */
function rowAndPart(upwards: number, rows: number): [number, number] {
  const angle = Math.acos(Math.min(Math.max(upwards, -1), 1));
  const at = Math.min(Math.max(angle * (rows / Math.PI) - 0.5, 0), rows - 1);
  const first = Math.min(Math.floor(at), rows - 2);
  return [first, at - first];
}

function along(directions: Float32Array, i: number, axis: Vector3): number {
  return dot([directions[i]!, directions[i + 1]!, directions[i + 2]!], axis);
}

function logsAt(radiance: Float32Array, i: number): [number, number, number] {
  const ln = (c: number) => Math.log(Math.max(radiance[i + c]!, DARKEST));
  return [ln(0), ln(1), ln(2)];
}

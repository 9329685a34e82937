/**
 * How a camera turned, from its pictures alone: for where no sensors say it.
 *
 * Each picture is laid over the nearest of a few key pictures, coarse to fine: first the shift that
 * fits best, then the rotation that leaves the least (Gauss-Newton; Lucas and Kanade 1981). A key
 * picture stays where it is, so errors do not add up from frame to frame.
 */
import { angleBetween, IDENTITY, type Matrix3x3, product, transposed } from "../light/matrix.ts";
import { remembered } from "../light/remembered.ts";
import { solved } from "./solve.ts";
import { type SmallPicture, tangents, type View } from "./view.ts";

/** Rows of the finest and of the coarsest grey picture. */
const FINEST_ROWS = 96;
const COARSEST_ROWS = 24;
const STEPS = 8;
/** So far from its key picture a picture becomes one itself. */
const KEY_RAD = 0.22;
const MOST_KEYS = 96;
/** Likeness (correlation, at most 1) below which pictures show different things. */
const ALIKE = 0.72;
/** Part of a picture that must show what the key picture shows. */
const LEAST_SHARED = 0.3;
/** Half the width of what is searched for the first shift, shares of the picture. */
const SEARCH = 0.4;
const OUTLIER = 0.5; // of a standard deviation

interface Grey {
  readonly width: number;
  readonly height: number;
  readonly values: Float32Array;
}

/** Grey pictures from the finest to the coarsest, and what a pixel is on the plane at distance 1. */
interface Pyramid {
  readonly levels: readonly Grey[];
  readonly halfWidth: number;
  readonly halfHeight: number;
}

interface Key {
  readonly pyramid: Pyramid;
  readonly worldFromCamera: Matrix3x3;
}

export class VisualRotation {
  #keys: Key[] = [];
  #latest: Matrix3x3 = IDENTITY;
  /** Where the next picture looks is not known: any key picture may show it. */
  #isAstray = false;

  /**
   * How the camera was held for the next picture; null where it shows nothing known.
   *
   * @param start how it was held for the first one.
   */
  next(picture: SmallPicture, start: Matrix3x3 = IDENTITY): Matrix3x3 | null {
    const pyramid = pyramidOf(picture);
    if (this.#keys.length === 0) {
      this.#keys = [{ pyramid, worldFromCamera: start }];
      this.#latest = start;
      return start;
    }
    if (this.#isAstray) return this.#findAnywhere(pyramid);
    const nearest = this.#keys.reduce((a, b) =>
      angleBetween(b.worldFromCamera, this.#latest) < angleBetween(a.worldFromCamera, this.#latest)
        ? b
        : a,
    );
    const guess = product(transposed(this.#latest), nearest.worldFromCamera);
    const found = turnBetween(nearest.pyramid, pyramid, guess);
    if (!found) return null;
    this.#latest = squared(product(nearest.worldFromCamera, transposed(found)));
    if (angleBetween(nearest.worldFromCamera, this.#latest) > KEY_RAD) {
      this.#keys.push({ pyramid, worldFromCamera: this.#latest });
      if (this.#keys.length > MOST_KEYS) this.#keys.splice(1, 1);
    }
    return this.#latest;
  }

  /** Goes on among pictures whose rotations are known; the next one may look anywhere. */
  goOn(views: readonly View[]): void {
    this.#keys = views.map((view) => {
      return { pyramid: pyramidOf(view), worldFromCamera: view.worldFromCamera };
    });
    this.#isAstray = true;
  }

  /** How the camera was held for a picture that does not go on from the one before; null if for none known. */
  findAgain(picture: SmallPicture): Matrix3x3 | null {
    return this.#findAnywhere(pyramidOf(picture));
  }

  /** Begins anew with the next picture. */
  reset(): void {
    this.#keys = [];
    this.#isAstray = false;
  }

  /** By the key picture that it fits best: alike ones are all over a place. */
  #findAnywhere(pyramid: Pyramid): Matrix3x3 | null {
    let [best, most]: [Matrix3x3 | null, number] = [null, 0];
    for (const key of this.#keys) {
      const found = turnBetween(key.pyramid, pyramid, IDENTITY);
      const { likeness } = found ? laidOver(key.pyramid, pyramid, 0, found) : { likeness: 0 };
      if (!found || likeness <= most) continue;
      [best, most] = [squared(product(key.worldFromCamera, transposed(found))), likeness];
    }
    if (best) [this.#latest, this.#isAstray] = [best, false];
    return best;
  }
}

function pyramidOf(picture: SmallPicture): Pyramid {
  let level = greyOf(picture);
  while (level.height > 1.5 * FINEST_ROWS) level = halved(level);
  const levels = [level];
  while (level.height > 1.5 * COARSEST_ROWS) {
    level = halved(level);
    levels.push(level);
  }
  const [halfWidth, halfHeight] = tangents(picture);
  return { levels, halfWidth, halfHeight };
}

function greyOf({ pixels, width, height }: SmallPicture): Grey {
  const values = new Float32Array(width * height);
  for (let i = 0; i < values.length; i++) {
    values[i] = (pixels[3 * i]! + 2 * pixels[3 * i + 1]! + pixels[3 * i + 2]!) / 1020;
  }
  return { width, height, values };
}

function halved({ width, height, values }: Grey): Grey {
  const [columns, rows] = [width >> 1, height >> 1];
  const result = new Float32Array(columns * rows);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      const from = 2 * row * width + 2 * column;
      result[row * columns + column] =
        (values[from]! + values[from + 1]! + values[from + width]! + values[from + width + 1]!) / 4;
    }
  }
  return { width: columns, height: rows, values: result };
}

/** The rotation from a key picture's camera to another's; null where they do not fit. */
function turnBetween(key: Pyramid, other: Pyramid, guess: Matrix3x3): Matrix3x3 | null {
  let turn = bestShift(key, other, guess);
  for (let level = key.levels.length - 1; level >= 0; level--) {
    for (let step = 0; step < STEPS; step++) {
      const change = improvement(key, other, level, turn);
      if (!change) return null;
      turn = product(rotationOf(change), turn);
      if (Math.hypot(...change) < 1e-4) break;
    }
  }
  const { likeness, shared } = laidOver(key, other, 0, turn);
  return likeness > ALIKE && shared > LEAST_SHARED ? turn : null;
}

/** Of all small yaws and pitches around a guess the one with which the coarsest pictures fit best. */
function bestShift(key: Pyramid, other: Pyramid, guess: Matrix3x3): Matrix3x3 {
  const level = key.levels.length - 1;
  const { width, height } = key.levels[level]!;
  const [alongX, alongY] = [(2 * key.halfWidth) / width, (2 * key.halfHeight) / height];
  let [best, most] = [guess, laidOver(key, other, level, guess).likeness];
  // Where the guess fits, as from one frame of a film to the next, nothing is searched for.
  if (most > 0.9) return best;
  const [columns, rows] = [Math.round(SEARCH * width), Math.round(SEARCH * height)];
  for (let y = -rows; y <= rows; y++) {
    for (let x = -columns; x <= columns; x++) {
      const turn = product(rotationOf([y * alongY, x * alongX, 0]), guess);
      const { likeness, shared } = laidOver(key, other, level, turn);
      if (shared > LEAST_SHARED && likeness > most) [best, most] = [turn, likeness];
    }
  }
  return best;
}

interface Laid {
  /** Correlation of what both show. */
  readonly likeness: number;
  /** Part of the key picture that the other one shows. */
  readonly shared: number;
  readonly means: readonly [number, number];
  readonly deviations: readonly [number, number];
}

function laidOver(key: Pyramid, other: Pyramid, level: number, turn: Matrix3x3): Laid {
  return likenessOf(key.levels[level]!, sharedBy(key, other, level, turn));
}

function likenessOf({ values }: Grey, { count, pixel, value }: Shared): Laid {
  let [a, b, aa, bb, ab] = [0, 0, 0, 0, 0];
  for (let i = 0; i < count; i++) {
    const [own, theirs] = [values[pixel[i]!]!, value[i]!];
    a += own;
    b += theirs;
    aa += own * own;
    bb += theirs * theirs;
    ab += own * theirs;
  }
  const means = [a / count, b / count] as const;
  const deviations = [
    Math.sqrt(Math.max(aa / count - means[0] ** 2, 1e-9)),
    Math.sqrt(Math.max(bb / count - means[1] ** 2, 1e-9)),
  ] as const;
  const likeness = (ab / count - means[0] * means[1]) / (deviations[0] * deviations[1]);
  return { likeness, shared: count / values.length, means, deviations };
}

/** The small rotation (x, y, z) after which the pictures fit better; null where too little is shared. */
function improvement(
  key: Pyramid,
  other: Pyramid,
  level: number,
  turn: Matrix3x3,
): [number, number, number] | null {
  const both = sharedBy(key, other, level, turn);
  const { shared, means, deviations } = likenessOf(key.levels[level]!, both);
  if (shared < LEAST_SHARED) return null;
  const { values } = key.levels[level]!;
  const matrix = new Float64Array(9);
  const right = new Float64Array(3);
  const slope = new Float64Array(3);
  for (let k = 0; k < both.count; k++) {
    const [x, y, alongX, alongY] = [both.x[k]!, both.y[k]!, both.alongX[k]!, both.alongY[k]!];
    const own = values[both.pixel[k]!]!;
    const rest = (both.value[k]! - means[1]) / deviations[1] - (own - means[0]) / deviations[0];
    // The direction (x, y, -1) turned by w moves by w x d; on the plane:
    slope[0] = (x * y * alongX + (1 + y * y) * alongY) / deviations[1];
    slope[1] = (-(1 + x * x) * alongX - x * y * alongY) / deviations[1];
    slope[2] = (-y * alongX + x * alongY) / deviations[1];
    const weight = 1 / (1 + (rest / OUTLIER) ** 2);
    for (let i = 0; i < 3; i++) {
      right[i]! -= weight * slope[i]! * rest;
      for (let j = 0; j < 3; j++) matrix[3 * i + j]! += weight * slope[i]! * slope[j]!;
    }
  }
  for (let i = 0; i < 3; i++) matrix[4 * i]! = matrix[4 * i]! * 1.001 + 1e-6;
  const [x, y, z] = solved(matrix, right);
  const size = Math.hypot(x!, y!, z!);
  const most = 0.1 / Math.max(size, 0.1); // a step beyond the slopes' reach is no better
  return [x! * most, y! * most, z! * most];
}

/** The key pixels that the other picture shows: its value there, place and slopes; `count` of each. */
interface Shared {
  count: number;
  readonly pixel: Int32Array;
  readonly value: Float64Array;
  readonly x: Float64Array;
  readonly y: Float64Array;
  readonly alongX: Float64Array;
  readonly alongY: Float64Array;
}

/** Room for a size of picture, used again and again: a film compares dozens of times for each frame. */
const roomFor = remembered((pixels: number): Shared => {
  const [value, x, y, alongX, alongY] = [1, 2, 3, 4, 5].map(() => new Float64Array(pixels));
  const places = { x: x!, y: y!, alongX: alongX!, alongY: alongY! };
  return { count: 0, pixel: new Int32Array(pixels), value: value!, ...places };
});

/** What two pictures share; what an earlier call gave is written over. */
function sharedBy(key: Pyramid, other: Pyramid, level: number, m: Matrix3x3): Shared {
  const { width, height } = key.levels[level]!;
  const { halfWidth, halfHeight } = other;
  const { width: columns, height: rows, values } = other.levels[level]!;
  const shared = roomFor(width * height);
  let count = 0;
  for (let row = 0, pixel = 0; row < height; row++) {
    const up = (1 - (row + 0.5) * (2 / height)) * key.halfHeight;
    for (let column = 0; column < width; column++, pixel++) {
      const across = ((column + 0.5) * (2 / width) - 1) * key.halfWidth;
      const depth = -(m[6] * across + m[7] * up - m[8]);
      if (depth <= 0) continue;
      const x = (m[0] * across + m[1] * up - m[2]) / depth;
      const y = (m[3] * across + m[4] * up - m[5]) / depth;
      const c = (x / halfWidth + 1) * (columns / 2) - 0.5;
      const r = (1 - y / halfHeight) * (rows / 2) - 0.5;
      if (!(c >= 0 && r >= 0 && c < columns - 1 && r < rows - 1)) continue;
      const [left, top] = [Math.floor(c), Math.floor(r)];
      const [right, down] = [c - left, r - top];
      const at = top * columns + left;
      const [p, q] = [values[at]!, values[at + 1]!];
      const [s, t] = [values[at + columns]!, values[at + columns + 1]!];
      shared.pixel[count] = pixel;
      shared.value[count] =
        (p * (1 - right) + q * right) * (1 - down) + (s * (1 - right) + t * right) * down;
      shared.x[count] = x;
      shared.y[count] = y;
      shared.alongX[count] = ((q - p) * (1 - down) + (t - s) * down) * (columns / 2 / halfWidth);
      shared.alongY[count] = -((s - p) * (1 - right) + (t - q) * right) * (rows / 2 / halfHeight);
      count++;
    }
  }
  shared.count = count;
  return shared;
}

/** The same rotation with rows of length 1 at right angles: rounding would grow from frame to frame. */
function squared([a, b, c, d, e, f]: Matrix3x3): Matrix3x3 {
  const length = Math.hypot(a, b, c);
  const [x, y, z] = [a / length, b / length, c / length];
  const along = x * d + y * e + z * f;
  const [p, q, r] = [d - along * x, e - along * y, f - along * z];
  const other = Math.hypot(p, q, r);
  const [u, v, w] = [p / other, q / other, r / other];
  return [x, y, z, u, v, w, y * w - z * v, z * u - x * w, x * v - y * u];
}

/** The rotation about an axis by its length (Rodrigues). */
export function rotationOf([x, y, z]: readonly [number, number, number]): Matrix3x3 {
  const angle = Math.hypot(x, y, z);
  if (angle < 1e-12) return IDENTITY;
  const [a, b, c] = [x / angle, y / angle, z / angle];
  const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
  const k = 1 - cos;
  return [
    cos + a * a * k,
    a * b * k - c * sin,
    a * c * k + b * sin,
    b * a * k + c * sin,
    cos + b * b * k,
    b * c * k - a * sin,
    c * a * k - b * sin,
    c * b * k + a * sin,
    cos + c * c * k,
  ];
}

/**
 * Seen pixels and the network's estimates of all views as one light, its power right: merge.py,
 * which says why it is merged so.
 */
import { FUSE } from "../contract/generated.ts";
import type { Environment } from "../light/environment.ts";
import { luminous } from "../light/lamp.ts";
import { luminance } from "../light/main-light.ts";
import { IDENTITY, type Matrix3x3, type Vector3 } from "../light/matrix.ts";
import { onBall } from "../light/mirror-ball.ts";
import {
  enlarged,
  powerOf,
  rowSolidAngles,
  shrunk,
  texelDirections,
  texelOf,
} from "../light/panorama.ts";
import { remembered } from "../light/remembered.ts";
import { blended, type Seen } from "./blend.ts";
import { rememberedOf } from "./remembered-of.ts";
import type { Steadily } from "./steady.ts";
import type { Cells, View } from "./view.ts";
import { logPower } from "./view.ts";

const { CLIPPED_HIGH_LOG, CLIPPED_LOG, CLIPPED_SCALE, DIM, ESTIMATE_ROWS } = FUSE;
const { FIND_KAPPA, FIND_ROWS, HIGH_FROM, HIGH_TO, HORIZON } = FUSE;
const { LEVEL, LOBE_KAPPA, LOG_STEP, LOG_STEPS, NEAR, POWER_SIGMA, STILL_HIDDEN } = FUSE;

/** Views in one world with what was made of them. */
export interface Gathered {
  readonly views: readonly View[];
  readonly cells: readonly Cells[];
  /** ln gain of each, relative to the unit wanted. */
  readonly logGain: Float64Array;
  readonly trust: readonly Float32Array[];
}

/**
 * One light out of all views, in the frame of a camera held like `worldFromFrame`.
 *
 * @param steadily how to change what is only believed, to be shown while one turns; left out, not.
 */
export function environmentOf(
  from: Gathered,
  worldFromFrame: Matrix3x3,
  height: number,
  steadily: Steadily | null = null,
): Environment {
  const { views, cells, logGain, trust } = from;
  const directions = directionsOf(height, worldFromFrame);
  const seen = blended(views, cells, logGain, trust, directions);
  const rows = Math.min(ESTIMATE_ROWS, height);
  const coarse = directionsOf(rows, worldFromFrame);
  const small = merged(views, logGain, coarse);
  const [logs, mean] = [small.logs, small.mean].map((part) => enlarged(part, rows, height));
  const radiance = logs!.map((value, i) => {
    const known = seen.share[Math.floor(i / 3)]!;
    return known * seen.radiance[i]! + (1 - known) * value;
  });
  const rises = rising(directions, upOf(views));
  const hidden = seen.share.map((own, i) => (1 - own) * above(rises[i]!));
  addLostLobe(radiance, logs!, mean!, hidden, height, steadily);
  if (seen.clipped.some((channels) => channels > 0)) {
    raiseLamps(radiance, mean!, seen, expectedPower(views, logGain), rises, height);
  }
  if (steadily) shadeBelieved(radiance, seen, height, steadily);
  return { radiance, seen: seen.share, height };
}

/** All estimates along directions (world): e^(mean of logarithms), and mean of radiance. */
export function merged(views: readonly View[], logGain: Float64Array, directions: Float32Array) {
  const count = directions.length / 3;
  const [logs, mean] = [new Float32Array(3 * count), new Float32Array(3 * count)];
  const weight = new Float32Array(count);
  views.forEach((view, k) => {
    const { near, log, linear } = spokenOf(view, directions);
    const gain = logGain.subarray(3 * k, 3 * k + 3);
    const scale = gain.map((value) => Math.exp(-value));
    for (let i = 0, at = 0; i < count; i++) {
      weight[i]! += near[i]!;
      for (let c = 0; c < 3; c++, at++) {
        logs[at]! += near[i]! * (log[at]! - gain[c]!);
        mean[at]! += linear[at]! * scale[c]!;
      }
    }
  });
  for (let i = 0; i < logs.length; i++) {
    logs[i] = Math.exp(logs[i]! / weight[Math.floor(i / 3)]!);
    mean[i]! /= views.length;
  }
  return { logs, mean };
}

/** What a view's estimate says along directions, and how much that counts there. */
interface Spoken {
  readonly near: Float32Array;
  /** RGB: ln radiance, and radiance. */
  readonly log: Float32Array;
  readonly linear: Float32Array;
}

const spokenOf = rememberedOf((view, directions): Spoken => {
  const { logEstimate, worldFromCamera: m } = view;
  const count = directions.length / 3;
  const near = new Float32Array(count);
  const [log, linear] = [new Float32Array(3 * count), new Float32Array(3 * count)];
  const value: [number, number, number] = [0, 0, 0];
  for (let i = 0; i < count; i++) {
    const x = directions[3 * i]!;
    const y = directions[3 * i + 1]!;
    const z = directions[3 * i + 2]!;
    const back = m[2] * x + m[5] * y + m[8] * z;
    const [right, up] = [m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z];
    onBall(logEstimate, [right, up, back], value);
    near[i] = Math.exp(NEAR * (-back - 1));
    for (const c of [0, 1, 2] as const) {
      log[3 * i + c] = value[c];
      linear[3 * i + c] = Math.exp(value[c]);
    }
  }
  return { near, log, linear };
});

/** Mean over all directions. */
function shareOf(part: Float32Array, height: number): number {
  const sr = rowSolidAngles(height);
  const sum = part.reduce((all, value, i) => all + value * sr[Math.floor(i / (2 * height))]!, 0);
  return sum / (4 * Math.PI);
}

/** Makes what is unseen or clips brighter or darker; seen pixels stay themselves. */
function shadeBelieved(
  radiance: Float32Array,
  seen: Seen,
  height: number,
  steadily: Steadily,
): void {
  const known = seen.radiance.map((value, i) => {
    const texel = Math.floor(i / 3);
    return seen.clipped[texel] ? 0 : seen.share[texel]! * value;
  });
  const believed = radiance.map((value, i) => value - known[i]!);
  const powers = [known, believed].map((part) => powerOf(part, height)) as [Vector3, Vector3];
  const factor = steadily.shade(...powers, shareOf(seen.share, height));
  for (let i = 0; i < radiance.length; i++) radiance[i] = known[i]! + factor * believed[i]!;
}

/** How far a direction that rises by a sine is above the horizon: no lamp is looked for below. */
function above(sine: number): number {
  return Math.min(Math.max(sine / HORIZON + 0.5, 0), 1);
}

/** The power that the logarithms' map lacks where it is `hidden`, unseen and above, as one lobe there. */
function addLostLobe(
  radiance: Float32Array,
  logs: Float32Array,
  mean: Float32Array,
  hidden: Float32Array,
  height: number,
  steadily: Steadily | null,
): void {
  const sr = rowSolidAngles(height);
  const lost: [number, number, number] = [0, 0, 0];
  const weighted = logs.map((value, i) => {
    const texel = Math.floor(i / 3);
    const weight = hidden[texel]! * sr[Math.floor(texel / (2 * height))]!;
    lost[(i % 3) as 0 | 1 | 2] += weight * Math.max(mean[i]! - value, 0);
    return value * weight;
  });
  if (!(luminous(lost) > 0)) return;
  const [x, y, z] = brightest(weighted, hidden, height, steadily);
  const directions = texelDirections(height);
  let power = 0;
  const lobe = hidden.map((own, i) => {
    const cosine = x * directions[3 * i]! + y * directions[3 * i + 1]! + z * directions[3 * i + 2]!;
    const value = Math.exp(LOBE_KAPPA * (cosine - 1)) * own;
    power += value * sr[Math.floor(i / (2 * height))]!;
    return value;
  });
  if (power <= 0) return;
  for (let i = 0; i < radiance.length; i++) {
    radiance[i]! += (lobe[Math.floor(i / 3)]! * lost[i % 3]!) / power;
  }
}

/** The direction round which most of the power lies, or where the lamp was, if not much less. */
function brightest(
  power: Float32Array,
  hidden: Float32Array,
  height: number,
  steadily: Steadily | null,
): Vector3 {
  const rows = Math.min(FIND_ROWS, height);
  const coarse = shrunk(power, height, rows);
  const around = surroundings(
    Float32Array.from({ length: 2 * rows * rows }, (_, i) => luminance(coarse, i)),
    rows,
  );
  let best = 0;
  for (let i = 1; i < around.length; i++) if (around[i]! > around[best]!) best = i;
  const [x, y, z] = texelDirections(rows).subarray(3 * best, 3 * best + 3);
  if (!steadily) return [x!, y!, z!];
  const open = shrunk(hidden, height, rows, 1);
  return steadily.place([x!, y!, z!], (direction) => {
    const texel = texelOf(...direction, rows);
    return open[texel]! > STILL_HIDDEN ? around[texel]! : 0;
  });
}

/** What lies round each texel, the nearer the more. */
function surroundings(bright: Float32Array, rows: number): Float32Array {
  const columns = 2 * rows;
  const near = nearness(rows);
  const sums = new Float32Array(bright.length);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      let sum = 0;
      for (let other = 0, i = 0; other < rows; other++) {
        const line = (2 * (row * rows + other) + 1) * columns - column;
        for (let k = 0; k < columns; k++, i++) sum += near[line + k]! * bright[i]!;
      }
      sums[row * columns + column] = sum;
    }
  }
  return sums;
}

/** e^(kappa (cos - 1)) between texels of two rows a number of columns apart, twice around. */
const nearness = remembered((rows: number): Float32Array => {
  const columns = 2 * rows;
  const directions = texelDirections(rows);
  const at = (row: number, column: number) => 3 * (row * columns + column);
  return Float32Array.from({ length: 2 * rows * rows * columns }, (_, i) => {
    const pair = Math.floor(i / columns / 2);
    const [a, b] = [Math.floor(pair / rows), pair % rows];
    const [one, other] = [at(a, 0), at(b, i % columns)];
    let cosine = 0;
    for (let c = 0; c < 3; c++) cosine += directions[one + c]! * directions[other + c]!;
    return Math.exp(FIND_KAPPA * (cosine - 1));
  });
});

/** Where up is in the world: people hold phones straight. */
function upOf(views: readonly View[]): Vector3 {
  const up = [1, 4, 7].map((k) =>
    views.reduce((sum, { worldFromCamera }) => sum + worldFromCamera[k as 1 | 4 | 7], 0),
  );
  const length = Math.max(Math.hypot(...up), 1e-9 * views.length);
  return [up[0]! / length, up[1]! / length, up[2]! / length];
}

/** Sine of the elevation of directions (world). */
function rising(directions: Float32Array, up: Vector3): Float32Array {
  const result = new Float32Array(directions.length / 3);
  for (let i = 0, from = 0; i < result.length; i++, from += 3) {
    result[i] =
      directions[from]! * up[0] + directions[from + 1]! * up[1] + directions[from + 2]! * up[2];
  }
  return result;
}

/** Radiance summed over all directions that the estimates speak for, RGB. */
export function expectedPower(views: readonly View[], logGain: Float64Array): Vector3 {
  const up = upOf(views);
  const weights = views.map(({ worldFromCamera: m }) => {
    const rise = -(m[2] * up[0] + m[5] * up[1] + m[8] * up[2]);
    return Math.exp(-((rise / LEVEL) ** 2));
  });
  const whole = weights.reduce((a, b) => a + b, 0);
  const powers = views.map(({ logEstimate }) => logPower(logEstimate));
  return [0, 1, 2].map((c) => {
    const root = weights.reduce((sum, weight, k) => {
      return sum + (weight / whole) * Math.exp((powers[k]![c]! - logGain[3 * k + c]!) / 2);
    }, 0);
    return 4 * Math.PI * DIM * root ** 2;
  }) as unknown as Vector3;
}

/** Gives clipped pixels the power that is likely for them. */
function raiseLamps(
  radiance: Float32Array,
  mean: Float32Array,
  { clipped }: Seen,
  whole: Vector3,
  rises: Float32Array,
  height: number,
): void {
  const sr = rowSolidAngles(height);
  const colour: [number, number, number] = [0, 0, 0];
  let [least, shares, usual] = [0, 0, 0];
  const share = new Float64Array(clipped.length);
  clipped.forEach((channels, i) => {
    if (!channels) return;
    const weight = sr[Math.floor(i / (2 * height))]!;
    const own = luminance(radiance, i);
    least += own * weight;
    usual += own * weight * usualFactor(rises[i]!);
    share[i] = (channels / 3) ** 3 * own * luminance(mean, i) ** 2;
    shares += share[i]! * weight;
    for (let c = 0; c < 3; c++) colour[c as 0 | 1 | 2] += mean[3 * i + c]! * share[i]! * weight;
  });
  const rest = luminous(powerOf(radiance, height)) - least;
  const factor = likelyFactor(least, rest, luminous(whole), usual / least);
  const more = (least * (factor - 1)) / luminous(colour);
  for (let i = 0; i < radiance.length; i++) {
    const own = share[Math.floor(i / 3)]!;
    if (own) radiance[i]! += (own / shares) * colour[(i % 3) as 0 | 1 | 2] * more;
  }
}

/** By how much what clips at an elevation (its sine) is usually brighter than white. */
function usualFactor(sine: number): number {
  const high = Math.min(Math.max((sine - HIGH_FROM) / (HIGH_TO - HIGH_FROM), 0), 1);
  return Math.exp(CLIPPED_LOG + (CLIPPED_HIGH_LOG - CLIPPED_LOG) * high);
}

/** By how much clipped pixels are likely to be brighter than white, all in all. */
export function likelyFactor(bound: number, rest: number, whole: number, usual: number): number {
  let [best, least] = [0, Number.POSITIVE_INFINITY];
  for (let k = 0; k <= LOG_STEPS; k++) {
    const log = k * LOG_STEP;
    const off = Math.log(whole / (rest + bound * Math.exp(log))) / POWER_SIGMA;
    const unusual = 2 * Math.log(1 + ((log - Math.log(usual)) / CLIPPED_SCALE) ** 2);
    const cost = off ** 2 + unusual;
    if (cost < least) [best, least] = [log, cost];
  }
  return Math.exp(best);
}

/** The directions of a panorama's texels, world; of one that is not turned always the same object. */
function directionsOf(height: number, worldFromFrame: Matrix3x3): Float32Array {
  const straight = texelDirections(height);
  const isTurned = worldFromFrame.some((value, i) => value !== IDENTITY[i]);
  return isTurned ? turnedAll(straight, worldFromFrame) : straight;
}

function turnedAll(directions: Float32Array, m: Matrix3x3): Float32Array {
  const result = new Float32Array(directions.length);
  for (let i = 0; i < directions.length; i += 3) {
    const [x, y, z] = [directions[i]!, directions[i + 1]!, directions[i + 2]!];
    result[i] = m[0] * x + m[1] * y + m[2] * z;
    result[i + 1] = m[3] * x + m[4] * y + m[5] * z;
    result[i + 2] = m[6] * x + m[7] * y + m[8] * z;
  }
  return result;
}

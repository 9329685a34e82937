/**
 * Exposure and white balance of all views at once, from the sky that they share; gains.py says why.
 * EXIF exposures, which a film in a browser does not have, are left out.
 */
import { FUSE } from "../contract/generated.ts";
import { solved } from "./solve.ts";
import type { Cells } from "./view.ts";

const { CELLS, INDEPENDENT_SR, OUTLIER, OVERLAP_SIGMA, SAME_SIGMA, SCALES, TIE_SIGMA } = FUSE;

/** What one view and another say about the sky that they share. */
export interface Overlap {
  /** ln by which the other is brighter, RGB. */
  readonly difference: readonly number[];
  /** How sure that is: shared solid angle less outliers, sr. */
  readonly weight: readonly number[];
  /** Shared solid angle with its outliers, summed over the channels, sr. */
  readonly shared: number;
  /** Mean of |rest| beyond that difference, ln: of the same sky about 0.1. */
  readonly disagreement: number;
}

/** Where each cell stands in a view's list; to be made once for several comparisons. */
export function placesOf({ cell }: Cells): Int32Array {
  const place = new Int32Array(CELLS).fill(-1);
  cell.forEach((own, i) => {
    place[own] = i;
  });
  return place;
}

/** Compare a view with another, cell by cell, robustly. */
export function overlapOf(own: Cells, ownPlaces: Int32Array, other: Cells): Overlap {
  const [difference, weight] = [
    [0, 0, 0],
    [0, 0, 0],
  ];
  let [rest, whole] = [0, 0];
  const shared = new Float32Array(other.cell.length);
  const beyond = new Float32Array(other.cell.length);
  for (let c = 0; c < 3; c++) {
    let count = 0;
    for (let i = 0; i < other.cell.length; i++) {
      const place = ownPlaces[other.cell[i]!]!;
      if (place < 0) continue;
      const share = Math.min(other.weight[3 * i + c]!, own.weight[3 * place + c]!);
      if (share === 0) continue;
      shared[count] = share;
      beyond[count++] = other.log[3 * i + c]! - own.log[3 * place + c]!;
    }
    const found = centre(shared.subarray(0, count), beyond.subarray(0, count));
    difference[c] = found.centre;
    weight[c] = found.weight;
    rest += found.rest;
    whole += Math.max(found.whole, 1e-12);
  }
  return { difference, weight, shared: whole, disagreement: rest / whole };
}

/** The value round which most lie, and how much does. */
function centre(shared: Float32Array, beyond: Float32Array) {
  const whole = shared.reduce((sum, share) => sum + share, 0);
  let middle =
    shared.reduce((sum, share, i) => sum + share * beyond[i]!, 0) / Math.max(whole, 1e-12);
  let weight = whole;
  for (const scale of SCALES) {
    let sum = 0;
    weight = 0;
    for (let i = 0; i < shared.length; i++) {
      const sure = shared[i]! / (1 + ((beyond[i]! - middle) / scale) ** 2);
      weight += sure;
      sum += sure * beyond[i]!;
    }
    middle = sum / Math.max(weight, 1e-12);
  }
  const rest = shared.reduce((sum, share, i) => sum + share * Math.abs(beyond[i]! - middle), 0);
  return { centre: middle, weight, rest, whole };
}

/** RGB of every pair of views, row by row: [i, j] of n views at 3 (i n + j). */
export type Pairs = Float64Array;

/**
 * ln gain of each view, RGB; the first has 0.
 *
 * @param differences g_j - g_i at [i, j], as the overlaps say.
 * @param weights their solid angles; 0 where i and j share nothing. Symmetric.
 * @param logPower ln of the whole light that the network gives for each view: ties those that share no sky.
 */
export function solveGains(
  views: number,
  differences: Pairs,
  weights: Pairs,
  logPower: readonly (readonly number[])[],
): Float64Array {
  const sure = 1 / (INDEPENDENT_SR * OVERLAP_SIGMA ** 2);
  const [tie, same] = [1 / TIE_SIGMA ** 2, 1 / SAME_SIGMA ** 2];
  const gains = new Float64Array(3 * views);
  for (let c = 0; c < 3; c++) {
    const matrix = new Float64Array(views * views);
    const right = new Float64Array(views);
    const mean = logPower.reduce((sum, power) => sum + power[c]!, 0) / views;
    for (let i = 0; i < views; i++) {
      let own = 0;
      for (let j = 0; j < views; j++) {
        const w = sure * weights[3 * (i * views + j) + c]!;
        own += w;
        matrix[i * views + j] = -w - tie / views;
        right[i]! +=
          sure * weights[3 * (j * views + i) + c]! * differences[3 * (j * views + i) + c]!;
      }
      matrix[i * views + i]! += own + tie + same;
      right[i]! += tie * (logPower[i]![c]! - mean);
    }
    const gain = solved(matrix, right);
    for (let i = 0; i < views; i++) gains[3 * i + c] = gain[i]! - gain[0]!;
  }
  return gains;
}

/** How far each view agrees with the others in each of its cells, 0 to 1; 1 where it is alone. */
export function trusted(views: readonly Cells[], logGain: Float64Array): Float32Array[] {
  const trust = views.map(({ cell }) => new Float32Array(cell.length).fill(1));
  for (let pass = 0; pass < 3; pass++) {
    const mean = meanSky(views, logGain, trust);
    views.forEach(({ cell, log, weight }, k) => {
      for (let i = 0; i < cell.length; i++) {
        let [off, whole] = [0, 0];
        for (let c = 0; c < 3; c++) {
          const sr = weight[3 * i + c]!;
          const aligned = log[3 * i + c]! - logGain[3 * k + c]!;
          off += sr * Math.abs(aligned - mean[3 * cell[i]! + c]!);
          whole += sr;
        }
        trust[k]![i] = 1 / (1 + (off / Math.max(whole, 1e-12) / OUTLIER) ** 2);
      }
    });
  }
  return trust;
}

function meanSky(
  views: readonly Cells[],
  logGain: Float64Array,
  trust: readonly Float32Array[],
): Float32Array {
  const [sum, counted] = [new Float64Array(3 * CELLS), new Float64Array(3 * CELLS)];
  views.forEach(({ cell, log, weight }, k) => {
    for (let i = 0; i < cell.length; i++) {
      for (let c = 0; c < 3; c++) {
        const share = weight[3 * i + c]! * trust[k]![i]!;
        counted[3 * cell[i]! + c]! += share;
        sum[3 * cell[i]! + c]! += share * (log[3 * i + c]! - logGain[3 * k + c]!);
      }
    }
  });
  return Float32Array.from(sum, (value, i) => value / Math.max(counted[i]!, 1e-12));
}

/** What the views saw, laid into one panorama at its own sharpness: blend.py. */
import { FUSE } from "../contract/generated.ts";
import { type Cells, cellOf, feather, LINEAR, tangents, type View } from "./view.ts";

const { AGREES, CELLS, CLIPPED, EDGE, REACH_PX, SHARPNESS } = FUSE;

export interface Seen {
  /** Linear; 0 where nothing was seen. */
  readonly radiance: Float32Array;
  /** How much each texel was seen, 0 to 1. */
  readonly share: Float32Array;
  /** Number of channels that clip in every view that saw them: there, radiance is a lower bound. */
  readonly clipped: Uint8Array;
}

/** What one view shows of the panorama. */
interface Sample {
  readonly at: Int32Array;
  readonly values: Float32Array;
  /** One bit for each channel that clips. */
  readonly clipped: Uint8Array;
  readonly soft: Float32Array;
  /** The most radiance within some pixels: what an edge or parallax may hide. */
  readonly nearby: Float32Array;
}

/**
 * Lays views into a panorama whose texels look along `directions`, world: x, y, z of each.
 *
 * Where one view clips and another, exposed for less, shows at least as much, the other's value
 * counts. A darker value contradicts the clipped one, and the better placed view wins.
 */
export function blended(
  views: readonly View[],
  cells: readonly Cells[],
  logGain: Float64Array,
  trust: readonly Float32Array[],
  directions: Float32Array,
): Seen {
  const count = directions.length / 3;
  const samples = views.map((view) => sampleOf(view, directions));
  const share = new Float32Array(count);
  const [bound, boundWeight] = [new Float32Array(3 * count), new Float32Array(3 * count)];
  samples.forEach((sample, k) => {
    const trustOf = spread(cells[k]!, trust[k]!);
    const scale = [0, 1, 2].map((c) => Math.exp(-logGain[3 * k + c]!));
    for (let i = 0; i < sample.at.length; i++) {
      const at = sample.at[i]!;
      const soft = sample.soft[i]!;
      share[at] = Math.max(share[at]!, Math.min(soft / EDGE, 1));
      const cell = cellOf(directions[3 * at]!, directions[3 * at + 1]!, directions[3 * at + 2]!);
      sample.soft[i] = soft ** SHARPNESS * trustOf[cell]! + 1e-9;
      for (let c = 0; c < 3; c++) {
        sample.values[3 * i + c]! *= scale[c]!;
        sample.nearby[3 * i + c]! *= scale[c]!;
        if (!(sample.clipped[i]! & (1 << c))) continue;
        bound[3 * at + c] = Math.max(bound[3 * at + c]!, sample.values[3 * i + c]!);
        boundWeight[3 * at + c]! += sample.soft[i]!;
      }
    }
  });
  return decided(samples, bound, boundWeight, share);
}

function decided(
  samples: readonly Sample[],
  bound: Float32Array,
  boundWeight: Float32Array,
  share: Float32Array,
): Seen {
  const size = bound.length;
  const [above, aboveWeight] = [new Float32Array(size), new Float32Array(size)];
  const [below, belowWeight] = [new Float32Array(size), new Float32Array(size)];
  for (const { at, values, clipped, soft, nearby } of samples) {
    for (let i = 0; i < 3 * at.length; i++) {
      const [texel, c] = [Math.floor(i / 3), i % 3];
      if (clipped[texel]! & (1 << c)) continue;
      const to = 3 * at[texel]! + c;
      const weight = soft[texel]!;
      const agrees = nearby[i]! > AGREES * bound[to]!;
      (agrees ? above : below)[to]! += weight * values[i]!;
      (agrees ? aboveWeight : belowWeight)[to]! += weight;
    }
  }
  const radiance = new Float32Array(size);
  const clipped = new Uint8Array(share.length);
  for (let i = 0; i < size; i++) {
    const isBelow = belowWeight[i]! > boundWeight[i]!;
    if (aboveWeight[i]! > 0) radiance[i] = above[i]! / aboveWeight[i]!;
    else radiance[i] = isBelow ? below[i]! / belowWeight[i]! : bound[i]!;
    if (aboveWeight[i] === 0 && !isBelow && bound[i]! > 0) clipped[Math.floor(i / 3)]! += 1;
  }
  return { radiance, share, clipped };
}

/** Trust by cell of the sky; a cell that the view did not see whole is trusted. */
function spread({ cell }: Cells, trust: Float32Array): Float32Array {
  const all = new Float32Array(CELLS).fill(1);
  cell.forEach((own, i) => {
    all[own] = trust[i]!;
  });
  return all;
}

function sampleOf(view: View, directions: Float32Array): Sample {
  const { width, height, worldFromCamera: m } = view;
  const [halfWidth, halfHeight] = tangents(view);
  const nearest = 1 / Math.hypot(1, halfWidth, halfHeight);
  const [x, y, z] = [-m[2], -m[5], -m[8]];
  const at: number[] = [];
  const place: number[] = []; // row and column
  for (let i = 0; i < directions.length; i += 3) {
    const [dx, dy, dz] = [directions[i]!, directions[i + 1]!, directions[i + 2]!];
    const depth = x * dx + y * dy + z * dz;
    if (!(depth > nearest)) continue;
    const right = (m[0] * dx + m[3] * dy + m[6] * dz) / depth / halfWidth;
    const up = (m[1] * dx + m[4] * dy + m[7] * dz) / depth / halfHeight;
    if (!(Math.abs(right) < 1 && Math.abs(up) < 1)) continue;
    at.push(i / 3);
    place.push((1 - up) * (height / 2) - 0.5, (right + 1) * (width / 2) - 0.5);
  }
  return interpolated(view, Int32Array.from(at), place);
}

function interpolated(view: View, at: Int32Array, place: readonly number[]): Sample {
  const { pixels, width, height } = view;
  const soft = feather(height, width);
  const greatest = greatestOf(view);
  const last = width * height - 1;
  const sample = {
    at,
    values: new Float32Array(3 * at.length),
    clipped: new Uint8Array(at.length),
    soft: new Float32Array(at.length),
    nearby: new Float32Array(3 * at.length),
  };
  for (let i = 0; i < at.length; i++) {
    const row = Math.min(Math.max(place[2 * i]!, 0), height - 1.001);
    const column = Math.min(Math.max(place[2 * i + 1]!, 0), width - 1.001);
    const [top, left] = [Math.floor(row), Math.floor(column)];
    const [down, right] = [row - top, column - left];
    const index = top * width + left;
    for (let k = 0; k < 4; k++) {
      const part = (k & 2 ? down : 1 - down) * (k & 1 ? right : 1 - right);
      const tap = Math.min(index + (k & 2 ? width : 0) + (k & 1), last);
      sample.soft[i]! += soft[tap]! * part;
      for (let c = 0; c < 3; c++) {
        const value = pixels[3 * tap + c]!;
        sample.values[3 * i + c]! += LINEAR[value]! * part;
        if (value >= CLIPPED) sample.clipped[i]! |= 1 << c;
      }
    }
    for (let c = 0; c < 3; c++) sample.nearby[3 * i + c] = LINEAR[greatest[3 * index + c]!]!;
  }
  return sample;
}

const kept = new WeakMap<View, Uint8Array>();

/** Each channel's greatest value within `REACH_PX` rows and columns. */
function greatestOf(view: View): Uint8Array {
  let found = kept.get(view);
  if (!found) {
    const { pixels, width, height } = view;
    found = greatestAlong(greatestAlong(pixels, width, height, "row"), width, height, "column");
    kept.set(view, found);
  }
  return found;
}

function greatestAlong(
  pixels: Uint8Array,
  width: number,
  height: number,
  along: "row" | "column",
): Uint8Array {
  const result = new Uint8Array(pixels.length);
  const steps = Array.from({ length: 2 * REACH_PX + 1 }, (_, k) => k - REACH_PX);
  for (let row = 0, to = 0; row < height; row++) {
    for (let column = 0; column < width; column++, to += 3) {
      for (const step of steps) {
        const r = along === "row" ? Math.min(Math.max(row + step, 0), height - 1) : row;
        const k = along === "column" ? Math.min(Math.max(column + step, 0), width - 1) : column;
        const from = 3 * (r * width + k);
        for (let c = 0; c < 3; c++) {
          if (pixels[from + c]! > result[to + c]!) result[to + c] = pixels[from + c]!;
        }
      }
    }
  }
  return result;
}

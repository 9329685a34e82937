/** What the views saw, laid into one panorama at its own sharpness: blend.py. */
import { FUSE } from "../contract/generated.ts";
import { rememberedOf } from "./remembered-of.ts";
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

/** What one view shows of the panorama, in its own exposure. */
interface Sample {
  readonly at: Int32Array;
  /** Of the coarse sky, where each texel lies. */
  readonly cell: Int32Array;
  readonly values: Float32Array;
  /** One bit for each channel that clips. */
  readonly clipped: Uint8Array;
  /** How much each texel counts as seen, and among views. */
  readonly share: Float32Array;
  readonly weight: Float32Array;
  /** The most radiance within some pixels: what an edge or parallax may hide. */
  readonly nearby: Float32Array;
}

/** A sample with how much its view is trusted, and with what brings it to the common exposure. */
interface Weighted {
  readonly sample: Sample;
  readonly weight: Float32Array;
  readonly scale: readonly number[];
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
  const share = new Float32Array(count);
  const [bound, boundWeight] = [new Float32Array(3 * count), new Float32Array(3 * count)];
  const weighted = views.map((view, k): Weighted => {
    const sample = sampleOf(view, directions);
    const { at, cell, values, clipped } = sample;
    const trustOf = spread(cells[k]!, trust[k]!);
    const scale = [0, 1, 2].map((c) => Math.exp(-logGain[3 * k + c]!));
    const weight = new Float32Array(at.length);
    for (let i = 0; i < at.length; i++) {
      const to = at[i]!;
      share[to] = Math.max(share[to]!, sample.share[i]!);
      weight[i] = sample.weight[i]! * trustOf[cell[i]!]! + 1e-9;
      if (!clipped[i]) continue;
      for (let c = 0; c < 3; c++) {
        if (!(clipped[i]! & (1 << c))) continue;
        bound[3 * to + c] = Math.max(bound[3 * to + c]!, values[3 * i + c]! * scale[c]!);
        boundWeight[3 * to + c]! += weight[i]!;
      }
    }
    return { sample, weight, scale };
  });
  return decided(weighted, bound, boundWeight, share);
}

function decided(
  samples: readonly Weighted[],
  bound: Float32Array,
  boundWeight: Float32Array,
  share: Float32Array,
): Seen {
  const size = bound.length;
  const [above, aboveWeight] = [new Float32Array(size), new Float32Array(size)];
  const [below, belowWeight] = [new Float32Array(size), new Float32Array(size)];
  for (const { sample, weight, scale } of samples) {
    const { at, values, clipped, nearby } = sample;
    for (let i = 0; i < at.length; i++) {
      const [own, bits] = [weight[i]!, clipped[i]!];
      for (let c = 0; c < 3; c++) {
        if (bits & (1 << c)) continue;
        const [from, to] = [3 * i + c, 3 * at[i]! + c];
        const value = own * values[from]! * scale[c]!;
        if (nearby[from]! * scale[c]! > AGREES * bound[to]!) {
          above[to]! += value;
          aboveWeight[to]! += own;
        } else {
          below[to]! += value;
          belowWeight[to]! += own;
        }
      }
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

/** A view shows the same of the same directions, whatever becomes of its exposure. */
const sampleOf = rememberedOf(sampled);

function sampled(view: View, directions: Float32Array): Sample {
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
  const cell = Int32Array.from(at, (i) => {
    return cellOf(directions[3 * i]!, directions[3 * i + 1]!, directions[3 * i + 2]!);
  });
  return { at: Int32Array.from(at), cell, ...interpolated(view, place) };
}

function interpolated(view: View, place: readonly number[]): Omit<Sample, "at" | "cell"> {
  const { pixels, width, height } = view;
  const soft = feather(height, width);
  const greatest = greatestOf(view);
  const last = width * height - 1;
  const count = place.length / 2;
  const sample = {
    values: new Float32Array(3 * count),
    clipped: new Uint8Array(count),
    share: new Float32Array(count),
    weight: new Float32Array(count),
    nearby: new Float32Array(3 * count),
  };
  for (let i = 0; i < count; i++) {
    const row = Math.min(Math.max(place[2 * i]!, 0), height - 1.001);
    const column = Math.min(Math.max(place[2 * i + 1]!, 0), width - 1.001);
    const [top, left] = [Math.floor(row), Math.floor(column)];
    const [down, right] = [row - top, column - left];
    const index = top * width + left;
    let feathered = 0;
    for (let k = 0; k < 4; k++) {
      const part = (k & 2 ? down : 1 - down) * (k & 1 ? right : 1 - right);
      const tap = Math.min(index + (k & 2 ? width : 0) + (k & 1), last);
      feathered += soft[tap]! * part;
      for (let c = 0; c < 3; c++) {
        const value = pixels[3 * tap + c]!;
        sample.values[3 * i + c]! += LINEAR[value]! * part;
        if (value >= CLIPPED) sample.clipped[i]! |= 1 << c;
      }
    }
    sample.share[i] = Math.min(feathered / EDGE, 1);
    sample.weight[i] = feathered ** SHARPNESS;
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

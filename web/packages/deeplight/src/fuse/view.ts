/** One picture whose rotation is known, kept small: what fusing works with. view.py. */
import { FUSE, GAMMA } from "../contract/generated.ts";
import type { Matrix3x3 } from "../light/matrix.ts";
import { solidAngles } from "../light/mirror-ball.ts";
import { rowSolidAngles, texelOf } from "../light/panorama.ts";
import { remembered } from "../light/remembered.ts";

/** An upright picture, gamma-encoded RGB, averaged down by `smallSize`. */
export interface SmallPicture {
  readonly pixels: Uint8Array;
  readonly width: number;
  readonly height: number;
  readonly verticalFovRad: number;
}

export interface View extends SmallPicture {
  readonly worldFromCamera: Matrix3x3;
  /** What the network gives for it: ln radiance on the mirror ball, camera frame. */
  readonly logEstimate: Float32Array;
  /** Of the frame it was. */
  readonly number: number;
}

/** What a view says of the coarse sky: the cells that it saw, and RGB of each. */
export interface Cells {
  readonly cell: Int32Array;
  /** ln of the mean radiance. */
  readonly log: Float32Array;
  /** Solid angle as far as it is trusted; 0 where the channel says nothing. */
  readonly weight: Float32Array;
}

/** Linear values of pixel values; 1 is white. */
export const LINEAR = Float32Array.from({ length: 256 }, (_, value) => (value / 255) ** GAMMA);

const { CELL_ROWS, CELLS, CLIPPED, DARKEST, FEWEST, ROWS } = FUSE;
const TRAINED_HALF = Math.tan((33 * Math.PI) / 180);

/** Size at which a pixel is as wide as a texel of a panorama of 512 rows. */
export function smallSize(
  height: number,
  width: number,
  verticalFovRad: number,
): { readonly height: number; readonly width: number } {
  const rows = Math.round((ROWS * Math.tan(verticalFovRad / 2)) / TRAINED_HALF);
  if (rows >= height) return { height, width };
  return { height: Math.max(2, rows), width: Math.max(2, Math.round((width * rows) / height)) };
}

/** Half width and half height of a picture on the plane at distance 1. */
export function tangents({ width, height, verticalFovRad }: SmallPicture): [number, number] {
  const half = Math.tan(verticalFovRad / 2);
  return [(half * width) / height, half];
}

/** Index of the coarse cell that a direction lies in. */
export function cellOf(x: number, y: number, z: number): number {
  return texelOf(x, y, z, CELL_ROWS);
}

/** How well a pixel is trusted: 1 in the middle, near 0 at the edge, where lenses darken and blur. */
export const feather = remembered((height: number, width: number): Float32Array => {
  const along = (n: number) =>
    Array.from({ length: n }, (_, i) => 1 - ((i + 0.5) * (2 / n) - 1) ** 2);
  const [rows, columns] = [along(height), along(width)];
  return Float32Array.from({ length: height * width }, (_, i) => {
    return rows[Math.floor(i / width)]! * columns[i % width]!;
  });
});

/** Mean radiance over all directions that the estimate speaks for, as its logarithm. */
export function logPower(logEstimate: Float32Array): [number, number, number] {
  const share = solidAngles(Math.sqrt(logEstimate.length / 3));
  const sum: [number, number, number] = [0, 0, 0];
  share.forEach((sr, pixel) => {
    if (sr === 0) return;
    for (const c of [0, 1, 2] as const) sum[c] += sr * Math.exp(logEstimate[3 * pixel + c]!);
  });
  return [0, 1, 2].map((c) => Math.log(sum[c]! / (4 * Math.PI))) as [number, number, number];
}

/** A channel that clips in a cell, or is near black on average, says nothing about its mean. */
export function cellsOf(view: View): Cells {
  const sums = summed(view);
  const found: number[] = [];
  const [logs, weights]: number[][] = [[], []];
  const sr = rowSolidAngles(CELL_ROWS);
  const darkest = LINEAR[DARKEST]!;
  for (const cell of sums.touched) {
    const own = sr[Math.floor(cell / (2 * CELL_ROWS))]!;
    if (!(sums.covered[cell]! > FEWEST * own)) continue;
    const count = sums.count[cell]!;
    const weight = (sums.trust[cell]! / count) * own;
    const means = [0, 1, 2].map((c) => sums.linear[3 * cell + c]! / count);
    const usable = means.map((mean, c) => !sums.spoilt[3 * cell + c] && mean > darkest);
    if (!usable.includes(true)) continue;
    found.push(cell);
    for (const c of [0, 1, 2]) {
      logs!.push(Math.log(Math.max(means[c]!, darkest)));
      weights!.push(usable[c] ? weight : 0);
    }
  }
  return {
    cell: Int32Array.from(found),
    log: Float32Array.from(logs!),
    weight: Float32Array.from(weights!),
  };
}

interface Sums {
  readonly touched: readonly number[];
  readonly count: Int32Array;
  readonly covered: Float64Array;
  readonly trust: Float64Array;
  readonly linear: Float64Array;
  readonly spoilt: Uint8Array;
}

function summed(view: View): Sums {
  const { pixels, width, height, worldFromCamera: m } = view;
  const [halfWidth, halfHeight] = tangents(view);
  const soft = feather(height, width);
  const area = (4 * halfWidth * halfHeight) / (width * height);
  const count = new Int32Array(CELLS);
  const [covered, trust] = [new Float64Array(CELLS), new Float64Array(CELLS)];
  const [linear, spoilt] = [new Float64Array(3 * CELLS), new Uint8Array(3 * CELLS)];
  const touched: number[] = [];
  for (let row = 0, i = 0; row < height; row++) {
    const up = (1 - (row + 0.5) * (2 / height)) * halfHeight;
    for (let column = 0; column < width; column++, i++) {
      const right = ((column + 0.5) * (2 / width) - 1) * halfWidth;
      const cell = cellOf(
        m[0] * right + m[1] * up - m[2],
        m[3] * right + m[4] * up - m[5],
        m[6] * right + m[7] * up - m[8],
      );
      if (count[cell]!++ === 0) touched.push(cell);
      const squared = 1 + right * right + up * up;
      covered[cell]! += area / (squared * Math.sqrt(squared));
      trust[cell]! += soft[i]!;
      for (let c = 0; c < 3; c++) {
        const value = pixels[3 * i + c]!;
        linear[3 * cell + c]! += LINEAR[value]!;
        if (value >= CLIPPED) spoilt[3 * cell + c] = 1;
      }
    }
  }
  return { touched, count, covered, trust, linear, spoilt };
}

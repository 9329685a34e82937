/** Pictures made larger or smaller with straight lines between their pixels' centres. */
import type { Dense, Node } from "./onnx.ts";

/** @throws RangeError where it is another way of resizing. */
export function resized({ attributes }: Node, scales: Dense | undefined): (x: Dense) => Dense {
  const { mode, coordinate_transformation_mode: centres = "half_pixel", antialias } = attributes;
  const scale = Array.from(scales?.data ?? []);
  const isKnown = mode === "linear" && centres === "half_pixel" && !antialias;
  if (!isKnown || scale.length !== 4 || scale[0] !== 1 || scale[1] !== 1) {
    throw new RangeError(`resizing with ${JSON.stringify(attributes)} by ${scale}`);
  }
  const [down, across] = [scale[2]!, scale[3]!];
  return (x) => {
    const [batch, channels, height, width] = x.shape as [number, number, number, number];
    const rows = tapsOf(height, down);
    const columns = tapsOf(width, across);
    const shape = [batch, channels, rows.first.length, columns.first.length];
    const data = new Float32Array(shape.reduce((a, b) => a * b));
    for (let channel = 0, to = 0; channel < batch * channels; channel++) {
      const plane = x.data.subarray(channel * height * width, (channel + 1) * height * width);
      for (let row = 0; row < rows.first.length; row++) {
        const [upper, lower] = [rows.first[row]! * width, rows.second[row]! * width];
        const below = rows.share[row]!;
        for (let column = 0; column < columns.first.length; column++, to++) {
          const [left, right] = [columns.first[column]!, columns.second[column]!];
          const beyond = columns.share[column]!;
          const top = plane[upper + left]! * (1 - beyond) + plane[upper + right]! * beyond;
          const bottom = plane[lower + left]! * (1 - beyond) + plane[lower + right]! * beyond;
          data[to] = top * (1 - below) + bottom * below;
        }
      }
    }
    return { shape, data };
  };
}

interface Taps {
  readonly first: Int32Array;
  readonly second: Int32Array;
  /** Of the second. */
  readonly share: Float64Array;
}

function tapsOf(length: number, scale: number): Taps {
  const count = Math.floor(length * scale);
  const taps: Taps = {
    first: new Int32Array(count),
    second: new Int32Array(count),
    share: new Float64Array(count),
  };
  for (let i = 0; i < count; i++) {
    const at = Math.min(Math.max((i + 0.5) / scale - 0.5, 0), length - 1);
    taps.first[i] = Math.floor(at);
    taps.second[i] = Math.min(Math.floor(at) + 1, length - 1);
    taps.share[i] = at - Math.floor(at);
  }
  return taps;
}

/** Area averages of pictures of any number of channels. */

export interface Size {
  readonly width: number;
  readonly height: number;
}

/** A picture cut into equal cells, whose edges may lie between pixels: the exact mean of each. */
export function cellMeans(values: Float32Array, from: Size, to: Size, channels = 3): Float32Array {
  const across = lineMeans(values, from.height, from.width, channels, to.width);
  const upright = transposed(across, from.height, to.width, channels);
  const down = lineMeans(upright, to.width, from.height, channels, to.height);
  return transposed(down, to.width, to.height, channels);
}

/** Means over equal stretches of each line. */
function lineMeans(
  values: Float32Array,
  lines: number,
  length: number,
  channels: number,
  count: number,
): Float32Array {
  if (length === count) return values;
  const size = length / count;
  const result = new Float32Array(lines * count * channels);
  for (let cell = 0; cell < count; cell++) {
    const [low, high] = [cell * size, (cell + 1) * size];
    const last = Math.min(Math.ceil(high - 1e-9), length);
    for (let at = Math.floor(low); at < last; at++) {
      const weight = (Math.min(at + 1, high) - Math.max(at, low)) / size;
      for (let line = 0; line < lines; line++) {
        const to = channels * (line * count + cell);
        const source = channels * (line * length + at);
        for (let c = 0; c < channels; c++) result[to + c]! += weight * values[source + c]!;
      }
    }
  }
  return result;
}

function transposed(
  values: Float32Array,
  rows: number,
  columns: number,
  channels: number,
): Float32Array {
  const result = new Float32Array(values.length);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      const [from, to] = [channels * (row * columns + column), channels * (column * rows + row)];
      for (let c = 0; c < channels; c++) result[to + c] = values[from + c]!;
    }
  }
  return result;
}

/** Reads a Radiance file as the package and Python write it. */
import { expect } from "vitest";

export function decodedHdr(file: Uint8Array): Float32Array {
  const header = new TextDecoder("latin1").decode(file);
  const [all, height, width] = /^[\s\S]*?\n\n-Y (\d+) \+X (\d+)\n/.exec(header)! as unknown as [
    string,
    string,
    string,
  ];
  const [rows, columns] = [Number(height), Number(width)];
  const result = new Float32Array(3 * rows * columns);
  let at = all.length;
  for (let row = 0; row < rows; row++) {
    expect(Array.from(file.subarray(at, at + 4))).toEqual([2, 2, columns >> 8, columns & 255]);
    at += 4;
    const planes = new Uint8Array(4 * columns);
    for (let filled = 0; filled < planes.length; ) {
      const count = file[at++]!;
      const isRun = count > 128;
      for (let i = 0; i < (isRun ? count - 128 : count); i++)
        planes[filled++] = file[isRun ? at : at++]!;
      if (isRun) at++;
    }
    for (let i = 0; i < 3 * columns; i++) {
      const [column, c] = [Math.floor(i / 3), i % 3];
      const exponent = planes[3 * columns + column]!;
      const mantissa = planes[c * columns + column]!;
      result[3 * row * columns + i] = exponent === 0 ? 0 : mantissa * 2 ** (exponent - 136);
    }
  }
  expect(at).toBe(file.length);
  return result;
}

/**
 * The network's input: exact area averages of a photo's gamma-encoded pixels over the cells of its
 * framing, as preprocess.network_input. Where the photo does not reach, its edge pixels go on.
 */
import type { Framing } from "./framing.ts";

/** Which pixels of a line a cell covers, and how far the first and the last. */
interface Spans {
  readonly first: Int32Array;
  readonly last: Int32Array;
  readonly firstWeight: Float64Array;
  readonly lastWeight: Float64Array; // 0 where the first is the last
  readonly length: number; // of a cell, in pixels
}

const PACKED = 256; // so many bytes add up in 16 bits

export class CellMeans {
  /** The part of the photo that matters, in whole pixels. */
  readonly left: number;
  readonly top: number;
  readonly width: number;
  readonly height: number;
  readonly #rows: Spans;
  readonly #columns: Spans;
  readonly #sums: Float64Array; // rows, columns, RGB
  readonly #line: Float64Array;
  #cell = 0; // the first row of cells that is not complete

  constructor(readonly framing: Framing) {
    const { top, bottom, left, right, photoHeight, photoWidth } = framing;
    this.#rows = spans(top, bottom, framing.inputHeight, photoHeight);
    this.#columns = spans(left, right, framing.inputWidth, photoWidth);
    this.top = this.#rows.first[0]!;
    this.height = this.#rows.last.at(-1)! + 1 - this.top;
    this.left = this.#columns.first[0]!;
    this.width = this.#columns.last.at(-1)! + 1 - this.left;
    this.#sums = new Float64Array(3 * framing.inputHeight * framing.inputWidth);
    this.#line = new Float64Array(3 * framing.inputWidth);
  }

  /** Adds whole rows of the part that matters, RGBA, from `row` of the photo on, in order. */
  add(rgba: Uint8ClampedArray, row: number): void {
    const pixels = new Uint32Array(rgba.buffer, rgba.byteOffset, rgba.byteLength / 4);
    const { first, last, firstWeight, lastWeight } = this.#rows;
    for (let i = 0; i < pixels.length / this.width; i++) {
      const at = row + i;
      this.#sumLine(pixels, i * this.width - this.left);
      while (this.#cell < first.length && last[this.#cell]! < at) this.#cell++;
      for (let cell = this.#cell; cell < first.length && first[cell]! <= at; cell++) {
        const isLast = at === last[cell] ? lastWeight[cell]! : 1;
        this.#addLine(cell, at === first[cell] ? firstWeight[cell]! : isLast);
      }
    }
  }

  /** Red, green and blue planes, with pixel value 0 at `low` and 255 at `high`. */
  planes(low: number, high: number): Float32Array {
    const count = this.#sums.length / 3;
    const scale = (high - low) / (255 * this.#rows.length * this.#columns.length);
    const result = new Float32Array(3 * count);
    for (let cell = 0; cell < count; cell++) {
      for (let c = 0; c < 3; c++)
        result[c * count + cell] = low + scale * this.#sums[3 * cell + c]!;
    }
    return result;
  }

  /** Sums one line of pixels over the columns' spans. */
  #sumLine(pixels: Uint32Array, start: number): void {
    const { first, last, firstWeight, lastWeight } = this.#columns;
    const line = this.#line;
    for (let cell = 0; cell < first.length; cell++) {
      const [from, to] = [start + first[cell]!, start + last[cell]!];
      const [head, tail] = [pixels[from]!, pixels[to]!];
      const [a, b] = [firstWeight[cell]!, lastWeight[cell]!];
      let red = a * (head & 255) + b * (tail & 255);
      let green = a * ((head >>> 8) & 255) + b * ((tail >>> 8) & 255);
      let blue = a * ((head >>> 16) & 255) + b * ((tail >>> 16) & 255);
      for (let at = from + 1; at < to; at += PACKED) {
        const end = Math.min(at + PACKED, to);
        let [even, odd] = [0, 0]; // two channels of 16 bits each
        for (let i = at; i < end; i++) {
          const pixel = pixels[i]!;
          even = (even + (pixel & 0xff00ff)) | 0;
          odd = (odd + ((pixel >>> 8) & 0xff)) | 0;
        }
        red += even & 0xffff;
        green += odd;
        blue += even >>> 16;
      }
      line[3 * cell] = red;
      line[3 * cell + 1] = green;
      line[3 * cell + 2] = blue;
    }
  }

  #addLine(cell: number, weight: number): void {
    const [line, sums] = [this.#line, this.#sums];
    const start = cell * line.length;
    for (let i = 0; i < line.length; i++) sums[start + i]! += weight * line[i]!;
  }
}

/** Cuts `low` to `high` into cells over a line of `length` pixels whose ends go on for ever. */
function spans(low: number, high: number, count: number, length: number): Spans {
  const clamped = (pixel: number) => Math.min(Math.max(pixel, 0), length - 1);
  const size = (high - low) / count;
  const result = {
    first: new Int32Array(count),
    last: new Int32Array(count),
    firstWeight: new Float64Array(count),
    lastWeight: new Float64Array(count),
    length: size,
  };
  for (let cell = 0; cell < count; cell++) {
    const [from, to] = [low + size * cell, low + size * (cell + 1)];
    const first = clamped(Math.floor(from));
    const last = Math.max(clamped(Math.ceil(to) - 1), first);
    result.first[cell] = first;
    result.last[cell] = last;
    result.firstWeight[cell] = last === first ? to - from : first + 1 - from;
    result.lastWeight[cell] = last === first ? 0 : to - last;
  }
  return result;
}

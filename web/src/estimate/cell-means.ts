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

/** Sums over rows, one entry per column: red and blue side by side in 16 bits each, and green. */
interface Sums {
  readonly redBlue: Int32Array;
  readonly green: Int32Array;
}

export class CellMeans {
  /** The part of the photo that matters, in whole pixels. */
  readonly left: number;
  readonly top: number;
  readonly width: number;
  readonly height: number;
  readonly #rows: Spans;
  readonly #columns: Spans;
  readonly #cells: Float64Array; // weighted sums: rows, columns, RGB
  readonly #whole: Sums; // of the rows that lie wholly in the present row of cells
  readonly #part: Sums; // of one row that is shared
  #wholeRows = 0;
  #present = 0; // the first row of cells that is not complete

  constructor(readonly framing: Framing) {
    const { top, bottom, left, right, photoHeight, photoWidth } = framing;
    this.#rows = spans(top, bottom, framing.inputHeight, photoHeight);
    this.#columns = spans(left, right, framing.inputWidth, photoWidth);
    this.top = this.#rows.first[0]!;
    this.height = this.#rows.last.at(-1)! + 1 - this.top;
    this.left = this.#columns.first[0]!;
    this.width = this.#columns.last.at(-1)! + 1 - this.left;
    this.#cells = new Float64Array(3 * framing.inputHeight * framing.inputWidth);
    this.#whole = noSums(this.width);
    this.#part = noSums(this.width);
  }

  /** Adds whole rows of the part that matters, RGBA, from `row` of the photo on, in order. */
  add(rgba: Uint8ClampedArray, row: number): void {
    const pixels = new Uint32Array(rgba.buffer, rgba.byteOffset, rgba.byteLength / 4);
    const end = row + pixels.length / this.width;
    for (let at = row; at < end; ) {
      const start = (at - row) * this.width;
      for (; this.#present < this.#rows.last.length && this.#rows.last[this.#present]! < at; ) {
        this.#flush();
        this.#present++;
      }
      if (Math.min(end - at, this.#wholeRowsFrom(at)) >= 4) {
        this.#makeRoom(4);
        addFourRows(this.#whole, pixels, start);
        at += 4;
      } else {
        this.#addToEach(pixels, start, at);
        at++;
      }
    }
  }

  /** Adds a row to every row of cells that has a part of it. */
  #addToEach(pixels: Uint32Array, start: number, at: number): void {
    const { first, last, firstWeight, lastWeight } = this.#rows;
    for (let cell = this.#present; cell < first.length && first[cell]! <= at; cell++) {
      const weight =
        at === first[cell] ? firstWeight[cell]! : at === last[cell] ? lastWeight[cell]! : 1;
      if (weight === 1 && cell === this.#present) {
        this.#makeRoom(1);
        addRow(this.#whole, pixels, start);
      } else {
        clear(this.#part);
        addRow(this.#part, pixels, start);
        this.#addColumns(this.#part, cell, weight);
      }
    }
  }

  /** How many rows from this one on lie wholly in the present row of cells, and in no other. */
  #wholeRowsFrom(at: number): number {
    const { first, last, firstWeight, lastWeight } = this.#rows;
    const cell = this.#present;
    if (cell >= first.length || at < first[cell]! + (firstWeight[cell] === 1 ? 0 : 1)) return 0;
    const isAlone = cell + 1 === first.length || first[cell + 1]! > last[cell]!;
    const shared = isAlone && lastWeight[cell] === 1 ? 0 : 1;
    return last[cell]! + 1 - shared - at;
  }

  /** Red, green and blue planes, with pixel value 0 at `low` and 255 at `high`. */
  planes(low: number, high: number): Float32Array {
    this.#flush();
    const count = this.#cells.length / 3;
    const scale = (high - low) / (255 * this.#rows.length * this.#columns.length);
    const result = new Float32Array(3 * count);
    for (let cell = 0; cell < count; cell++) {
      for (let c = 0; c < 3; c++)
        result[c * count + cell] = low + scale * this.#cells[3 * cell + c]!;
    }
    return result;
  }

  /** Before the sums of whole rows overflow they are taken into the cells. */
  #makeRoom(rows: number): void {
    if (this.#wholeRows + rows > PACKED) this.#flush();
    this.#wholeRows += rows;
  }

  #flush(): void {
    if (this.#wholeRows === 0) return;
    this.#addColumns(this.#whole, this.#present, 1);
    clear(this.#whole);
    this.#wholeRows = 0;
  }

  /** Adds up sums over the columns' spans, for one row of cells. */
  #addColumns({ redBlue, green }: Sums, row: number, weight: number): void {
    const { first, last, firstWeight, lastWeight } = this.#columns;
    const cells = this.#cells;
    for (let cell = 0, to = 3 * row * first.length; cell < first.length; cell++, to += 3) {
      const from = first[cell]! - this.left;
      const end = last[cell]! - this.left;
      const a = firstWeight[cell]!;
      const b = lastWeight[cell]!;
      let red = a * (redBlue[from]! & 0xffff) + b * (redBlue[end]! & 0xffff);
      let mid = a * green[from]! + b * green[end]!;
      let blue = a * (redBlue[from]! >>> 16) + b * (redBlue[end]! >>> 16);
      for (let i = from + 1; i < end; i++) {
        red += redBlue[i]! & 0xffff;
        mid += green[i]!;
        blue += redBlue[i]! >>> 16;
      }
      cells[to]! += weight * red;
      cells[to + 1]! += weight * mid;
      cells[to + 2]! += weight * blue;
    }
  }
}

function noSums(width: number): Sums {
  return { redBlue: new Int32Array(width), green: new Int32Array(width) };
}

function clear({ redBlue, green }: Sums): void {
  redBlue.fill(0);
  green.fill(0);
}

/** Nearly all the time goes here; four at once is twice as fast as one by one. */
function addFourRows({ redBlue, green }: Sums, pixels: Uint32Array, start: number): void {
  const width = green.length;
  for (let i = 0, at = start; i < width; i++, at++) {
    const a = pixels[at]!;
    const b = pixels[at + width]!;
    const c = pixels[at + 2 * width]!;
    const d = pixels[at + 3 * width]!;
    redBlue[i] = redBlue[i]! + (a & 0xff00ff) + (b & 0xff00ff) + (c & 0xff00ff) + (d & 0xff00ff);
    green[i] =
      green[i]! + ((a >>> 8) & 0xff) + ((b >>> 8) & 0xff) + ((c >>> 8) & 0xff) + ((d >>> 8) & 0xff);
  }
}

function addRow({ redBlue, green }: Sums, pixels: Uint32Array, start: number): void {
  const width = green.length;
  for (let i = 0; i < width; i++) {
    const pixel = pixels[start + i]!;
    redBlue[i] = redBlue[i]! + (pixel & 0xff00ff);
    green[i] = green[i]! + ((pixel >>> 8) & 0xff);
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

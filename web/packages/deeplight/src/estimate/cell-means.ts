/**
 * The network's input: exact area averages of a photo's gamma-encoded pixels over the cells of its
 * framing, as preprocess.network_input. Where the photo does not reach, its edge pixels go on.
 */

import type { Size } from "../light/means.ts";

/** Cells over a photo; edges in pixels from its upper left corner, which may lie outside it. */
export interface Grid {
  readonly photoHeight: number;
  readonly photoWidth: number;
  readonly top: number;
  readonly bottom: number;
  readonly left: number;
  readonly right: number;
  readonly inputHeight: number;
  readonly inputWidth: number;
}

/** The whole of a photo as this number of cells. */
export function wholePhoto(photo: Size, cells: Size): Grid {
  return {
    photoHeight: photo.height,
    photoWidth: photo.width,
    top: 0,
    bottom: photo.height,
    left: 0,
    right: photo.width,
    inputHeight: cells.height,
    inputWidth: cells.width,
  };
}

/** Which pixels of a line a cell covers, and how far the first and the last. */
interface Spans {
  readonly first: Int32Array;
  readonly last: Int32Array;
  readonly firstWeight: Float64Array;
  readonly lastWeight: Float64Array; // 0 where the first is the last
  readonly length: number; // of a cell, in pixels
}

/** The number of bytes that add up in 16 bits. */
const PACKED = 256;

/** Rows of pixels that follow each other. */
interface Rows {
  readonly pixels: Int32Array;
  readonly start: number;
  readonly pitch: number;
  readonly rows: number;
}

/** Sums over rows, one entry per column: two channels side by side, in 16 bits each. */
interface Sums {
  readonly redBlue: Int32Array;
  readonly green: Int32Array; // times 256; the other half is empty
  rows: number; // that are in it
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
  readonly #shared: Float64Array; // that row's own row of cells
  #present = 0; // the first row of cells that is not complete

  constructor(readonly grid: Grid) {
    const { top, bottom, left, right, photoHeight, photoWidth } = grid;
    this.#rows = spans(top, bottom, grid.inputHeight, photoHeight);
    this.#columns = spans(left, right, grid.inputWidth, photoWidth);
    this.top = this.#rows.first[0]!;
    this.height = this.#rows.last.at(-1)! + 1 - this.top;
    this.left = this.#columns.first[0]!;
    this.width = this.#columns.last.at(-1)! + 1 - this.left;
    this.#cells = new Float64Array(3 * grid.inputHeight * grid.inputWidth);
    this.#shared = new Float64Array(3 * grid.inputWidth);
    this.#whole = noSums(this.width);
    this.#part = noSums(this.width);
  }

  /** Forgets what was added. */
  reset(): void {
    this.#cells.fill(0);
    this.#whole.rows = 0;
    this.#present = 0;
  }

  /**
   * Adds rows of the part that matters, four bytes a pixel, from `row` of the photo on, in order.
   *
   * @param pitch pixels from the start of a row to that of the next.
   */
  add(bytes: Uint8Array | Uint8ClampedArray, row: number, pitch = this.width): void {
    const pixels = new Int32Array(bytes.buffer, bytes.byteOffset, bytes.byteLength / 4);
    const end = row + Math.ceil(pixels.length / pitch);
    for (let at = row; at < end; ) {
      const start = (at - row) * pitch;
      for (; this.#present < this.#rows.last.length && this.#rows.last[this.#present]! < at; ) {
        this.#flush();
        this.#present++;
      }
      const alone = Math.min(end - at, this.#aloneFrom(at), PACKED);
      if (alone > 0) {
        if (this.#whole.rows + alone > PACKED) this.#flush();
        addRows(this.#whole, { pixels, start, pitch, rows: alone });
        at += alone;
      } else {
        this.#addToEach({ pixels, start, pitch, rows: 1 }, at);
        at++;
      }
    }
  }

  /** Adds a row to every row of cells that has a part of it. */
  #addToEach(row: Rows, at: number): void {
    const { first, last, firstWeight, lastWeight } = this.#rows;
    const shared = this.#shared.fill(0);
    addRows(this.#part, row);
    this.#addColumns(this.#part, shared, 0);
    for (let cell = this.#present; cell < first.length && first[cell]! <= at; cell++) {
      const weight =
        at === first[cell] ? firstWeight[cell]! : at === last[cell] ? lastWeight[cell]! : 1;
      const to = cell * shared.length;
      for (let i = 0; i < shared.length; i++) this.#cells[to + i]! += weight * shared[i]!;
    }
  }

  /** How many rows from this one on lie wholly in the present row of cells, and in no other. */
  #aloneFrom(at: number): number {
    const { first, last, firstWeight, lastWeight } = this.#rows;
    const cell = this.#present;
    if (cell >= first.length || at < first[cell]! + (firstWeight[cell] === 1 ? 0 : 1)) return 0;
    const isAlone = cell + 1 === first.length || first[cell + 1]! > last[cell]!;
    const shared = isAlone && (lastWeight[cell] === 1 || last[cell] === first[cell]) ? 0 : 1;
    return last[cell]! + 1 - shared - at;
  }

  /**
   * Three planes, in the order of the pixels' bytes, with pixel value 0 at `low` and 255 at `high`.
   *
   * @param isReversed the bytes are BGRA: the last plane comes first.
   */
  planes(low: number, high: number, isReversed = false): Float32Array {
    this.#flush();
    const count = this.#cells.length / 3;
    const scale = (high - low) / (255 * this.#rows.length * this.#columns.length);
    const cells = this.#cells;
    const result = new Float32Array(3 * count);
    for (let c = 0; c < 3; c++) {
      const to = (isReversed ? 2 - c : c) * count;
      for (let cell = 0, at = c; cell < count; cell++, at += 3) {
        result[to + cell] = low + scale * cells[at]!;
      }
    }
    return result;
  }

  /** The same as RGB pixels, rows from the top: 0 to `white`. */
  rgb(isReversed = false, white = 1): Float32Array {
    const planes = this.planes(0, white, isReversed);
    const count = planes.length / 3;
    const result = new Float32Array(planes.length);
    for (let cell = 0, to = 0; cell < count; cell++) {
      for (let c = 0; c < 3; c++) result[to++] = planes[c * count + cell]!;
    }
    return result;
  }

  #flush(): void {
    if (this.#whole.rows === 0) return;
    this.#addColumns(this.#whole, this.#cells, 3 * this.#present * this.#columns.first.length);
  }

  /** Adds sums up over the columns' spans, to the row of cells at `to`, and empties them. */
  #addColumns(sums: Sums, cells: Float64Array, to: number): void {
    const { first, last, firstWeight, lastWeight } = this.#columns;
    const { redBlue, green } = sums;
    const most = Math.floor(PACKED / sums.rows); // this number of columns adds up before 16 bits are full
    for (let cell = 0, at = to; cell < first.length; cell++, at += 3) {
      const from = first[cell]! - this.left;
      const end = last[cell]! - this.left;
      const a = firstWeight[cell]!;
      const b = lastWeight[cell]!;
      let red = a * (redBlue[from]! & 0xffff) + b * (redBlue[end]! & 0xffff);
      let mid = a * green[from]! + b * green[end]!;
      let blue = a * (redBlue[from]! >>> 16) + b * (redBlue[end]! >>> 16);
      for (let i = from + 1; i < end; ) {
        const stop = Math.min(i + most, end);
        let both = 0;
        let one = 0;
        for (; i < stop; i++) {
          both = (both + redBlue[i]!) | 0;
          one = (one + green[i]!) | 0;
        }
        red += both & 0xffff;
        mid += one;
        blue += both >>> 16;
      }
      cells[at]! += red;
      cells[at + 1]! += mid / 256;
      cells[at + 2]! += blue;
    }
    sums.rows = 0;
  }
}

function noSums(width: number): Sums {
  return { redBlue: new Int32Array(width), green: new Int32Array(width), rows: 0 };
}

/** Most of the time goes here; four at once are twice as fast as one by one. */
function addRows(sums: Sums, { pixels, start, pitch, rows }: Rows): void {
  const { redBlue, green } = sums;
  const width = green.length;
  if (sums.rows === 0) {
    redBlue.fill(0);
    green.fill(0);
  }
  let row = 0;
  for (; row + 4 <= rows; row += 4) {
    for (let i = 0, at = start + row * pitch; i < width; i++, at++) {
      const a = pixels[at]!;
      const b = pixels[at + pitch]!;
      const c = pixels[at + 2 * pitch]!;
      const d = pixels[at + 3 * pitch]!;
      redBlue[i]! += (a & 0xff00ff) + (b & 0xff00ff) + (c & 0xff00ff) + (d & 0xff00ff);
      green[i]! += (a & 0xff00) + (b & 0xff00) + (c & 0xff00) + (d & 0xff00);
    }
  }
  for (; row < rows; row++) {
    for (let i = 0, at = start + row * pitch; i < width; i++, at++) {
      redBlue[i]! += pixels[at]! & 0xff00ff;
      green[i]! += pixels[at]! & 0xff00;
    }
  }
  sums.rows += rows;
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

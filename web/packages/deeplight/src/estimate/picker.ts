/** Takes the pixels out of a frame, a strip at a time, so that memory stays flat. */

import { EstimateError } from "../errors.ts";
import type { CellMeans } from "./cell-means.ts";

/** Opaque and upright. */
export type Frame = ImageBitmap | VideoFrame;

const STRIP_PIXELS = 2 ** 20;
const COPIED = ["RGBA", "RGBX", "BGRA", "BGRX"];

export function sizeOf(frame: Frame): { readonly width: number; readonly height: number } {
  return "displayWidth" in frame
    ? { width: frame.displayWidth, height: frame.displayHeight }
    : { width: frame.width, height: frame.height };
}

export class Picker {
  #canvas: OffscreenCanvas | undefined;
  #strip = new Uint8Array();
  #refused = false; // some browsers throw where others convert: the canvas from then on

  /**
   * Every pixel of the parts that matter, unscaled: averages are exact only then.
   *
   * @returns whether the pixels came as BGRA, not as RGBA.
   */
  async pick(frame: Frame, ...means: readonly CellMeans[]): Promise<boolean> {
    const format = await this.#copy(frame, means).catch(() => this.#giveUp(means));
    if (!format) this.#draw(frame, means);
    return format?.startsWith("B") ?? false;
  }

  #giveUp(means: readonly CellMeans[]): undefined {
    this.#refused = true;
    for (const one of means) one.reset(); // strips before the one that was refused
  }

  /** Ten times as fast as a canvas; undefined where the browser or the frame does not allow it. */
  async #copy(frame: Frame, means: readonly CellMeans[]): Promise<string | undefined> {
    if (this.#refused || typeof VideoFrame === "undefined") return undefined;
    const video = frame instanceof VideoFrame ? frame : new VideoFrame(frame, { timestamp: 0 });
    const from = video.visibleRect;
    const { width, height } = sizeOf(frame);
    const isPlain = from?.width === width && from.height === height && !isTurned(video);
    const format = COPIED.find((known) => known === video.format);
    try {
      if (!isPlain || !video.format) return undefined;
      // Other formats have one colour for two pixels, so their parts start at even ones.
      for (const part of strips(around(means), width, height, format ? 1 : 2)) {
        const { x, y, width: pitch, height: rows } = part;
        const rect = { x: x + from.x, y: y + from.y, width: pitch, height: rows };
        const how = format ? { rect } : { rect, format: "RGBA" as const };
        if (video.allocationSize(how) !== 4 * pitch * rows) return undefined; // cannot convert
        if (this.#strip.length < 4 * pitch * rows) this.#strip = new Uint8Array(4 * pitch * rows);
        await video.copyTo(this.#strip, how);
        give(this.#strip, part, means);
      }
      return format ?? "RGBA";
    } finally {
      if (video !== frame) video.close();
    }
  }

  #draw(frame: Frame, means: readonly CellMeans[]): void {
    const { x, y: top, width, height } = around(means);
    const rows = Math.min(Math.max(Math.floor(STRIP_PIXELS / width), 1), height);
    const context = this.#context(width, rows);
    for (let row = 0; row < height; row += rows) {
      const part = { x, y: top + row, width, height: Math.min(rows, height - row) };
      context.drawImage(frame, x, part.y, width, part.height, 0, 0, width, part.height);
      give(context.getImageData(0, 0, width, part.height).data, part, means);
    }
  }

  #context(width: number, height: number): OffscreenCanvasRenderingContext2D {
    if (this.#canvas?.width !== width || this.#canvas.height !== height) {
      if (typeof OffscreenCanvas === "undefined") {
        throw new EstimateError("runtime", "expected a browser with OffscreenCanvas");
      }
      this.#canvas = new OffscreenCanvas(width, height);
    }
    const context = this.#canvas.getContext("2d", { willReadFrequently: true });
    if (!context) throw new EstimateError("runtime", "expected a canvas, got none");
    context.imageSmoothingEnabled = false;
    context.globalCompositeOperation = "copy";
    return context;
  }
}

interface Part {
  readonly x: number;
  readonly y: number;
  readonly width: number;
  readonly height: number;
}

/** The part that holds all that matters. */
function around(means: readonly CellMeans[]): Part {
  const x = Math.min(...means.map(({ left }) => left));
  const y = Math.min(...means.map(({ top }) => top));
  const right = Math.max(...means.map(({ left, width }) => left + width));
  const bottom = Math.max(...means.map(({ top, height }) => top + height));
  return { x, y, width: right - x, height: bottom - y };
}

/** Adds to each what it wants of a part. */
function give(
  bytes: Uint8Array | Uint8ClampedArray,
  { x, y, width: pitch, height: rows }: Part,
  means: readonly CellMeans[],
): void {
  for (const one of means) {
    const first = Math.max(one.top - y, 0);
    const last = Math.min(one.top + one.height - y, rows);
    if (first >= last) continue;
    const start = 4 * (first * pitch + one.left - x);
    one.add(bytes.subarray(start, 4 * last * pitch), y + first, pitch);
  }
}

/** Cuts a part of a frame; edges lie on multiples of `grain`, where there are pixels. */
function* strips(all: Part, width: number, height: number, grain: number): Generator<Part> {
  const down = (edge: number): number => edge - (edge % grain);
  const x = down(all.x);
  const right = Math.min(down(all.x + all.width + grain - 1), width);
  const bottom = Math.min(down(all.y + all.height + grain - 1), height);
  const rows = Math.max(down(Math.floor(STRIP_PIXELS / (right - x))), grain);
  for (let y = down(all.y); y < bottom; y += rows) {
    yield { x, y, width: right - x, height: Math.min(rows, bottom - y) };
  }
}

/** Missing from the types and from older browsers, which turn their frames themselves. */
function isTurned(video: VideoFrame & { rotation?: number; flip?: boolean }): boolean {
  return Boolean(video.rotation || video.flip);
}

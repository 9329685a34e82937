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
   * Every pixel of the part that matters, unscaled: averages are exact only then.
   *
   * @returns whether the pixels came as BGRA, not as RGBA.
   */
  async pick(frame: Frame, means: CellMeans): Promise<boolean> {
    const format = await this.#copy(frame, means).catch(() => this.#giveUp(means));
    if (!format) this.#draw(frame, means);
    return format?.startsWith("B") ?? false;
  }

  #giveUp(means: CellMeans): undefined {
    this.#refused = true;
    means.reset(); // strips before the one that was refused
  }

  /** Ten times as fast as a canvas; undefined where the browser or the frame does not allow it. */
  async #copy(frame: Frame, means: CellMeans): Promise<string | undefined> {
    if (this.#refused || typeof VideoFrame === "undefined") return undefined;
    const video = frame instanceof VideoFrame ? frame : new VideoFrame(frame, { timestamp: 0 });
    const from = video.visibleRect;
    const { width, height } = sizeOf(frame);
    const isPlain = from?.width === width && from.height === height && !isTurned(video);
    const format = COPIED.find((known) => known === video.format);
    try {
      if (!isPlain || !video.format) return undefined;
      // Other formats have one colour for two pixels, so their parts start at even ones.
      const parts = strips(means, width, height, format ? 1 : 2);
      for (const { x, y, width: pitch, height: rows } of parts) {
        const rect = { x: x + from.x, y: y + from.y, width: pitch, height: rows };
        const how = format ? { rect } : { rect, format: "RGBA" as const };
        if (video.allocationSize(how) !== 4 * pitch * rows) return undefined; // cannot convert
        if (this.#strip.length < 4 * pitch * rows) this.#strip = new Uint8Array(4 * pitch * rows);
        await video.copyTo(this.#strip, how);
        const first = Math.max(means.top - y, 0);
        const last = Math.min(means.top + means.height - y, rows);
        const start = 4 * (first * pitch + means.left - x);
        means.add(this.#strip.subarray(start, 4 * last * pitch), y + first, pitch);
      }
      return format ?? "RGBA";
    } finally {
      if (video !== frame) video.close();
    }
  }

  #draw(frame: Frame, means: CellMeans): void {
    const { left, top, width, height } = means;
    const rows = Math.min(Math.max(Math.floor(STRIP_PIXELS / width), 1), height);
    const context = this.#context(width, rows);
    for (let row = 0; row < height; row += rows) {
      const count = Math.min(rows, height - row);
      context.drawImage(frame, left, top + row, width, count, 0, 0, width, count);
      means.add(context.getImageData(0, 0, width, count).data, top + row);
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

/** Cuts the part that matters of a frame; edges lie on multiples of `grain`, where there are pixels. */
function* strips(means: CellMeans, width: number, height: number, grain: number): Generator<Part> {
  const down = (edge: number): number => edge - (edge % grain);
  const x = down(means.left);
  const right = Math.min(down(means.left + means.width + grain - 1), width);
  const bottom = Math.min(down(means.top + means.height + grain - 1), height);
  const rows = Math.max(down(Math.floor(STRIP_PIXELS / (right - x))), grain);
  for (let y = down(means.top); y < bottom; y += rows) {
    yield { x, y, width: right - x, height: Math.min(rows, bottom - y) };
  }
}

/** Missing from the types and from older browsers, which turn their frames themselves. */
function isTurned(video: VideoFrame & { rotation?: number; flip?: boolean }): boolean {
  return Boolean(video.rotation || video.flip);
}

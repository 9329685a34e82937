/** Takes the pixels out of a frame, a strip at a time, so that memory stays flat. */
import { MID_GREY } from "../contract/generated.ts";
import type { CellMeans } from "./cell-means.ts";
import { EstimateError } from "./errors.ts";

const STRIP_PIXELS = 2 ** 20;

export class Picker {
  #canvas: OffscreenCanvas | undefined;

  /** Every pixel of the part that matters, unscaled: averages are exact only then. */
  pick(frame: ImageBitmap, means: CellMeans): void {
    const { left, top, width, height } = means;
    const rows = Math.min(Math.max(Math.floor(STRIP_PIXELS / width), 1), height);
    const context = this.#context(width, rows);
    for (let row = 0; row < height; row += rows) {
      const count = Math.min(rows, height - row);
      // Transparent parts show nothing that was seen: as in Python they are laid over mid-grey.
      context.fillRect(0, 0, width, count);
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
    context.fillStyle = `rgb(${MID_GREY},${MID_GREY},${MID_GREY})`;
    return context;
  }
}

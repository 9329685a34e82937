/** A still picture as the network is to see it: upright, opaque, no larger than browsers can hold. */
import { MID_GREY } from "../contract/generated.ts";

/** iPhones refuse canvases of more than 16.7 megapixels. */
const LONGEST_SIDE = 4096;

/** Draws `source` into an empty canvas, over mid-grey as Python does, and sets its size. */
export function drawStill<C extends HTMLCanvasElement | OffscreenCanvas>(
  canvas: C,
  source: CanvasImageSource,
  width: number,
  height: number,
): C {
  const scale = Math.min(1, LONGEST_SIDE / Math.max(width, height));
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  // Its pixels are read at once, by the estimate: no need for them to be on a graphics card.
  const context = canvas.getContext("2d", { willReadFrequently: true }) as
    | CanvasRenderingContext2D
    | OffscreenCanvasRenderingContext2D
    | null;
  if (!context) throw new RangeError(`no canvas of ${canvas.width} x ${canvas.height} pixels`);
  context.imageSmoothingQuality = "high";
  context.fillStyle = `rgb(${MID_GREY},${MID_GREY},${MID_GREY})`; // under transparent parts
  context.fillRect(0, 0, canvas.width, canvas.height);
  context.drawImage(source, 0, 0, canvas.width, canvas.height);
  return canvas;
}

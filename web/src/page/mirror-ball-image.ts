/** A mirror ball in a light that is known finer than on its own ball of 32 x 32 pixels. */
import {
  coverage,
  type Environment,
  type Matrix3x3,
  pixelDirection,
  pixelFromRadiance,
  REFLECTIVITY,
  sampled,
  turned,
} from "deeplight/core";

/** Seen straight on, as the camera would show it, RGBA, transparent around it. */
export function mirrorBall(
  { radiance, height }: Environment,
  worldFromCamera: Matrix3x3,
  size: number,
): Uint8ClampedArray<ArrayBuffer> {
  const pixels = new Uint8ClampedArray(4 * size * size);
  coverage(size).forEach((share, pixel) => {
    if (share === 0) return;
    const towards = turned(worldFromCamera, pixelDirection(pixel, size));
    sampled(radiance, height, ...towards).forEach((value, c) => {
      pixels[4 * pixel + c] = 255 * pixelFromRadiance(REFLECTIVITY.mirror * value);
    });
    pixels[4 * pixel + 3] = 255 * share;
  });
  return pixels;
}

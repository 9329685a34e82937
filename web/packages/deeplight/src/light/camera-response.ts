/** Radiance to pixel value and back, as camera_response.py: linear 1.0 is the camera's white. */
import { GAMMA, SOFT_CLIP_N } from "../contract/generated.ts";

/** Differentiable clip at 1 (equation 3); never above 1. */
export function softClip(radiance: number, n = SOFT_CLIP_N): number {
  const x = -n * (radiance - 1);
  return 1 - (Math.max(x, 0) + Math.log1p(Math.exp(-Math.abs(x)))) / n;
}

/** Pixel value, 0 to 1, of radiance: clipped, then gamma-encoded. */
export function pixelFromRadiance(radiance: number): number {
  return Math.max(softClip(radiance), 0) ** (1 / GAMMA);
}

/** Radiance of a pixel value below the clip; a clipped pixel gives a lower bound. */
export function radianceFromPixel(pixel: number): number {
  const linear = Math.min(Math.max(pixel, 0) ** GAMMA, 1 - 1e-6);
  return 1 - Math.log(Math.expm1(SOFT_CLIP_N * (1 - linear))) / SOFT_CLIP_N;
}

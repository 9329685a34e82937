/** Pictures of a made-up place, held as one likes. */

import type { SmallPicture } from "../packages/deeplight/src/fuse/view.ts";
import { rotationOf } from "../packages/deeplight/src/fuse/visual-rotation.ts";
import { type Matrix3x3, product } from "../packages/deeplight/src/light/matrix.ts";

const [WIDTH, HEIGHT, FOV] = [54, 96, (66 * Math.PI) / 180];

/** A made-up sky with large and small shapes, the same every time. */
export function sky(x: number, y: number, z: number): number {
  let sum = 0;
  for (let k = 1; k <= 12; k++) {
    const [a, b, c] = [Math.sin(7 * k), Math.sin(11 * k + 1), Math.sin(13 * k + 2)];
    sum += Math.sin(2.2 * k * (a * x + b * y + c * z) + k) / Math.sqrt(k);
  }
  return 0.5 + 0.16 * sum;
}

/** @param gain of the exposure of this picture. */
export function picture(worldFromCamera: Matrix3x3, gain = 1, of = sky): SmallPicture {
  const m = worldFromCamera;
  const half = Math.tan(FOV / 2);
  const pixels = new Uint8Array(3 * WIDTH * HEIGHT);
  for (let i = 0; i < WIDTH * HEIGHT; i++) {
    const x = (((i % WIDTH) + 0.5) * (2 / WIDTH) - 1) * half * (WIDTH / HEIGHT);
    const y = (1 - (Math.floor(i / WIDTH) + 0.5) * (2 / HEIGHT)) * half;
    const length = Math.hypot(x, y, 1);
    const lens = 1 - 0.2 * (x * x + y * y); // darker towards the edge
    const value = of(
      (m[0] * x + m[1] * y - m[2]) / length,
      (m[3] * x + m[4] * y - m[5]) / length,
      (m[6] * x + m[7] * y - m[8]) / length,
    );
    pixels.fill(Math.min(Math.max(255 * gain * lens * value, 0), 255), 3 * i, 3 * i + 3);
  }
  return { pixels, width: WIDTH, height: HEIGHT, verticalFovRad: FOV };
}

export const held = (yaw: number, pitch: number, roll: number): Matrix3x3 =>
  [rotationOf([0, yaw, 0]), rotationOf([pitch, 0, 0]), rotationOf([0, 0, roll])].reduce(product);

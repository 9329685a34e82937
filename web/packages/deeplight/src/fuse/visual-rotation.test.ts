import { expect, test } from "vitest";
import type { Matrix3x3 } from "../light/matrix.ts";
import { angleBetween, product, transposed } from "../light/matrix.ts";
import type { SmallPicture } from "./view.ts";
import { rotationOf, VisualRotation } from "./visual-rotation.ts";

const DEGREES = 180 / Math.PI;
const [WIDTH, HEIGHT, FOV] = [54, 96, (66 * Math.PI) / 180];

/** A made-up sky with large and small shapes, the same every time. */
function sky(x: number, y: number, z: number): number {
  let sum = 0;
  for (let k = 1; k <= 12; k++) {
    const [a, b, c] = [Math.sin(7 * k), Math.sin(11 * k + 1), Math.sin(13 * k + 2)];
    sum += Math.sin(2.2 * k * (a * x + b * y + c * z) + k) / Math.sqrt(k);
  }
  return 0.5 + 0.16 * sum;
}

/** @param gain of the exposure of this picture. */
function picture(worldFromCamera: Matrix3x3, gain = 1, of = sky): SmallPicture {
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

const held = (yaw: number, pitch: number, roll: number): Matrix3x3 =>
  [rotationOf([0, yaw, 0]), rotationOf([pitch, 0, 0]), rotationOf([0, 0, roll])].reduce(product);

test("a whole turn of a shaking hand comes out, and closes", () => {
  const visual = new VisualRotation();
  const errors: number[] = [];
  for (let k = 0; k <= 60; k++) {
    const turn = held((k * 6) / DEGREES, 0.08 * Math.sin(k / 5), 0.05 * Math.sin(k / 3));
    const found = visual.next(picture(turn, 0.85 + 0.15 * Math.sin(k / 7)), turn);
    expect(found, `frame ${k}`).not.toBeNull();
    errors.push(angleBetween(found!, turn) * DEGREES);
  }
  errors.sort((a, b) => a - b);
  expect(errors[30]).toBeLessThan(1);
  expect(errors.at(-1)).toBeLessThan(3);
});

test("a fast turn of 16 degrees between two pictures is found", () => {
  const visual = new VisualRotation();
  visual.next(picture(held(0, 0, 0)));
  const turn = held(16 / DEGREES, -8 / DEGREES, 0.1);
  expect(angleBetween(visual.next(picture(turn))!, turn) * DEGREES).toBeLessThan(0.5);
});

test("another place is not taken for a turn, and begins anew", () => {
  const visual = new VisualRotation();
  visual.next(picture(held(0, 0, 0)));
  const elsewhere = picture(held(0, 0, 0), 1, (x, y, z) => sky(z + 5, x - 3, 2 * y + 7));
  expect(visual.next(elsewhere)).toBeNull();
  visual.reset();
  const start = held(0.3, 0, 0);
  expect(visual.next(elsewhere, start)).toEqual(start);
});

test("the rotation about an axis is one", () => {
  const turn = rotationOf([0.3, -0.2, 0.5]);
  expect(angleBetween(product(turn, transposed(turn)), held(0, 0, 0))).toBeLessThan(1e-6);
  expect(rotationOf([0, 0.5, 0])[2]).toBeCloseTo(Math.sin(0.5), 9); // positive yaw turns to the left
});

import { expect, test } from "vitest";
import { held, picture, sky } from "../../../../tests/made-up-sky.ts";
import { angleBetween, product, transposed } from "../light/matrix.ts";
import { rotationOf, VisualRotation } from "./visual-rotation.ts";

const DEGREES = 180 / Math.PI;

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

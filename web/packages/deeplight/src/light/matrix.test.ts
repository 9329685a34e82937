import { expect, test } from "vitest";
import { IDENTITY, type Matrix3x3, product, transposed, turned } from "./matrix.ts";

const quarterAboutY: Matrix3x3 = [0, 0, 1, 0, 1, 0, -1, 0, 0];

test("a quarter turn about the vertical takes +Z to +X", () => {
  expect(turned(quarterAboutY, [0, 0, 1])).toEqual([1, 0, 0]);
});

test("a rotation and its transpose cancel", () => {
  expect(product(quarterAboutY, transposed(quarterAboutY))).toEqual(IDENTITY);
});

test("a product applies its right factor first", () => {
  const aboutX: Matrix3x3 = [1, 0, 0, 0, 0, -1, 0, 1, 0];
  const once = turned(product(aboutX, quarterAboutY), [0, 0, 1]);
  expect(once).toEqual(turned(aboutX, turned(quarterAboutY, [0, 0, 1])));
});

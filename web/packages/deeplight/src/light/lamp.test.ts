import { expect, test } from "vitest";
import { lampsOf } from "./lamp.ts";

test("lamps come from the network's seven numbers each", () => {
  const data = Float32Array.of(0, 2, 0, 0, Math.log(2), Math.log(3), 0.1, 0, 0, -1, 0, 0, 0, 0.2);
  const [first, second] = lampsOf({ shape: [1, 2, 7], data });
  expect(first?.direction).toEqual([0, 1, 0]);
  expect(first?.flux.map((value) => Math.round(value * 1e4) / 1e4)).toEqual([1, 2, 3]);
  expect(second?.direction[2]).toBe(-1);
  expect(second?.angularRadiusRad).toBeCloseTo(0.2, 6);
  expect(() => lampsOf({ shape: [1, 7, 2], data })).toThrow(/7 numbers/);
});

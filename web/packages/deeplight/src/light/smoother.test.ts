import { expect, test } from "vitest";
import { floats, golden, relativeError } from "../../../../tests/golden.ts";
import { Lighting } from "./lighting.ts";
import { IDENTITY, type Matrix3x3, transposed } from "./matrix.ts";
import { Smoother } from "./smoother.ts";

const world = Lighting.fromRadiance(floats(golden("light").radiance));
const even = (log: number) => new Lighting(new Float32Array(3072).fill(log));

/** A camera turned left by an angle. */
function yawed(angleRad: number): Matrix3x3 {
  const [c, s] = [Math.cos(angleRad), Math.sin(angleRad)];
  return [c, 0, s, 0, 1, 0, -s, 0, c];
}

test("light that stays is given as it is", () => {
  const smoother = new Smoother();
  smoother.next(world, 0);
  expect(smoother.next(world, 33).logRadiance).toEqual(world.logRadiance);
});

test("after one time constant 63 % of a step is taken over, whatever the frame rate", () => {
  for (const frames of [1, 7, 30]) {
    const smoother = new Smoother(300);
    let shown = smoother.next(even(0), 0);
    for (let i = 1; i <= frames; i++) shown = smoother.next(even(2), (300 * i) / frames);
    expect(shown.logRadiance[500]).toBeCloseTo(2 * (1 - Math.exp(-1)), 5);
  }
});

test("noise in log radiance is halved or better at 30 frames a second", () => {
  const smoother = new Smoother(300);
  let sum = 0;
  for (let i = 0; i < 200; i++) {
    const shown = smoother.next(even(i % 2 === 0 ? 0.2 : -0.2), 33 * i);
    if (i > 100) sum += Math.abs(shown.logRadiance[500]!) / 99;
  }
  expect(sum).toBeLessThan(0.1);
});

test("light that rests in the world rests while the camera turns", () => {
  const [honoured, ignored] = [new Smoother(300), new Smoother(300)];
  let error = 0;
  let twin = 0;
  for (let i = 0; i <= 30; i++) {
    const camera = yawed(0.04 * i); // 69 degrees in a second
    const seen = world.turned(transposed(camera));
    const truth = seen.harmonics(2);
    error = relativeError(honoured.next(seen, 33 * i, camera).harmonics(2), truth);
    twin = relativeError(ignored.next(seen, 33 * i).harmonics(2), truth);
  }
  expect(error).toBeLessThan(0.06);
  expect(twin).toBeGreaterThan(4 * error);
});

test("a long gap, a step back in time and a reset start anew", () => {
  const smoother = new Smoother(300);
  smoother.next(even(0), 0);
  expect(smoother.next(even(2), 5000).logRadiance[0]).toBe(2);
  expect(smoother.next(even(1), 100, IDENTITY).logRadiance[0]).toBe(1);
  smoother.reset();
  expect(smoother.next(even(3), 110).logRadiance[0]).toBe(3);
});

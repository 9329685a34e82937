/** three.js shows our light the right way round and as bright as it is, however the camera is held. */
import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { REFLECTIVITY } from "../packages/deeplight/src/contract/generated.ts";
import { directionFromUv } from "../packages/deeplight/src/light/mirror-ball.ts";
import { type Stage, staged } from "./stage.ts";

const SIZE = 32;
const STRAIGHT = [0, 0, 0] as const;
const HELD = [0.9, -0.5, 0.3] as const;
let page: Page;
let stage: Stage;

beforeAll(async () => {
  stage = await staged("balls", "ball");
  page = stage.page;
});
afterAll(() => stage?.close());

/** A lamp of another colour in each of six directions, wide enough for any pixel size. */
function lamps(mirrored = false): number[] {
  const colours = [
    [
      [1, 0, 0],
      [3, 0.1, 0.1],
    ],
    [
      [-1, 0, 0],
      [0.1, 3, 0.1],
    ],
    [
      [0, 1, 0],
      [0.1, 0.1, 3],
    ],
    [
      [0, -1, 0],
      [2, 2, 0.1],
    ],
    [
      [0, 0, 1],
      [0.1, 2, 2],
    ],
    [
      [0, 0, -1],
      [2, 0.1, 2],
    ],
  ] as const;
  return eachPixel((u, v) => {
    const [x, y, z] = directionFromUv(mirrored ? -u : u, v);
    return [0, 1, 2].map((c) =>
      Math.log(
        colours.reduce((sum, [[a, b, d], rgb]) => {
          return sum + rgb[c]! * Math.max(x * a + y * b + z * d, 0) ** 4;
        }, 0.05),
      ),
    );
  });
}

function eachPixel(make: (u: number, v: number) => number[]): number[] {
  return Array.from({ length: SIZE * SIZE }, (_, pixel) => {
    const [row, column] = [Math.floor(pixel / SIZE), pixel % SIZE];
    return make((2 * (column + 0.5)) / SIZE - 1, 1 - (2 * (row + 0.5)) / SIZE);
  }).flat();
}

const inside = (reach: number): boolean[] =>
  eachPixel((u, v) => [0, 1, 2].map(() => Number(Math.hypot(u, v) < reach))).map(Boolean);

/** Mean difference of pixel values over the disc, as the paper measures. */
function l1(got: readonly number[], want: readonly number[], reach = 0.93): number {
  const mask = inside(reach);
  const pixel = (radiance: number): number => Math.min(radiance, 1) ** (1 / 2.2);
  const errors = got
    .map((value, i) => Math.abs(pixel(value) - pixel(want[i]!)))
    .filter((_, i) => mask[i]);
  return errors.reduce((sum, error) => sum + error, 0) / errors.length;
}

const drawn = (
  material: "mirror" | "diffuse" | "glossy" | "cube",
  log: number[],
  pose: readonly [number, number, number],
): Promise<number[]> => page.evaluate((of) => window.ball(...of), [material, log, pose] as const);

test.each([
  ["straight", STRAIGHT],
  ["held askew", HELD],
] as const)("a mirror ball shows the light itself to a camera %s", async (_, pose) => {
  const light = lamps();
  const want = light.map((log) => REFLECTIVITY.mirror * Math.exp(log));
  expect(l1(await drawn("mirror", light, pose), want)).toBeLessThan(0.01);
  expect(l1(await drawn("mirror", lamps(true), pose), want)).toBeGreaterThan(0.1);
});

test("three.js's own materials see the same light, the same way round", async () => {
  const light = lamps();
  const coat = 0.55; // its colour, drawn here as bare metal
  const want = light.map((log) => coat * Math.exp(log));
  expect(l1(await drawn("glossy", light, HELD), want)).toBeLessThan(0.03);
});

test.each([
  ["straight", STRAIGHT],
  ["held askew", HELD],
] as const)("the package's cube texture is the light, for a camera %s", async (_, pose) => {
  const want = lamps().map(Math.exp);
  expect(l1(await drawn("cube", lamps(), pose), want)).toBeLessThan(0.03);
  expect(l1(await drawn("cube", lamps(true), pose), want)).toBeGreaterThan(0.1);
});

test("white light gives the reflectivity of the diffuse sphere", async () => {
  const mask = inside(0.9);
  const white = new Array<number>(3 * SIZE * SIZE).fill(0);
  const values = (await drawn("diffuse", white, HELD)).filter((_, i) => mask[i]);
  expect(Math.min(...values)).toBeGreaterThan(REFLECTIVITY.diffuse * 0.97);
  expect(Math.max(...values)).toBeLessThan(REFLECTIVITY.diffuse * 1.03);
});

/** The shadow of a .glb on the floor: whatever stands behind each other blocks a direction once. */
import { IDENTITY, Light, Lighting } from "deeplight/core";
import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { floorRays } from "../src/view/floor-rays.ts";
import { type Stage, staged } from "./stage.ts";

const GAMMA = 2.2;
const RAYS = 96;
const radiance = new Array<number>(3 * 32 * 32).fill(1);
let page: Page;
let stage: Stage;

beforeAll(async () => {
  stage = await staged("shadow", "left");
  page = stage.page;
});
afterAll(() => stage?.close());

/** What the box leaves of the rays that the floor below its middle gets. */
function expected(): number {
  const light = new Light(Lighting.fromRadiance(Float32Array.from(radiance)), null);
  const { toLight, power } = floorRays(light, IDENTITY, RAYS);
  let left = 1;
  for (let ray = 0; ray < RAYS; ray++) {
    const [x, y, z] = toLight.subarray(3 * ray, 3 * ray + 3) as unknown as [number, number, number];
    if (Math.max(Math.abs(x), Math.abs(z)) < 0.5 * y) left -= power[3 * ray]!;
  }
  return left;
}

test.each([1, 2, 5])("%i boxes, one inside the other, shadow as one", async (boxes) => {
  const want = expected();
  expect(want).toBeGreaterThan(0.6); // or blocking twice would go unseen
  const pixel = await page.evaluate((of) => window.left(...of), [radiance, boxes] as const);
  expect(Math.abs(pixel ** GAMMA - want)).toBeLessThan(0.05);
  expect(Math.abs(pixel ** GAMMA - (1 - 2 * (1 - want)))).toBeGreaterThan(0.1);
});

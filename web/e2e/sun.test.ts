/** The shadow of a true sun on the page's floor: where it falls, how dark it is, how sharp. */
import type { Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { boxGlb } from "./box.ts";
import { type Angles, BoxShadow, degreesBetween, towards } from "./box-shadow.ts";
import { type Stage, staged } from "./stage.ts";

const DEGREES = 180 / Math.PI;
const SUN_RAD = 0.27 / DEGREES;
const WIDE_RAD = 10 / DEGREES;
/** Of the floor's irradiance, where nothing stands. */
const SUN_SHARE = 0.8;
const [PHOTO_ROWS, LIVE_ROWS] = [256, 128];
let page: Page;
let stage: Stage;

beforeAll(async () => {
  stage = await staged("sun", "sunlit");
  page = stage.page;
});
afterAll(() => stage?.close());

/** A box in a lamp that gives the floor `SUN_SHARE` of its light; the sky the rest. */
async function shadow(sun: Angles, angularRadiusRad: number, rows: number): Promise<BoxShadow> {
  const direction = towards(sun);
  const power = (SUN_SHARE / (1 - SUN_SHARE)) * (Math.PI / direction[1]);
  const lamp = { direction, flux: [power, power, power] as const, angularRadiusRad };
  const of = [boxGlb().toString("base64"), lamp, 1, rows, rows === PHOTO_ROWS] as const;
  return new BoxShadow(await page.evaluate((all) => window.sunlit(...all), of));
}

test.each<readonly [string, Angles, number]>([
  ["ahead, in a photo's light", [46, 40], PHOTO_ROWS],
  ["ahead, in a film's light", [46, 40], LIVE_ROWS],
  ["behind the camera", [-140, 31], PHOTO_ROWS],
])("the shadow of a sun %s is crisp, in its place, as dark as its share", async (_, sun, rows) => {
  const box = await shadow(sun, SUN_RAD, rows);
  const found = box.foundSun();
  const edge = box.edge(sun, SUN_RAD);
  const { missing, sky } = box.inUmbra(sun);
  const [off, dark] = [degreesBetween(found, sun), missing - sky * (1 - SUN_SHARE)];
  console.log(
    `${off.toFixed(1)} degrees off, edge ${edge.pixels.toFixed(1)} pixels, ` +
      `${(1000 * edge.metres).toFixed(0)} mm where the sun makes ${(1000 * edge.penumbra).toFixed(0)}, ` +
      `sun's share ${dark.toFixed(3)}`,
  );
  expect(off).toBeLessThan(3);
  expect(edge.pixels).toBeLessThan(6);
  expect(Math.abs(dark - SUN_SHARE)).toBeLessThan(0.02);
});

test("a wide lamp's shadow is as soft as the lamp is wide", async () => {
  const sun: Angles = [46, 40];
  const edge = (await shadow(sun, WIDE_RAD, PHOTO_ROWS)).edge(sun, WIDE_RAD);
  expect(edge.metres / edge.penumbra).toBeGreaterThan(0.55); // 10 to 90 % of a disc: 0.69
  expect(edge.metres / edge.penumbra).toBeLessThan(0.85);
});

test("the light from the other side throws another shadow", async () => {
  const [azimuth, elevation] = [46, 40];
  const other = await shadow([-azimuth, elevation], SUN_RAD, PHOTO_ROWS);
  expect(degreesBetween(other.foundSun(), [azimuth, elevation])).toBeGreaterThan(30);
  expect(other.inUmbra([azimuth, elevation]).missing).toBeLessThan(0.5);
});

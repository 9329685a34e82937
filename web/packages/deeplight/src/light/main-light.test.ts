/** A light that is made of lamps has one list of them, and its main light is the first. */
import { expect, test } from "vitest";
import { Light } from "../light.ts";
import { addLamps, irradianceOf, type Lamp, lobeOnBall } from "./lamp.ts";
import { Lighting } from "./lighting.ts";
import { normalised } from "./matrix.ts";
import { powerOfBall } from "./mirror-ball.ts";

const HEIGHT = 128;
const SUN: Lamp = {
  direction: normalised([0.3, 0.8, 0.4]),
  flux: [3, 2.5, 2],
  angularRadiusRad: 0.03,
};
const WINDOW: Lamp = {
  direction: normalised([-1, 0.2, 0]),
  flux: [2, 2, 2],
  angularRadiusRad: 0.2,
};
/** A broad glow on the other side holds more than the sun: on the ball alone it would be the main light. */
const GLOW: Lamp = { direction: [0, 0, -1], flux: [9, 9, 9], angularRadiusRad: 0.5 };

function shown(lamps: readonly Lamp[]): Light {
  const radiance = new Float32Array(6 * HEIGHT ** 2).fill(0.2);
  addLamps(radiance, [SUN, WINDOW, GLOW], HEIGHT);
  const seen = new Float32Array(2 * HEIGHT ** 2);
  return Light.of({ radiance, height: HEIGHT, seen }, null, lamps);
}

function onBall(lamps: readonly Lamp[]): Light {
  const drawn = [SUN, WINDOW, GLOW].map((lamp) => lobeOnBall(lamp, 32));
  const ball = Float32Array.from({ length: 3072 }, (_, i) =>
    drawn.reduce((sum, lobe) => sum + lobe[i]!, 0.2),
  );
  return new Light(Lighting.fromRadiance(ball), null, lamps);
}

test.each([
  ["a panorama", shown],
  ["the ball alone", onBall],
])("of %s, the first lamp is the main light, and the rest lacks its power", (_, made) => {
  const light = made([SUN, WINDOW]);
  const { direction, irradiance, share, angularRadiusRad, remainder } = light.mainLight;
  expect(direction).toBe(SUN.direction);
  expect(irradiance).toEqual(irradianceOf(SUN));
  expect(angularRadiusRad).toBe(SUN.angularRadiusRad);
  const whole = powerOfBall(light.lighting.radiance(), 32);
  const left = powerOfBall(remainder, 32);
  for (const c of [0, 1, 2] as const) expect(left[c] + SUN.flux[c]).toBeCloseTo(whole[c], 3);
  expect(share).toBeGreaterThan(0.05);
  expect(Math.min(...remainder)).toBeGreaterThanOrEqual(0);
  // The other lamps stay in what is left: a renderer draws the main light only by itself.
  const found = light.withoutMainLight.mainLight.direction;
  expect(found[0] * SUN.direction[0] + found[1] * SUN.direction[1]).toBeLessThan(0.5);
  const none = made([]).mainLight.direction; // the twin: nobody says what its lamps are
  expect(none[2]).toBeLessThan(-0.9);
});

test("a turned light's main light is its turned lamp", () => {
  const quarter = [0, 0, 1, 0, 1, 0, -1, 0, 0] as const;
  const [x, y, z] = SUN.direction;
  for (const light of [shown([SUN]), onBall([SUN])]) {
    const { direction } = light.turned(quarter).mainLight;
    expect(Math.hypot(direction[0] - z, direction[1] - y, direction[2] + x)).toBeLessThan(1e-6);
  }
});

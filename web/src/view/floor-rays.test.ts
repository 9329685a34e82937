import {
  addLamps,
  IDENTITY,
  Light,
  Lighting,
  pixelOfDirection,
  texelDirections,
} from "deeplight/core";
import { describe, expect, it } from "vitest";
import { worldFromCamera } from "../sensors/pose.ts";
import { floorRays } from "./floor-rays.ts";

const EVEN = new Float32Array(32 * 32 * 3);
const EVENLY = new Light(new Lighting(EVEN), null);

function lamp(direction: readonly [number, number, number], rgb: readonly number[]): Light {
  const log = EVEN.slice();
  rgb.forEach((value, c) => {
    log[3 * pixelOfDirection(direction, 32) + c] = Math.log(value);
  });
  return new Light(new Lighting(log), null);
}

const sums = (power: Float32Array): number[] =>
  [0, 1, 2].map((c) => power.reduce((sum, value, i) => (i % 3 === c ? sum + value : sum), 0));

describe("floorRays", () => {
  it("shares out all light, in every channel", () => {
    const up = lamp([0.6, 0.8, 0], [900, 600, 300]);
    for (const light of [EVENLY, up]) {
      for (const sum of sums(floorRays(light, IDENTITY, 96).power)) expect(sum).toBeCloseTo(1, 1);
    }
  });

  it("comes from above, and for even light from every side alike", () => {
    const { toLight } = floorRays(EVENLY, IDENTITY, 96);
    const mean = [0, 0, 0];
    toLight.forEach((value, i) => {
      mean[i % 3]! += value / 96;
    });
    expect(Math.hypot(mean[0]!, mean[2]!)).toBeLessThan(0.06);
    expect(mean[1]).toBeCloseTo(2 / 3, 1); // of a cosine-weighted sky
    for (let i = 1; i < toLight.length; i += 3) expect(toLight[i]).toBeGreaterThan(0);
  });

  it("sends most rays to a strong lamp, turned with the camera", () => {
    const light = lamp([0.6, 0.8, 0], [5000, 5000, 5000]);
    const turn = worldFromCamera(Math.PI / 2, 0); // what was on the right is ahead
    const { toLight } = floorRays(light, turn, 64);
    let near = 0;
    for (let i = 0; i < 64; i++) {
      near += Number(-0.6 * toLight[3 * i + 2]! + 0.8 * toLight[3 * i + 1]! > 0.95);
    }
    expect(near).toBeGreaterThan(48);
  });

  it("sends a sun's rays from where it stands: its shadow is crisp", () => {
    const height = 128;
    const [sun, radius] = [[0.48, 0.8, -0.36] as const, 0.02];
    const directions = texelDirections(height);
    const radiance = new Float32Array(directions.length).fill(0.2);
    for (let i = 0; i < radiance.length; i += 3) {
      const cosine = sun.reduce((sum, value, c) => sum + value * directions[i + c]!, 0);
      if (cosine > Math.cos(radius)) radiance.fill(3000, i, i + 3);
    }
    const seen = new Float32Array(radiance.length / 3);
    const light = Light.of({ radiance, seen, height }, null);
    const { toLight } = floorRays(light, IDENTITY, 96);
    let [atSun, near] = [0, 0];
    for (let i = 0; i < toLight.length; i += 3) {
      const off = Math.acos(
        Math.min(
          sun.reduce((sum, value, c) => sum + value * toLight[i + c]!, 0),
          1,
        ),
      );
      if (off < radius + 0.01) atSun++;
      else if (off < 0.2) near++; // a ball's pixel would spread it as far
    }
    expect(atSun).toBeGreaterThan(70);
    expect(near).toBeLessThan(3);
  });

  it("draws from a known lamp itself, not from the texels that it lies across", () => {
    const height = 256;
    const direction = [Math.sin(0.7), Math.cos(0.7), 0] as const; // 28.5 rows of 128 down
    const sun = { direction, flux: [9, 8, 7] as const, angularRadiusRad: 0.0047 };
    const radiance = new Float32Array(6 * height ** 2).fill(0.2);
    addLamps(radiance, [sun], height);
    const environment = { radiance, seen: new Float32Array(2 * height ** 2), height };
    const offs = (light: Light): number[] => {
      const { toLight, power } = floorRays(light, IDENTITY, 96);
      for (const sum of sums(power)) expect(sum).toBeCloseTo(1, 1);
      return Array.from({ length: 96 }, (_, ray) => {
        const along = direction.map((value, c) => value - toLight[3 * ray + c]!);
        return Math.hypot(...along);
      }).filter((off) => off < 0.1);
    };
    const known = offs(Light.of(environment, null, [sun]));
    expect(known.length).toBeGreaterThan(80);
    expect(Math.max(...known)).toBeLessThan(sun.angularRadiusRad * 1.01);
    const unknown = offs(Light.of({ ...environment }, null));
    expect(Math.abs(unknown.length - known.length)).toBeLessThan(3); // as much light
    expect(Math.max(...unknown)).toBeGreaterThan(sun.angularRadiusRad);
  });
});

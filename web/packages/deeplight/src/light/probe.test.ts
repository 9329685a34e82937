import { describe, expect, test } from "vitest";
import { CONDON_SHORTLEY } from "../contract/generated.ts";
import type { Environment } from "./environment.ts";
import { luminance } from "./main-light.ts";
import { normalised, type Vector3 } from "./matrix.ts";
import { powerOf, texelDirections, texelOf } from "./panorama.ts";
import { environmentOfProbe, type Probe, probeOf, withProbe } from "./probe.ts";

const HEIGHT = 32;
const LAMP = normalised([1, 1, 0]);
const dim = (level: number) => Float32Array.from({ length: 27 }, (_, i) => (i < 3 ? level : 0));
const probe: Probe = { harmonics: dim(0.7), direction: LAMP, irradiance: [2, 1.5, 1] };

/** Seen where x is negative. */
function halfSeen(radiance: Float32Array): Environment {
  const directions = texelDirections(HEIGHT);
  const seen = Float32Array.from({ length: radiance.length / 3 }, (_, i) =>
    directions[3 * i]! < 0 ? 1 : 0,
  );
  return { radiance, seen, height: HEIGHT };
}

function brightest({ radiance }: Environment): Vector3 {
  const directions = texelDirections(HEIGHT);
  let best = 0;
  for (let i = 0; i < radiance.length / 3; i++) {
    if (luminance(radiance, i) > luminance(radiance, best)) best = i;
  }
  return [directions[3 * best]!, directions[3 * best + 1]!, directions[3 * best + 2]!];
}

describe("a platform's light probe", () => {
  test("is read with its own signs, a main light without direction from above", () => {
    const given = Array.from({ length: 27 }, (_, i) => i + 1);
    const read = probeOf({
      sphericalHarmonicsCoefficients: given,
      primaryLightDirection: { x: 0, y: 0, z: 0 },
      primaryLightIntensity: { x: 1, y: 2, z: 3 },
    });
    expect(read.direction).toEqual([0, 1, 0]);
    expect(read.irradiance).toEqual([1, 2, 3]);
    read.harmonics.forEach((value, i) => {
      expect(value).toBe(given[i]! * CONDON_SHORTLEY[Math.floor(i / 3)]!);
    });
  });

  test("drawn, its main light gives the irradiance that it says, next to the rest", () => {
    const { radiance } = environmentOfProbe(probe, HEIGHT);
    const rest = environmentOfProbe({ ...probe, irradiance: [0, 0, 0] }, HEIGHT).radiance;
    const [red, green, blue] = powerOf(radiance, HEIGHT).map(
      (p, c) => p - powerOf(rest, HEIGHT)[c]!,
    );
    // A narrow lobe: its power is hardly more than what faces it.
    expect(red! / 2).toBeGreaterThan(1);
    expect(red! / 2).toBeLessThan(1.02);
    expect(green! / red!).toBeCloseTo(0.75, 5);
    expect(blue! / red!).toBeCloseTo(0.5, 5);
    expect(brightest({ radiance, seen: new Float32Array(), height: HEIGHT })[0]).toBeGreaterThan(
      0.6,
    );
  });

  test("that agrees changes nothing, in whatever unit it is", () => {
    const agreed = halfSeen(environmentOfProbe(probe, HEIGHT).radiance);
    const bright: Probe = {
      harmonics: dim(7),
      direction: LAMP,
      irradiance: [20, 15, 10],
    };
    for (const one of [probe, bright]) {
      const off = withProbe(agreed, one).radiance.map((v, i) =>
        Math.abs(v / agreed.radiance[i]! - 1),
      );
      expect(Math.max(...off)).toBeLessThan(1e-4);
    }
  });

  test("leaves what was seen, and turns the unseen main light towards its own", () => {
    const ours = environmentOfProbe({ ...probe, direction: normalised([1, -0.2, 0.9]) }, HEIGHT);
    const light = halfSeen(ours.radiance.map((value, i) => value * (0.9 + 0.2 * ((i % 7) / 7))));
    const strong: Probe = { ...probe, irradiance: [9, 9, 9] };
    const fused = withProbe(light, strong);
    light.seen.forEach((share, i) => {
      if (share === 1) expect(fused.radiance[3 * i]).toBe(light.radiance[3 * i]);
    });
    const towards = (at: Vector3) => at[0] * LAMP[0] + at[1] * LAMP[1] + at[2] * LAMP[2];
    expect(towards(brightest(light))).toBeLessThan(0.9);
    expect(towards(brightest(fused))).toBeGreaterThan(0.98);
    const away = texelOf(1, -0.2, 0.9, HEIGHT);
    expect(fused.radiance[3 * away]).toBeLessThan(0.7 * light.radiance[3 * away]!); // half is left
  });
});

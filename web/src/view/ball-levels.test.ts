import { coverage } from "deeplight/core";
import { expect, it } from "vitest";
import { ballLevels } from "./ball-levels.ts";

it("ends with the mean of all light, whatever lies off the disc", () => {
  const lit = coverage(32);
  const radiance = Float32Array.from({ length: 3 * 32 * 32 }, (_, i) =>
    lit[Math.floor(i / 3)]! > 0 ? 1 + (i % 3) + Math.sin(i) : 1e6,
  );
  const levels = ballLevels(radiance, 32);
  expect(levels.map(({ size }) => size)).toEqual([32, 16, 8, 4, 2, 1]);
  const whole = lit.reduce((sum, share) => sum + share, 0);
  for (const c of [0, 1, 2]) {
    const mean =
      lit.reduce((sum, share, pixel) => sum + share * radiance[3 * pixel + c]!, 0) / whole;
    expect(levels.at(-1)!.rgb[c]).toBeCloseTo(mean, 4);
  }
});

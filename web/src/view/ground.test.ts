import { transposed, turned } from "deeplight/core";
import { describe, expect, it } from "vitest";
import { worldFromCamera } from "../sensors/pose.ts";
import { groundPoint, ray, showsGround, sizeSpanning, type Viewpoint } from "./ground.ts";

const VIEW: Viewpoint = {
  worldFromCamera: worldFromCamera(0.4, -0.35, 0.05),
  heightM: 1.2,
  verticalFovRad: 1.1,
  aspect: 0.6,
};

describe("groundPoint", () => {
  it("is seen where it was asked for", () => {
    for (const [x, y] of [
      [0.5, 0.7],
      [0.1, 0.6],
      [0.9, 0.95],
    ] as const) {
      const [px, py, pz] = groundPoint(VIEW, x, y);
      expect(py).toBe(0);
      const [cx, cy, cz] = turned(transposed(VIEW.worldFromCamera), [px, -VIEW.heightM, pz]);
      const up = Math.tan(VIEW.verticalFovRad / 2);
      expect((cx / -cz / (up * VIEW.aspect) + 1) / 2).toBeCloseTo(x, 9);
      expect((1 - cy / -cz / up) / 2).toBeCloseTo(y, 9);
    }
  });

  it("grows with the camera's height, and its direction stays", () => {
    const [x, , z] = groundPoint(VIEW, 0.3, 0.8);
    const [fx, , fz] = groundPoint({ ...VIEW, heightM: 2.4 }, 0.3, 0.8);
    expect([fx, fz]).toEqual([expect.closeTo(2 * x, 9), expect.closeTo(2 * z, 9)]);
  });

  it("stays within reach at the horizon and above", () => {
    for (const y of [0, 0.2, 0.35]) {
      const [x, , z] = groundPoint(VIEW, 0.5, y);
      expect(Math.hypot(x, z)).toBeLessThanOrEqual(12 * VIEW.heightM + 1e-9);
      expect(ray(VIEW, 0.5, y)[0] * x).toBeGreaterThanOrEqual(0);
    }
  });
});

describe("sizeSpanning", () => {
  it("spans its share of the shorter side", () => {
    const level = { ...VIEW, worldFromCamera: worldFromCamera(0, -Math.PI / 2) };
    const size = sizeSpanning(level, [0, 0, 0], 0.5);
    expect(size).toBeCloseTo(Math.tan(0.55) * 0.6 * 1.2, 9);
  });
});

describe("showsGround", () => {
  it("is true below the horizon, and not where the floor is too far away", () => {
    expect(showsGround(VIEW, 0.5, 0.9)).toBe(true);
    expect(showsGround(VIEW, 0.5, 0.02)).toBe(false);
    const level = { ...VIEW, worldFromCamera: worldFromCamera(0, 0) };
    expect(showsGround(level, 0.5, 0.51)).toBe(false);
    expect(showsGround(level, 0.5, 0.7)).toBe(true);
  });
});

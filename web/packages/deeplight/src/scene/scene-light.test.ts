import { describe, expect, test } from "vitest";
import { bytes, floats, golden, largestError } from "../../../../tests/golden.ts";
import { radianceFromPixel } from "../light/camera-response.ts";
import type { Lamp } from "../light/lamp.ts";
import type { Vector3 } from "../light/matrix.ts";
import { ballFromPanorama, powerOf } from "../light/panorama.ts";
import { continued, type Tilt } from "./continuation.ts";
import { planeOf, projected, reducedSize } from "./image-plane.ts";
import { sceneLight } from "./scene-light.ts";

const stored = golden("scene");
const { rows } = stored;
const size = { width: stored.photo.width as number, height: stored.photo.height as number };
const plane = planeOf(size, stored.vertical_fov_rad);
const pixels = Float32Array.from(bytes(stored.photo.rgb), (value) => value / 255);
const placed = { ...size, pixels, plane };

const cases = {
  lamps: { own: stored.own_lamps as readonly Lamp[], tilt: null },
  no_lamps: { own: [], tilt: null },
  upright: { own: stored.own_lamps as readonly Lamp[], tilt: stored.tilt as Tilt },
};

function scene(name: keyof typeof cases, photo = placed, tilt: Tilt | null = cases[name].tilt) {
  return sceneLight(floats(stored[name].ball), photo, rows, cases[name].own, tilt);
}

function everyEighth(values: Float32Array, channels: number): Float32Array {
  const width = 2 * rows * channels;
  return values.filter((_, i) => Math.floor(i / width) % 8 === 0);
}

/** Largest difference of logarithms, of what is not black. */
function farthest(got: Float32Array, want: Float32Array): number {
  return got.reduce((most, value, i) => {
    return want[i]! < 1e-3 ? most : Math.max(most, Math.abs(Math.log(value / want[i]!)));
  }, 0);
}

describe.each(["lamps", "no_lamps", "upright"] as const)(
  "a photo in its light, case %s",
  (name) => {
    const want = stored[name];

    test("is Python's, at the photo's own sharpness", () => {
      const got = scene(name);
      const radiance = everyEighth(got.radiance, 3);
      expect(farthest(radiance, floats(want.radiance_every_8th_row))).toBeLessThan(5e-3);
      expect(largestError(everyEighth(got.seen, 1), floats(want.seen_every_8th_row))).toBeLessThan(
        1e-4,
      );
      powerOf(got.radiance, rows).forEach((power, c) => {
        expect(power / want.power[c]).toBeCloseTo(1, 3);
      });
      const ball = ballFromPanorama(got.radiance, rows, 32);
      expect(farthest(ball, floats(want.as_ball))).toBeLessThan(2e-2);
    });

    test("has Python's lamps: where, how large, how strong", () => {
      const { lamps } = scene(name);
      expect(lamps.length).toBe(want.lamps.length);
      lamps.forEach((lamp, i) => {
        const other = want.lamps[i] as Lamp;
        expect(largestError(lamp.direction, other.direction)).toBeLessThan(1e-3);
        expect(lamp.angularRadiusRad).toBeCloseTo(other.angularRadiusRad, 4);
        lamp.flux.forEach((flux, c) => {
          expect(flux / other.flux[c as 0]).toBeCloseTo(1, 3);
        });
      });
    });
  },
);

test("a photo a little darker is another light", () => {
  const darker = { ...placed, pixels: pixels.map((value) => 0.98 * value) };
  const radiance = everyEighth(scene("lamps", darker).radiance, 3);
  expect(farthest(radiance, floats(stored.lamps.radiance_every_8th_row))).toBeGreaterThan(2e-2);
});

describe("a photo that goes on all around", () => {
  const known = (up: Vector3): Tilt => ({ up, scaleRad: 0 });
  const pitched = (rad: number) => known([0, Math.cos(rad), -Math.sin(rad)]);

  test.each([
    ["not at all", null],
    ["without the roll", { ...pitched(-0.25), scaleRad: stored.tilt.scaleRad }],
    ["as if the tilt were known", known(stored.tilt.up)],
  ])("is another light if it goes on %s", (_, tilt) => {
    const radiance = everyEighth(scene("upright", placed, tilt).radiance, 3);
    expect(farthest(radiance, floats(stored.upright.radiance_every_8th_row))).toBeGreaterThan(2e-2);
  });

  test("keeps the power of what is not seen, is even where all is even", () => {
    const grey = { ...placed, pixels: pixels.map(() => 0.5) };
    const shown = projected(grey, 64);
    const even = new Float32Array(6 * 64 * 64).fill(radianceFromPixel(0.5));
    const tilt = pitched(0.3);
    expect(largestError(continued(even, 64, shown, tilt), even)).toBeLessThan(1e-5);
    const map = even.map((value, i) => value * (2 + Math.sin(i % 7)));
    const got = continued(map, 64, shown, tilt);
    const hidden = (whole: Float32Array) =>
      powerOf(
        whole.map((value, i) => value * (1 - shown.seen[Math.floor(i / 3)]!)),
        64,
      );
    expect(largestError(hidden(got), hidden(map))).toBeLessThan(1e-4);
    expect(largestError(got, map)).toBeGreaterThan(0.05);
    expect(continued(map, 64, shown, known([0, 0.1, -0.995]))).toBe(map); // straight up: no side is ahead
  });
});

test("a fine photo is averaged to two pixels a texel, a coarse one is left", () => {
  const photo = { width: 3000, height: 4000 };
  const small = reducedSize(photo, planeOf(photo, 1.15), 256);
  expect(small.height).toBeGreaterThan(190);
  expect(small.height).toBeLessThan(240);
  expect(reducedSize(size, plane, 256)).toEqual(size);
});

import { describe, expect, test } from "vitest";
import {
  bytes,
  floats,
  golden,
  largestError,
  type Packed,
  relativeError,
} from "../../../../tests/golden.ts";
import { SCENE_FILE } from "../contract/generated.ts";
import { radianceFromPixel } from "../light/camera-response.ts";
import type { Lamp } from "../light/lamp.ts";
import { Lighting } from "../light/lighting.ts";
import type { Vector3 } from "../light/matrix.ts";
import { ballFromPanorama, enlarged, powerOf } from "../light/panorama.ts";
import { Light } from "../light.ts";
import { continued, type Tilt } from "./continuation.ts";
import { detailed, type LibraryPlace, sureKind } from "./detail.ts";
import { planeOf, projected, reducedSize } from "./image-plane.ts";
import { type Detail, sceneLight } from "./scene-light.ts";

const stored = golden("scene");
const { rows } = stored;
const size = { width: stored.photo.width as number, height: stored.photo.height as number };
const plane = planeOf(size, stored.vertical_fov_rad);
const pixels = Float32Array.from(bytes(stored.photo.rgb), (value) => value / 255);
const placed = { ...size, pixels, plane };

const places: readonly LibraryPlace[] = stored.places.map(
  ({
    name,
    kind,
    smooth,
    levels,
  }: Record<"name" | "kind" | "levels", string> & { smooth: Packed }) => ({
    name,
    kind,
    smooth: floats(smooth),
    levels: enlargedLevels(bytes(levels)),
  }),
);

/** A picture of 8 x 16 levels, each drawn out to a square, as RGBA. */
function enlargedLevels(few: Uint8Array): Uint8Array {
  return Uint8Array.from({ length: 4 * 128 * 256 }, (_, i) => {
    const [row, column] = [Math.floor(i / 1024) >> 4, ((i >> 2) % 256) >> 4];
    return i % 4 === 3 ? 255 : few[3 * (16 * row + column) + (i % 4)]!;
  });
}

const detailOf = (kind: string): Detail => {
  const alike = places.filter((place) => place.kind === kind);
  return (...known) => detailed(...known, alike);
};

const cases = {
  lamps: { own: stored.own_lamps as readonly Lamp[], tilt: null },
  no_lamps: { own: [], tilt: null },
  upright: { own: stored.own_lamps as readonly Lamp[], tilt: stored.tilt as Tilt },
  indoor: { own: stored.own_lamps as readonly Lamp[], tilt: stored.tilt as Tilt },
  outdoor: { own: [], tilt: null },
};

function scene(
  name: keyof typeof cases,
  photo = placed,
  tilt: Tilt | null = cases[name].tilt,
  kind: string = name,
) {
  const detail = kind.endsWith("door") ? detailOf(kind) : undefined;
  return sceneLight(floats(stored[name].ball), photo, rows, cases[name].own, tilt, detail);
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

describe.each(["lamps", "no_lamps", "upright", "indoor", "outdoor"] as const)(
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
      expect(got.detailOf).toBe(
        want.elsewhere.detail_of ?? (cases[name].tilt && SCENE_FILE.itself),
      );
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

    test.skipIf(want.lamps.length === 0)("has Python's main light: its first lamp", () => {
      const got = scene(name);
      const { direction, irradiance, share, remainder } = Light.of(got, null, got.lamps).mainLight;
      const main = want.main_light;
      expect(largestError(direction, floats(main.direction))).toBeLessThan(1e-3);
      expect(largestError(irradiance, floats(main.irradiance))).toBeLessThan(2e-3);
      expect(share).toBeCloseTo(main.share, 2);
      const left = Lighting.fromRadiance(remainder).harmonics(2);
      expect(largestError(left, floats(main.remainder_harmonics))).toBeLessThan(0.02);
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

describe("made-up detail", () => {
  test.each(stored.fills as [number, string][])(
    "a chance of a room of %d is %s",
    (indoors, fill) => {
      expect(sureKind({ indoors }) ?? "photo").toBe(fill);
    },
  );

  test("is left out where a network says nothing of rooms", () => {
    expect([sureKind({}), sureKind(null)]).toEqual([null, null]);
  });

  test.each([
    ["of the other kind", "indoor", stored.tilt, "outdoor"],
    ["without a level horizon", "indoor", null, "indoor"],
    ["tilted", "outdoor", stored.tilt, "outdoor"],
    ["left out", "outdoor", null, "photo"],
  ] as const)("is another light if it is %s", (_, name, tilt, kind) => {
    const radiance = everyEighth(scene(name, placed, tilt, kind).radiance, 3);
    expect(farthest(radiance, floats(stored[name].radiance_every_8th_row))).toBeGreaterThan(0.1);
  });

  test("keeps the power of what is not seen, is brought to fewer rows", () => {
    const shown = projected(placed, 64);
    const map = new Float32Array(6 * 64 * 64)
      .fill(0.5)
      .map((value, i) => value + 0.2 * Math.sin(i));
    const { radiance, rows: fine } = detailOf("indoor")(map, 64, shown, [0, 1, 0]);
    expect(fine).toBe(128);
    const seen = enlarged(shown.seen, 64, fine, 1);
    const hidden = (whole: Float32Array) =>
      powerOf(
        whole.map((value, i) => value * (1 - seen[Math.floor(i / 3)]!)),
        fine,
      );
    const plain = enlarged(map, 64, fine);
    expect(relativeError(hidden(radiance), hidden(plain))).toBeLessThan(1e-5);
    expect(largestError(radiance, plain)).toBeGreaterThan(0.1);
    const few = sceneLight(floats(stored.lamps.ball), placed, 64, [], null, detailOf("indoor"));
    expect(few.radiance.length).toBe(6 * 64 * 64);
  });
});

test("a fine photo is averaged to two pixels a texel, a coarse one is left", () => {
  const photo = { width: 3000, height: 4000 };
  const small = reducedSize(photo, planeOf(photo, 1.15), 256);
  expect(small.height).toBeGreaterThan(190);
  expect(small.height).toBeLessThan(240);
  expect(reducedSize(size, plane, 256)).toEqual(size);
});

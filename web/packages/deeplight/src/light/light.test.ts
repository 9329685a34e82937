/** Equal to Python on the same light; each comparison has a twin that must not pass. */
import { describe, expect, test } from "vitest";
import { floats, golden, largestError, relativeError, rows } from "../../../../tests/golden.ts";
import { pixelFromRadiance, radianceFromPixel } from "./camera-response.ts";
import { rowSolidAngle } from "./equirect.ts";
import { basis, cosineKernel, irradiance } from "./harmonics.ts";
import { Lighting } from "./lighting.ts";
import { IDENTITY, type Matrix3x3, transposed, type Vector3 } from "./matrix.ts";
import {
  coverage,
  directionFromUv,
  pixelDirection,
  pixelOfDirection,
  solidAngles,
  uvFromDirection,
} from "./mirror-ball.ts";
import { relit, SPHERES } from "./spheres.ts";

const want = golden("light");
const directions = rows(want.directions) as unknown as Vector3[];
const light = Lighting.fromRadiance(floats(want.radiance));
const turn = want.turn as Matrix3x3;
const mirrored = Lighting.fromRadiance(mirroredBall(floats(want.radiance)));

describe("the mirror ball", () => {
  test("has Python's pixels and places", () => {
    expect(directions.map((d) => pixelOfDirection(d, 32))).toEqual(want.ball_pixel);
    expect(largestError(directions.flatMap(uvFromDirection), floats(want.ball_uv))).toBeLessThan(
      1e-6,
    );
    const nine = Array.from({ length: 81 }, (_, pixel) => [...pixelDirection(pixel, 9)]).flat();
    expect(largestError(nine, floats(want.pixel_directions_9))).toBeLessThan(1e-6);
  });

  test("has another mapping when an axis is flipped", () => {
    const flipped = directions.map(([x, y, z]) => pixelOfDirection([-x, y, z], 32));
    expect(flipped).not.toEqual(want.ball_pixel);
  });

  test.each(["5", "32"])("covers its pixels as Python's does, %s a side", (size) => {
    expect(largestError(coverage(Number(size)), floats(want.coverage[size]))).toBeLessThan(1e-6);
    expect(
      largestError(coverage(Number(size)).map(Math.ceil), floats(want.coverage[size])),
    ).toBeGreaterThan(0.1);
  });

  test("comes back from a direction, and sums to 4 pi", () => {
    for (const [u, v] of [
      [0.3, -0.5],
      [-0.7, 0.7],
      [0, 0.9],
    ] as const) {
      expect(largestError(uvFromDirection(directionFromUv(u, v)), [u, v])).toBeLessThan(1e-12);
    }
    expect(solidAngles(32).reduce((a, b) => a + b)).toBeCloseTo(4 * Math.PI, 3);
  });
});

test("the camera's response is Python's, and inverts", () => {
  const linear = Array.from(floats(want.linear));
  expect(largestError(linear.map(pixelFromRadiance), floats(want.pixel))).toBeLessThan(1e-6);
  expect(
    largestError(
      linear.map((x) => pixelFromRadiance(1.01 * x)),
      floats(want.pixel),
    ),
  ).toBeGreaterThan(1e-3);
  for (const x of [0.01, 0.3, 0.9])
    expect(radianceFromPixel(pixelFromRadiance(x))).toBeCloseTo(x, 6);
});

describe("harmonics", () => {
  test("have Python's values and signs up to order 6", () => {
    const values = directions.flatMap((d) => [...basis(d, 6)]);
    expect(largestError(values, floats(want.basis_6))).toBeLessThan(1e-6);
    const condonShortley = directions.flatMap(([x, y, z]) => [...basis([-x, -y, z], 6)]);
    expect(largestError(condonShortley, floats(want.basis_6))).toBeGreaterThan(0.1);
  });

  test.each([2, 6])("of a light are Python's, order %i", (order) => {
    expect(relativeError(light.harmonics(order), floats(want.harmonics[order]))).toBeLessThan(1e-5);
    expect(relativeError(mirrored.harmonics(order), floats(want.harmonics[order]))).toBeGreaterThan(
      0.01,
    );
  });

  test("give Python's irradiance, and pi under white light", () => {
    const got = directions.slice(0, 8).flatMap((n) => [...irradiance(light.harmonics(2), n)]);
    expect(relativeError(got, floats(want.irradiance))).toBeLessThan(1e-5);
    const white = Lighting.fromRadiance(new Float32Array(3072).fill(1));
    expect(irradiance(white.harmonics(4), [0.6, 0, 0.8])[1]).toBeCloseTo(Math.PI, 2);
    expect(cosineKernel(4)).toBeCloseTo(-Math.PI / 24, 12);
  });
});

describe("turned light", () => {
  test("is the area average that Python computes", () => {
    expect(relativeError(light.turned(turn).radiance(), floats(want.turned))).toBeLessThan(1e-5);
    expect(
      relativeError(light.turned(transposed(turn)).radiance(), floats(want.turned)),
    ).toBeGreaterThan(0.1);
  });

  test("has the harmonics of Python's finer way, within 2 %", () => {
    const got = light.turned(turn).harmonics(2);
    expect(relativeError(got, floats(want.turned_harmonics))).toBeLessThan(0.02);
    expect(relativeError(light.harmonics(2), floats(want.turned_harmonics))).toBeGreaterThan(0.1);
  });

  test("stays as it is when nothing turns", () => {
    const lit = coverage(32);
    const off = (radiance: Float32Array) =>
      radiance.filter((_, i) => lit[Math.floor(i / 3)]! > 0.99);
    expect(
      relativeError(off(light.turned(IDENTITY).radiance()), off(light.radiance())),
    ).toBeLessThan(1e-6);
  });
});

test("the panorama is Python's", () => {
  expect(relativeError(light.equirect(16), floats(want.equirect_16))).toBeLessThan(1e-4);
  expect(relativeError(mirrored.equirect(16), floats(want.equirect_16))).toBeGreaterThan(0.05);
});

test("the panorama holds the ball's power, but for the size of its own pixels", () => {
  const power = light
    .equirect(64)
    .reduce((sum, value, i) => sum + value * rowSolidAngle(Math.floor(i / 384), 64), 0);
  const whole = light
    .radiance()
    .reduce((sum, value, i) => sum + value * solidAngles(32)[Math.floor(i / 3)]!, 0);
  expect(Math.abs(power / whole - 1)).toBeLessThan(0.02);
});

describe("the spheres", () => {
  test.each(SPHERES)("are Python's: %s", (name) => {
    expect(relativeError(relit(name, light.radiance()), floats(want.spheres[name]))).toBeLessThan(
      2e-4,
    );
    expect(
      relativeError(relit(name, mirrored.radiance()), floats(want.spheres[name])),
    ).toBeGreaterThan(0.02);
  });

  test.each(SPHERES)("are Python's in light of 16 x 16: %s", (name) => {
    const got = relit(name, floats(want.of_16.radiance));
    const some = got.filter((_, i) => Math.floor(i / 96) % 4 === 0 && Math.floor(i / 3) % 4 === 0);
    expect(relativeError(some, floats(want.of_16.spheres[name]))).toBeLessThan(2e-4);
  });

  test("reflect their share of white light, and are clear around it", () => {
    const white = Lighting.fromRadiance(new Float32Array(3072).fill(1));
    const middle = 4 * (16 * 32 + 16);
    const pixels = white.spherePixels("mirror");
    expect(pixels[middle]).toBe(Math.round(255 * pixelFromRadiance(0.827)));
    expect([pixels[middle + 3], pixels[3]]).toEqual([255, 0]);
  });
});

test("the main light is Python's", () => {
  const { direction, irradiance, share, angularRadiusRad, remainder } = light.mainLight();
  expect(largestError(direction, floats(want.main_light.direction))).toBeLessThan(1e-4);
  expect(relativeError(irradiance, floats(want.main_light.irradiance))).toBeLessThan(1e-4);
  expect(share).toBeCloseTo(want.main_light.share, 4);
  expect(angularRadiusRad).toBeCloseTo(want.main_light.angular_radius_rad, 4);
  const left = Lighting.fromRadiance(remainder).harmonics(2);
  expect(relativeError(left, floats(want.main_light.remainder_harmonics))).toBeLessThan(1e-4);
  expect(
    largestError(mirrored.mainLight().direction, floats(want.main_light.direction)),
  ).toBeGreaterThan(0.1);
});

test("even light has no main light", () => {
  const even = Lighting.fromRadiance(new Float32Array(3072).fill(0.5)).mainLight();
  expect(even.share).toBeLessThan(1e-6);
  expect(even.colour).toEqual([1, 1, 1]);
});

test("what is no light is refused", () => {
  expect(() => new Lighting(new Float32Array(100))).toThrow(/square/);
  expect(() => new Lighting(new Float32Array(3072).fill(Number.NaN))).toThrow(/finite/);
});

function mirroredBall(ball: Float32Array): Float32Array {
  return ball.map((_, i) => {
    const [row, column, c] = [Math.floor(i / 96), Math.floor(i / 3) % 32, i % 3];
    return ball[row * 96 + (31 - column) * 3 + c]!;
  });
}

import { readFileSync } from "node:fs";
import { describe, expect, it, test } from "vitest";
import { bytes, golden, largestError } from "../../../../tests/golden.ts";
import { cameraFacts } from "./camera-facts.ts";

const file = (name: string): ArrayBuffer => {
  const content = readFileSync(new URL(`../../../../../examples/photos/${name}`, import.meta.url));
  return new Uint8Array(content).buffer;
};

interface Photo {
  readonly file: string;
  readonly width: number;
  readonly height: number;
  readonly up: number[] | null;
  readonly vertical_fov_rad: number | null;
}

const photos: Record<string, Photo> = golden("exif");
const factsOf = ({ file, width, height }: Photo) =>
  cameraFacts(bytes(file).slice().buffer, width, height);
const upIn = (content: Uint8Array) => cameraFacts(content.slice().buffer, 24, 16).up;

describe("the field of view", () => {
  test.each(Object.entries(photos))("is Python's: %s", (_, photo) => {
    const { verticalFovRad } = factsOf(photo);
    if (photo.vertical_fov_rad === null) expect(verticalFovRad).toBeUndefined();
    else expect(verticalFovRad).toBeCloseTo(photo.vertical_fov_rad, 9);
  });

  test.each(["35 mm equivalent", "sensor"])("is another one of the photo turned: %s", (name) => {
    const { width, height, ...photo } = photos[name]!;
    const { verticalFovRad } = factsOf({ ...photo, width: height, height: width });
    expect(Math.abs(verticalFovRad! - photo.vertical_fov_rad!)).toBeGreaterThan(0.1);
  });

  it("is what the simulated camera wrote", () => {
    const focal = (29 / Math.hypot(36, 24)) * Math.hypot(540, 960);
    const { verticalFovRad } = cameraFacts(file("canteen.jpg"), 540, 960);
    expect(verticalFovRad).toBeCloseTo(2 * Math.atan(960 / 2 / focal), 6);
  });

  it("is not known where there is no EXIF data", () => {
    const nothing = { verticalFovRad: undefined, up: null };
    expect(cameraFacts(file("cat.jpg"), 640, 427)).toEqual(nothing);
    expect(cameraFacts(new ArrayBuffer(0), 1, 1)).toEqual(nothing);
  });
});

describe("where up is", () => {
  test.each(Object.entries(photos))("is Python's: %s", (_, photo) => {
    const { up } = factsOf(photo);
    expect(up === null).toBe(photo.up === null);
    if (up && photo.up) expect(largestError(up, photo.up)).toBeLessThan(1e-6);
  });

  test("is elsewhere where the phone was held in another way", () => {
    const content = bytes(photos["orientation 6"]!.file);
    const x = content.findIndex((_, i) => text(content, i, 9) === "Apple iOS") + 44;
    expect(new DataView(content.buffer).getInt32(x)).toBe(2000); // 0.2 g
    new DataView(content.buffer).setInt32(x, 2500);
    const up = upIn(content);
    expect(largestError(up!, photos["orientation 6"]!.up!)).toBeGreaterThan(0.01);
    expect(Math.hypot(...up!)).toBeCloseTo(1, 9);
  });

  test("survives a file that is cut or damaged anywhere in its head", () => {
    for (const { file } of [photos["orientation 6"]!, photos.elevation!]) {
      const whole = bytes(file);
      for (let length = 0; length < 500; length++) {
        upIn(whole.subarray(0, length));
        for (const damage of [0, 0x7f, 0xff]) {
          const damaged = whole.slice();
          damaged[length] = damage;
          const up = upIn(damaged);
          expect(up === null || Math.abs(Math.hypot(...up) - 1) < 1e-9).toBe(true);
        }
      }
    }
  });
});

const text = (content: Uint8Array, at: number, length: number): string =>
  String.fromCharCode(...content.subarray(at, at + length));

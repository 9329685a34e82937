import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { focalLength35mm, verticalFovRad } from "./exif.ts";

const file = (name: string): ArrayBuffer => {
  const bytes = readFileSync(new URL(`../../../../../examples/photos/${name}`, import.meta.url));
  return new Uint8Array(bytes).buffer;
};

describe("focalLength35mm", () => {
  it("reads what the simulated camera wrote", () => {
    expect(focalLength35mm(file("canteen.jpg"))).toBe(29);
  });

  it("finds nothing where there is nothing", () => {
    expect(focalLength35mm(file("cat.jpg"))).toBeUndefined();
    expect(focalLength35mm(new ArrayBuffer(0))).toBeUndefined();
  });

  it("survives a file that is cut or damaged anywhere in its head", () => {
    const whole = new Uint8Array(file("canteen.jpg"));
    for (let length = 0; length < 300; length++) {
      focalLength35mm(whole.slice(0, length).buffer);
      const damaged = whole.slice(0, 400);
      damaged[length] = 0xff;
      focalLength35mm(damaged.buffer);
    }
  });
});

describe("verticalFovRad", () => {
  it("is that of the 35 mm equivalent, whichever side is up", () => {
    const fov = verticalFovRad(file("canteen.jpg"), 540, 960);
    expect(((fov ?? 0) * 180) / Math.PI).toBeCloseTo(66.1, 0);
    expect(verticalFovRad(file("canteen.jpg"), 960, 540)).toBeLessThan(fov ?? 0);
  });
});

import { describe, expect, it } from "vitest";
import { fitOn, focalLength, verticalFov } from "./fit.ts";

const PHONE = { width: 390, height: 844 };
const FOV = (66 * Math.PI) / 180;

describe("fitOn", () => {
  it("fills the screen where little is lost, without stretching", () => {
    const fit = fitOn(PHONE, { width: 720, height: 1280 }, 1000);
    expect(fit).toMatchObject({ width: 390, height: 844, left: 0, top: 0 });
    expect(fit.share.height).toBeCloseTo(1, 9);
    expect(fit.share.width * 720 * (844 / 1280)).toBeCloseTo(390, 9);
  });

  it("shows a picture whole that would lose too much", () => {
    const fit = fitOn(PHONE, { width: 1280, height: 720 }, 1000);
    expect(fit.share).toEqual({ width: 1, height: 1 });
    expect(fit.width / fit.height).toBeCloseTo(16 / 9, 9);
    expect(fit.top).toBeCloseTo((844 - fit.height) / 2, 9);
  });

  it("keeps the picture's perspective: what is at the box's edge is at the same angle", () => {
    for (const picture of [
      { width: 720, height: 1280 },
      { width: 1280, height: 720 },
    ]) {
      const focal = focalLength(picture.height, verticalFov(picture, FOV));
      const fit = fitOn(PHONE, picture, focal);
      const seen = 2 * Math.atan((picture.height * fit.share.height) / 2 / focal);
      expect(fit.verticalFovRad).toBeCloseTo(seen, 9);
    }
  });
});

describe("verticalFov", () => {
  it("is the long side's for an upright picture and less for a lying one", () => {
    expect(verticalFov({ width: 720, height: 1280 }, FOV)).toBeCloseTo(FOV, 12);
    const lying = verticalFov({ width: 1280, height: 720 }, FOV);
    expect(Math.tan(lying / 2)).toBeCloseTo((Math.tan(FOV / 2) * 9) / 16, 12);
  });
});

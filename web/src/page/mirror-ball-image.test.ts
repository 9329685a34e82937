import { IDENTITY, Lighting, REFLECTIVITY, transposed } from "deeplight/core";
import { describe, expect, test } from "vitest";
import { floats, golden } from "../../tests/golden.ts";
import { worldFromCamera } from "../sensors/pose.ts";
import { mirrorBall } from "./mirror-ball-image.ts";

const SIZE = 32;
const ROWS = 128;
const lighting = Lighting.fromRadiance(floats(golden("light").radiance));

/** Mean difference of pixel values over the inner disc from the light's own ball, in a mirror. */
function off(pixels: Uint8ClampedArray, of: Lighting): number {
  let [sum, count] = [0, 0];
  of.radiance().forEach((radiance, i) => {
    const [pixel, c] = [Math.floor(i / 3), i % 3];
    const [row, column] = [Math.floor(pixel / SIZE), pixel % SIZE];
    if (Math.hypot(row - 15.5, column - 15.5) > 14) return;
    const want = 255 * Math.min(REFLECTIVITY.mirror * radiance, 1) ** (1 / 2.2);
    sum += Math.abs(pixels[4 * pixel + c]! - want);
    count++;
  });
  return sum / count;
}

describe("a mirror ball in a panorama", () => {
  const panorama = { radiance: lighting.equirect(ROWS), height: ROWS, seen: new Float32Array() };

  test("shows the ball that the panorama was made of", () => {
    const pixels = mirrorBall(panorama, IDENTITY, SIZE);
    expect(off(pixels, lighting)).toBeLessThan(3);
    expect([...pixels.subarray(0, 4)]).toEqual([0, 0, 0, 0]); // a corner
  });

  test("shows what the camera sees where it is turned, and nothing else", () => {
    const pose = worldFromCamera(0.9, -0.4, 0.2);
    const pixels = mirrorBall(panorama, pose, SIZE);
    const seen = lighting.turned(transposed(pose));
    expect(off(pixels, seen)).toBeLessThan(5);
    expect(off(pixels, lighting)).toBeGreaterThan(2 * off(pixels, seen));
  });
});

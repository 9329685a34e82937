import { IDENTITY } from "deeplight/core";
import { expect, test } from "vitest";
import { worldFromCamera } from "../sensors/pose.ts";
import { SECTORS, sectorsSeen } from "./ring.ts";

const HEIGHT = 32;

/** Everything within some degrees right and left of a column was seen. */
function seenAround(column: number, columns: number) {
  const seen = new Float32Array(2 * HEIGHT * HEIGHT);
  for (let row = 0; row < HEIGHT; row++) {
    for (let k = -columns; k < columns; k++) {
      seen[row * 2 * HEIGHT + ((column + k + 2 * HEIGHT) % (2 * HEIGHT))] = 1;
    }
  }
  return { seen, height: HEIGHT, radiance: new Float32Array(6 * HEIGHT * HEIGHT) };
}

test("what lies ahead is at the top, what lies on the right is on the right", () => {
  const ahead = sectorsSeen(seenAround(HEIGHT, 3), IDENTITY);
  expect(ahead[0]).toBeGreaterThan(0.9);
  expect(ahead[SECTORS / 2]).toBe(0);
  const right = sectorsSeen(seenAround(HEIGHT * 1.5, 3), IDENTITY);
  expect(right[SECTORS / 4]).toBeGreaterThan(0.9);
});

test("it turns with the camera", () => {
  // The camera has turned to the left: what was ahead is on its right.
  const turned = sectorsSeen(seenAround(HEIGHT, 3), worldFromCamera(Math.PI / 2, 0));
  expect(turned[SECTORS / 4]).toBeGreaterThan(0.9);
  expect(turned[0]).toBe(0);
});

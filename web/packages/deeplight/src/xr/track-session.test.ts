import { describe, expect, test } from "vitest";
import { halvings } from "./camera-pixels.ts";
import { heldOf } from "./track-session.ts";

describe("an AR session's camera", () => {
  test("is held as its transform says, and sees as wide as its projection", () => {
    const turn = Math.PI / 6;
    // World from camera, column by column: turned to the left about +Y, and moved.
    const matrix = new Float32Array([
      Math.cos(turn),
      0,
      -Math.sin(turn),
      0,
      0,
      1,
      0,
      0,
      Math.sin(turn),
      0,
      Math.cos(turn),
      0,
      5,
      6,
      7,
      1,
    ]);
    const projectionMatrix = new Float32Array(16);
    projectionMatrix[5] = 1 / Math.tan(0.5);
    const { worldFromCamera: m, verticalFovRad } = heldOf({
      transform: { matrix },
      projectionMatrix,
    });
    expect(verticalFovRad).toBeCloseTo(1, 6);
    // The view, -Z of the camera, then lies to the left: negative x.
    expect([-m[2], -m[5], -m[8]]).toEqual(
      [-0.5, 0, -Math.cos(turn)].map((v) => expect.closeTo(v, 6)),
    );
  });

  test.each([
    [
      { width: 1080, height: 2280 },
      { width: 270, height: 570 },
    ],
    [
      { width: 640, height: 480 },
      { width: 640, height: 480 },
    ],
    [
      { width: 1441, height: 3 },
      { width: 361, height: 1 },
    ],
  ])("its picture of %o is halved to %o", (from, to) => {
    expect(halvings(from).at(-1)).toEqual(to);
  });
});

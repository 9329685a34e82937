/** The tilt by upright edges is Python's; each comparison with a failing twin. */
import { describe, expect, test } from "vitest";
import { bytes, golden, largestError } from "../../../../tests/golden.ts";
import { noise } from "../../../../tests/noise.ts";
import type { Tilt } from "../scene/continuation.ts";
import { planeOf } from "../scene/image-plane.ts";
import { CellMeans } from "./cell-means.ts";
import { type EdgePicture, edgeGrid, seenTilt } from "./upright-edges.ts";

const stored = golden("edges");
const size = { width: stored.width as number, height: stored.height as number };
const plane = planeOf(size, stored.vertical_fov_rad);

type Guess = "doubtful" | "sure" | "none";

function pictureOf(name: string): EdgePicture {
  return { grid: edgeGrid(size), pixels: Float32Array.from(bytes(stored.cases[name].rgb)) };
}

function seen(name: string, guess: Guess, picture = pictureOf(name)): Promise<Tilt | null> {
  const heads = guess === "none" ? null : stored.cases[name].heads[guess];
  return seenTilt(heads, plane, async () => picture);
}

const numbers = (tilt: Tilt | null) => tilt && [...tilt.up, tilt.scaleRad];

describe.each(["upright", "rolled", "without edges"])("a picture of posts, %s", (name) => {
  test.each(["doubtful", "sure", "none"] as const)(
    "has Python's tilt, guess: %s",
    async (guess) => {
      const got = numbers(await seen(name, guess));
      const want = numbers(stored.cases[name].tilts[guess]);
      if (!want) expect(got).toBeNull();
      else expect(largestError(got!, want)).toBeLessThan(1e-4);
    },
  );
});

test("by the guess alone or mirrored it is another; of a photo on its side there is none", async () => {
  const picture = pictureOf("rolled");
  const want = numbers(stored.cases.rolled.tilts.doubtful)!;
  const mirrored = picture.pixels.map((_, i) => {
    const [pixel, c] = [Math.floor(i / 3), i % 3];
    const column = pixel % size.width;
    return picture.pixels[3 * (pixel - column + size.width - 1 - column) + c]!;
  });
  const got = numbers(await seen("rolled", "doubtful", { ...picture, pixels: mirrored }))!;
  expect(got[0]).toBeCloseTo(-want[0]!, 3);
  expect(largestError(got, want)).toBeGreaterThan(0.05);
  const guess = numbers(stored.cases.rolled.tilts.sure)!;
  expect(largestError(guess, want)).toBeGreaterThan(0.05);
  const heads = { ...stored.cases.rolled.heads.doubtful, upright_0: 0, upright_90: 1 };
  expect(await seenTilt(heads, plane, async () => picture)).toBeNull();
});

test("a sure network's picture is not asked for", async () => {
  const never = () => Promise.reject(new Error("asked for"));
  await seenTilt(stored.cases.upright.heads.sure, plane, never);
  await expect(seenTilt(stored.cases.upright.heads.doubtful, plane, never)).rejects.toThrow();
});

test("edges of a large photo are looked for in whole cells, which leave a part of one out", () => {
  const photo = { width: 514, height: 1031 };
  const grid = edgeGrid(photo);
  const cells = [grid.inputWidth, grid.inputHeight, grid.right, grid.bottom];
  expect(cells).toEqual([128, 257, 512, 1028]);
  const rgba = noise(photo.width, photo.height);
  const means = new CellMeans(grid);
  means.add(rgba, 0, photo.width);
  const at = (row: number, column: number) => rgba[4 * (row * photo.width + column)]!;
  let sum = 0;
  for (let k = 0; k < 16; k++) sum += at(1024 + (k >> 2), 508 + (k & 3)) / 16;
  const last = means.rgb(false, 255).length - 3;
  expect(means.rgb(false, 255)[last]).toBeCloseTo(sum, 3);
  expect(edgeGrid({ width: 32, height: 20000 }).inputWidth).toBe(1);
});

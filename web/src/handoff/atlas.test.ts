import { describe, expect, test } from "vitest";
import { type Atlas, atlasFor, coordinates, cornersOf, painted } from "./atlas.ts";

/** As viewers look a texture up: between the middles of four pixels. */
function lookedUp({ size }: Atlas, pixels: Uint8ClampedArray, u: number, v: number): number[] {
  const [x, y] = [u * size - 0.5, v * size - 0.5];
  const [left, top] = [Math.floor(x), Math.floor(y)];
  return [0, 1, 2].map((channel) => {
    const at = (column: number, row: number): number => {
      const inside = (i: number) => Math.min(Math.max(i, 0), size - 1);
      return pixels[4 * (inside(row) * size + inside(column)) + channel]!;
    };
    const [s, t] = [x - left, y - top];
    const above = (1 - s) * at(left, top) + s * at(left + 1, top);
    return (1 - t) * above + t * ((1 - s) * at(left, top + 1) + s * at(left + 1, top + 1));
  });
}

const TRIANGLES = 23;
/** Each corner of each triangle has a colour that no other has. */
const colourOf = (triangle: number, corner: number) =>
  [0, 1, 2].map((c) => 0.5 + 0.4 * Math.sin(7 * triangle + 3 * corner + 5 * c));
const between = (weights: readonly number[], values: readonly (readonly number[])[]) =>
  values[0]!.map((_, i) => weights.reduce((sum, w, k) => sum + w * values[k]![i]!, 0));

describe.each([4, 5, 8, 31])("in squares of %i pixels", (square) => {
  const atlas = atlasFor(TRIANGLES, square)!;
  const colours = (triangle: number) => [0, 1, 2].map((corner) => colourOf(triangle, corner));
  const pixels = painted(atlas, (triangle, second, third) =>
    between([1 - second - third, second, third], colours(triangle)),
  );
  const uv = coordinates(atlas);

  /** Largest difference, in steps of 255, of what a viewer shows all over the triangles. */
  function off(shift: number): number {
    let most = 0;
    for (let triangle = 0; triangle < TRIANGLES; triangle++) {
      const places = [0, 1, 2].map((k) =>
        [...uv.slice(6 * triangle + 2 * k, 6 * triangle + 2 * k + 2)].map((x) => x + shift),
      );
      for (let i = 0; i <= 6; i++) {
        for (let k = 0; i + k <= 6; k++) {
          const weights = [1 - (i + k) / 6, i / 6, k / 6];
          const [u, v] = between(weights, places) as [number, number];
          const want = between(weights, colours(triangle));
          const got = lookedUp(atlas, pixels, u, v);
          most = Math.max(most, ...got.map((value, c) => Math.abs(value - 255 * want[c]!)));
        }
      }
    }
    return most;
  }

  test("what is linear on a triangle is so when it is looked up, and not a pixel away", () => {
    expect(off(0)).toBeLessThan(1);
    expect(off(1 / atlas.size)).toBeGreaterThan(10);
  });

  test("no two triangles share a corner's pixel", () => {
    const all = Array.from({ length: TRIANGLES }, (_, i) => cornersOf(atlas, i)).flat();
    expect(new Set(all.map(String)).size).toBe(3 * TRIANGLES);
    expect(Math.max(...all.flat())).toBeLessThan(atlas.size);
  });
});

test("many triangles get smaller squares, too many none", () => {
  expect(atlasFor(2 * 300 ** 2, 128)!.square).toBe(6);
  expect(atlasFor(2 * 512 ** 2, 8)!.size).toBe(2048);
  expect(atlasFor(2 * 512 ** 2 + 1, 8)).toBeNull();
});

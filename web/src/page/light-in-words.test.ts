import { Lighting, pixelOfDirection } from "deeplight/core";
import { describe, expect, it } from "vitest";
import { inWords, unsureOf } from "./light-in-words.ts";

function lampAt(x: number, y: number, z: number): Lighting {
  const log = new Float32Array(32 * 32 * 3);
  log.fill(6, 3 * pixelOfDirection([x, y, z], 32), 3 * pixelOfDirection([x, y, z], 32) + 3);
  return new Lighting(log);
}

describe("inWords", () => {
  it.each([
    [[0.8, 0.6, 0], /from the right, 3\d degrees up/],
    [[-0.8, 0.6, 0], /from the left/],
    [[0, 0.6, 0.8], /from behind,/],
    [[0.57, 0.6, -0.57], /from ahead on the right/],
    [[0, 1, 0], /from above/],
    [[0.8, -0.6, 0], /degrees down/],
  ] as const)("names where %j is", ([x, y, z], words) => {
    expect(inWords(lampAt(x, y, z).mainLight())).toMatch(words);
  });

  it("says when no light stands out", () => {
    expect(inWords(new Lighting(new Float32Array(32 * 32 * 3)).mainLight())).toMatch(/evenly/);
  });
});

describe("what is not known", () => {
  const known = "roughly known";
  const sure = { directionDeg: 0, brightnessStops: 0, colourDeg: 0, hasDirection: true };

  it("is said by its name, or nothing is", () => {
    const words = { direction: known, brightness: known, colour: known } as const;
    expect(unsureOf({ ...sure, words, warnings: [] })).toBe("");
    const vague = { ...words, direction: "not known", brightness: "not known" } as const;
    expect(unsureOf({ ...sure, words: vague, warnings: [] })).toBe("Unsure: direction, brightness");
  });

  it("is the photo's own fault first", () => {
    const words = { direction: "not known", brightness: known, colour: known } as const;
    const warnings = ["the photo is almost black: its light is a guess"];
    expect(unsureOf({ ...sure, words, warnings })).toBe(
      "The photo is almost black: its light is a guess.",
    );
  });
});

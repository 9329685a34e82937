/** The library of made-up detail in the form that the page reads. */
import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { libraryFile } from "../build/detail-library.ts";

test("all places are in the file, their words, maps and pictures", () => {
  const npz = new URL("../../src/deeplight/weights/detail.npz", import.meta.url);
  const file = Buffer.from(libraryFile(readFileSync(npz)));
  const start = 4 + file.readUInt32LE(0);
  const { names, kinds, sizes } = JSON.parse(file.toString("utf8", 4, start));
  expect(new Set(names).size).toBe(40);
  expect(new Set(kinds)).toEqual(new Set(["indoor", "outdoor"]));
  let at = start + 40 * 16 * 32 * 3 * 2;
  for (const size of sizes) {
    expect(file.readUInt16BE(at)).toBe(0xffd8); // a JPEG begins
    at += size;
    expect(file.readUInt16BE(at - 2)).toBe(0xffd9); // and ends
  }
  expect(at).toBe(file.length);
});

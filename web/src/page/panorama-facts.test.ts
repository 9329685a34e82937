import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { expect, test } from "vitest";
import { withPanoramaFacts } from "./panorama-facts.ts";

const PHOTO = fileURLToPath(new URL("../../../examples/photos/coffee.jpg", import.meta.url));

test("a JPEG of all around says so, and is the same picture", () => {
  const before = Uint8Array.from(readFileSync(PHOTO));
  const after = withPanoramaFacts(before, { width: 512, height: 256 });
  const length = (after[4]! << 8) | after[5]!;
  const text = new TextDecoder("latin1").decode(after.subarray(6, 4 + length));
  expect([...after.subarray(0, 4)]).toEqual([0xff, 0xd8, 0xff, 0xe1]);
  expect(text).toMatch(/^http:\/\/ns.adobe.com\/xap\/1.0\/\0<x:xmpmeta/);
  expect(text).toContain('GPano:ProjectionType="equirectangular"');
  expect(text).toContain('GPano:FullPanoWidthPixels="512"');
  expect(text.endsWith("</x:xmpmeta>")).toBe(true);
  expect(Buffer.compare(after.subarray(4 + length), before.subarray(2))).toBe(0);
});

test("what is no JPEG stays as it is", () => {
  const png = Uint8Array.from([0x89, 0x50, 0x4e, 0x47]);
  expect(withPanoramaFacts(png, { width: 2, height: 1 })).toBe(png);
});

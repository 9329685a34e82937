import { expect, test } from "vitest";
import { taken } from "./source.ts";

test.each([
  ["photo.jpg", "a string"],
  [null, "null"],
  [undefined, "undefined"],
])("%s is no picture, and the error says what is", async (source, got) => {
  const error = taken(source as never);
  await expect(error).rejects.toThrow(TypeError);
  await expect(error).rejects.toThrow(got);
});

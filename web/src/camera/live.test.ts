import { expect, test } from "vitest";
import { finestSize } from "./live.ts";

const offers = (width: number, height: number) => ({
  width: { max: width },
  height: { max: height },
});

test("a finer size has the film's own shape", () => {
  expect(finestSize(offers(4000, 3000), { width: 1280, height: 720 })).toEqual({
    width: 4000,
    height: 2250,
  });
});

test("an upright phone's camera counts its long side as the width", () => {
  expect(finestSize(offers(3840, 2160), { width: 720, height: 1280 })).toEqual({
    width: 3840,
    height: 2160,
  });
});

test("nothing is changed where nothing is gained or known", () => {
  expect(finestSize(offers(1280, 720), { width: 1280, height: 720 })).toBeNull();
  expect(finestSize(undefined, { width: 1280, height: 720 })).toBeNull();
});

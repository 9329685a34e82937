import { describe, expect, test } from "vitest";
import { movedClear, type ScreenBox } from "./clearance.ts";

const box = (left: number, top: number, right: number, bottom: number): ScreenBox => ({
  left,
  top,
  right,
  bottom,
});
const VIEW = box(0, 0, 400, 800);
const OBJECT = box(150, 450, 250, 600);

const covers = (a: ScreenBox, b: ScreenBox): boolean =>
  a.left < b.right && a.right > b.left && a.top < b.bottom && a.bottom > b.top;

describe("a panel over the object", () => {
  test.each([
    ["along the lower edge", box(10, 500, 390, 780), "up"],
    ["along the right edge", box(220, 0, 390, 800), "left"],
    ["in a corner", box(200, 560, 390, 790), "up"],
  ])("%s moves the view %s, just as far as it must", (_, panel, way) => {
    expect(covers(OBJECT, panel)).toBe(true);
    const [left, up] = movedClear(OBJECT, panel, VIEW);
    expect([left > 0, up > 0]).toEqual([way === "left", way === "up"]);
    const by = (more: number): ScreenBox => {
      const [x, y] = [left && left - more, up && up - more];
      return box(OBJECT.left - x, OBJECT.top - y, OBJECT.right - x, OBJECT.bottom - y);
    };
    expect(covers(by(0), panel)).toBe(false);
    expect(covers(by(20), panel)).toBe(true);
  });

  test.each([
    ["below it", box(10, 700, 390, 780)],
    ["next to it", box(300, 0, 390, 800)],
    ["to its left", box(0, 0, 100, 800)],
    ["above it", box(0, 0, 400, 300)],
  ])("%s moves nothing", (_, panel) => {
    expect(movedClear(OBJECT, panel, VIEW)).toEqual([0, 0]);
  });

  test("moves the view by no more than a part of it", () => {
    const large = box(10, 450, 390, 600);
    expect(movedClear(large, box(0, 300, 400, 800), VIEW)).toEqual([0, 240]);
  });
});

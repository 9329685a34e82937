import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import type { Matrix3x3 } from "../light/matrix.ts";
import { pixelDirection } from "../light/mirror-ball.ts";
import { overlapOf, placesOf } from "./gains.ts";
import { expectedPower, likelyFactor } from "./merge.ts";
import { Session } from "./session.ts";
import { cellsOf, type SmallPicture, smallSize } from "./view.ts";

/** What tests/golden/make_fuse.py made with Python; frames and estimates are its formulas. */
const stored = JSON.parse(
  readFileSync(new URL("../../../../../tests/golden/fuse.json", import.meta.url), "utf8"),
);
const [HEIGHT, WIDTH] = [96, 54];
/** Estimates that frames get in turn, so that what is believed moves up and down. */
const STEADY_ESTIMATES = stored.steady_estimates as number[];

function frame(number: number, brighter = 0): SmallPicture {
  const [yaw, pitch] = stored.poses[number] as number[];
  const pixels = new Uint8Array(3 * HEIGHT * WIDTH);
  for (let i = 0; i < pixels.length; i++) {
    const [row, column] = [Math.floor(i / 3 / WIDTH), Math.floor(i / 3) % WIDTH];
    const across = (column - 27) / 48 - yaw!;
    const down = (row - 48) / 72 - pitch!;
    const wave = Math.sin(3 * across) + Math.cos(3 * down);
    const value = 135 + 40 * wave + 12 * number * [1, 0.5, 0][i % 3]! + (i % 3) * 9 + brighter;
    pixels[i] = Math.floor(Math.min(Math.max(value, 0), 255));
  }
  return { pixels, width: WIDTH, height: HEIGHT, verticalFovRad: stored.vertical_fov_rad };
}

function estimate(number: number): Float32Array {
  return Float32Array.from({ length: 3 * 32 * 32 }, (_, i) => {
    const [x, y, z] = pixelDirection(Math.floor(i / 3), 32);
    const lamp = Math.exp(30 * (0.8 * x + 0.36 * y + 0.48 * z - 1));
    return -1 + 0.4 * y + 0.1 * number + lamp * [2, 1.8, 1.5][i % 3]!;
  });
}

function pose(number: number): Matrix3x3 {
  const [yaw, pitch, roll] = stored.poses[number] as [number, number, number];
  const [cy, sy, cp, sp, cr, sr] = [yaw, pitch, roll].flatMap((a) => [Math.cos(a), Math.sin(a)]);
  // Yaw about y, after pitch about x, after roll about z.
  return [
    cy! * cr! + sy! * sp! * sr!,
    -cy! * sr! + sy! * sp! * cr!,
    sy! * cp!,
    cp! * sr!,
    cp! * cr!,
    -sp!,
    -sy! * cr! + cy! * sp! * sr!,
    sy! * sr! + cy! * sp! * cr!,
    cy! * cp!,
  ];
}

function session(changed?: number) {
  const made = new Session();
  const added = [0, 1, 2, 3].map((k) => {
    const own = frame(k);
    const pixels = k === changed ? own.pixels.map((value) => Math.min(value, 150)) : own.pixels;
    return made.add({ ...own, pixels }, pose(k), estimate(k));
  });
  return { made, added };
}

function far(got: ArrayLike<number>, want: ArrayLike<number>): number {
  if (got.length !== want.length) return Number.POSITIVE_INFINITY;
  return Array.from(got).reduce((most, value, i) => {
    return Math.max(most, Math.abs(value - want[i]!) / Math.max(1, Math.abs(want[i]!)));
  }, 0);
}

test("the frames are Python's", () => {
  const { pixels } = frame(1);
  const row = pixels.subarray(48 * 3 * WIDTH, 49 * 3 * WIDTH);
  expect(Array.from(row)).toEqual(stored.pixels_of_frame_1_row_48.flat());
});

test("a session is Python's, step by step", () => {
  const { made, added } = session();
  added.forEach((step, k) => {
    const want = stored.steps[k];
    expect(step.views).toBe(want.views);
    expect(step.disagreement).toBeCloseTo(want.disagreement, 4);
    expect(far(step.logGain, want.log_gain)).toBeLessThan(2e-4);
    expect(step.forgotten).toBe(false);
  });
  expect(far(made.gains, stored.gains.flat())).toBeLessThan(2e-4);
  expect(far(expectedPower(made.views, made.gains), stored.expected_power)).toBeLessThan(2e-4);
});

test("what views share is Python's", () => {
  const { made } = session();
  const [first, second] = made.views.slice(0, 2).map(cellsOf) as [never, never];
  const shared = overlapOf(second, placesOf(second), first);
  const want = stored.overlap_of_frames_1_and_0;
  expect(far(shared.difference, want.difference)).toBeLessThan(2e-4);
  expect(far(shared.weight, want.weight)).toBeLessThan(2e-4);
  const cells = cellsOf(made.views[0]!);
  const places = placesOf(cells);
  for (const { cell, log, weight } of stored.cells_of_frame_0) {
    const at = 3 * places[cell]!;
    expect(far(cells.log.subarray(at, at + 3), log)).toBeLessThan(2e-4);
    expect(far(cells.weight.subarray(at, at + 3), weight)).toBeLessThan(1e-6);
  }
});

test("the light is Python's, and with another frame it is not", () => {
  const { radiance, seen } = session().made.environment(16);
  expect(far(radiance, stored.environment.flat(2))).toBeLessThan(2e-3);
  expect(far(seen, stored.seen.flat())).toBeLessThan(2e-3);
  const other = session(2).made.environment(16);
  expect(far(other.radiance, stored.environment.flat(2))).toBeGreaterThan(2e-3);
});

test("a light shown while one turns is as steady as Python's, and another is not", () => {
  const made = new Session();
  const steps = [0, 1, 2, 3].map((k) => {
    const { logGain } = made.add(frame(k), pose(k), estimate(STEADY_ESTIMATES[k]!));
    return [true, false].map((steady) => {
      return made.environment(8, pose(k), logGain, steady).radiance;
    });
  });
  const ofPython = stored.steady_environments.map((light: number[][][]) => light.flat(2));
  for (const [k, [steady]] of steps.entries()) {
    expect(far(steady!, ofPython[k])).toBeLessThan(2e-3);
  }
  expect(Math.max(...steps.map(([, own], k) => far(own!, ofPython[k])))).toBeGreaterThan(2e-2);
});

test("what clips is as bright as in Python, and less is not", () => {
  const [bright, less] = [70, 60].map((brighter) => {
    const made = new Session();
    for (let k = 0; k < 4; k++) made.add(frame(k, brighter), pose(k), estimate(k));
    return made.environment(16).radiance;
  });
  expect(far(bright!, stored.environment_that_clips.flat(2))).toBeLessThan(2e-3);
  expect(far(less!, stored.environment_that_clips.flat(2))).toBeGreaterThan(2e-3);
  for (const [bound, rest, whole, usual, factor] of stored.likely_factors) {
    expect(likelyFactor(bound, rest, whole, usual)).toBeCloseTo(factor, 4);
  }
});

/** Blocks of greys, or as little as gets through a hand before the lens. */
function otherPlace(number: number): SmallPicture {
  const pixels = Uint8Array.from({ length: 3 * HEIGHT * WIDTH }, (_, i) => {
    const [row, column] = [Math.floor(i / 3 / WIDTH) >> 3, (Math.floor(i / 3) % WIDTH) >> 3];
    const mixed = row * 7 + column * 13 + row * column * number;
    const value = 20 + 20 * (((mixed % 11) + 11) % 11);
    return number >= 0 ? value : Math.floor(value / 40);
  });
  return { ...frame(0), pixels };
}

test("a covered lens and another place are answered as Python answers them", () => {
  const made = new Session();
  for (const [number, turn, want] of stored.changes) {
    const step = made.add(otherPlace(number), pose(turn), estimate(0));
    expect(step.disagreement).toBeCloseTo(want.disagreement, 4);
    expect([step.views, step.forgotten]).toEqual([want.views, want.forgotten]);
  }
});

test("however slowly one turns, the views kept are Python's", () => {
  const made = new Session();
  for (let k = 0; k < 50; k++) {
    const [c, s] = [Math.cos(0.02 * k), Math.sin(0.02 * k)];
    made.add(frame(0), [c, 0, s, 0, 1, 0, -s, 0, c], estimate(0));
  }
  const numbers = made.views.map(({ number }) => number);
  expect(numbers).toEqual(stored.kept_of_a_slow_turn);
  expect(numbers.length).toBeGreaterThan(5);
});

test("memory stays constant, and the first view stays", () => {
  const made = new Session(5);
  for (let k = 0; k < 12; k++) {
    const turn = 0.5 * k;
    const [c, s] = [Math.cos(turn), Math.sin(turn)];
    made.add(frame(0), [c, 0, s, 0, 1, 0, -s, 0, c], estimate(0));
  }
  expect(made.views.length).toBe(5);
  expect(made.views[0]!.number).toBe(0);
  made.reset();
  expect(() => made.environment(16)).toThrow(/add one first/);
});

test("what is no rotation is refused", () => {
  expect(() => new Session().add(frame(0), [2, 0, 0, 0, 1, 0, 0, 0, 1], estimate(0))).toThrow(
    /a rotation/,
  );
});

test("a picture is kept as small as Python keeps it", () => {
  expect(smallSize(1280, 720, (66 * Math.PI) / 180)).toEqual({ height: 192, width: 108 });
  expect(smallSize(100, 60, 1.15)).toEqual({ height: 100, width: 60 });
});

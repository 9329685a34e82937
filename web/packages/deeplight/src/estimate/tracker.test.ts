/** A place that is lost, a lens that is covered, a light that is switched: when the page begins anew. */
import { expect, test } from "vitest";
import { held, picture } from "../../../../tests/made-up-sky.ts";
import { CONTRACT } from "../contract/generated.ts";
import type { SmallPicture } from "../fuse/view.ts";
import { angleBetween, type Matrix3x3 } from "../light/matrix.ts";
import type { Network } from "../network/network.ts";
import type { CellMeans } from "./cell-means.ts";
import type { Frame, Picker } from "./picker.ts";
import { Tracker } from "./tracker.ts";

const DEGREES = 180 / Math.PI;
const START = held(0, 0, 0);
/** Blocks of many greys: no part of one place looks like a part of another. */
const blocks = (place: number) => (x: number, y: number, z: number) => {
  const cells = [x, y, z].map((value) => Math.floor(7 * value));
  const mixed = 43758.5 * Math.sin(12.9 * cells[0]! + 78.2 * cells[1]! + 37.7 * cells[2]! + place);
  return 0.15 + 0.7 * (mixed - Math.floor(mixed));
};
const [here, elsewhere] = [blocks(0), blocks(1)];
const at = (yawDeg: number) => held(yawDeg / DEGREES, 0, 0);

const size = CONTRACT.output_size;
const network = {
  contract: CONTRACT,
  estimate: () => ({ logRadiance: new Float32Array(3 * size * size).fill(-1), others: new Map() }),
} as unknown as Network;

/** Gives a made-up picture to whoever asks for its pixels. */
async function shown(tracker: Tracker, of: SmallPicture, pose: Matrix3x3 | null = null) {
  const { pixels, width, height } = of;
  const rgba = Uint8Array.from({ length: 4 * width * height }, (_, i) =>
    i % 4 === 3 ? 255 : pixels[3 * (i >> 2) + (i % 4)]!,
  );
  const pick = async (_: Frame, ...means: CellMeans[]) => {
    for (const one of means) {
      const first = 4 * (one.top * width + one.left);
      one.add(rgba.subarray(first, 4 * (one.top + one.height) * width), one.top, width);
    }
    return false;
  };
  const frame = { width, height, close: () => {} } as unknown as Frame;
  const request = { worldFromCamera: pose, start: START, rows: 16, evenIfSame: false };
  const picker = { pick } as unknown as Picker;
  return tracker.next(Promise.resolve(network), picker, frame, of.verticalFovRad, request);
}

/** After a look around, from 0 to 60 degrees. */
async function lookedAround(sensed: boolean): Promise<Tracker> {
  const tracker = new Tracker();
  for (let yaw = 0; yaw <= 60; yaw += 4) {
    const { worldFromCamera } = await shown(
      tracker,
      picture(at(yaw), 1, here),
      sensed ? at(yaw) : null,
    );
    expect(angleBetween(worldFromCamera!, at(yaw)) * DEGREES).toBeLessThan(2);
  }
  return tracker;
}

const dark = (seed: number): SmallPicture => {
  const own = picture(START);
  return { ...own, pixels: own.pixels.map((_, i) => (i * 7 + seed) % 5) };
};

test.each([true, false])("a covered lens is no other place; with sensors: %s", async (sensed) => {
  const tracker = await lookedAround(sensed);
  for (let k = 0; k < 20; k++) {
    const { isNew } = await shown(tracker, dark(k), sensed ? at(60) : null);
    expect(isNew).toBe(false);
  }
  const after = await shown(tracker, picture(at(58), 1, here), sensed ? at(58) : null);
  expect(after.isNew).toBe(false);
  expect(after.added!.views).toBeGreaterThan(5);
  expect(angleBetween(after.worldFromCamera!, at(58)) * DEGREES).toBeLessThan(2);
});

test("after a jump the place is found again where it is known", async () => {
  const tracker = await lookedAround(false);
  const after = [];
  for (let k = 0; k < 12; k++) after.push(await shown(tracker, picture(at(3), 1, here)));
  expect(after.some(({ isNew }) => isNew)).toBe(false);
  expect(angleBetween(after.at(-1)!.worldFromCamera!, at(3)) * DEGREES).toBeLessThan(2);
});

test.each([true, false])("another place begins anew; with sensors: %s", async (sensed) => {
  const tracker = await lookedAround(sensed);
  const steps = [];
  for (let k = 0; k < 12; k++) {
    const pose = at(60 + k);
    steps.push(await shown(tracker, picture(pose, 1, elsewhere), sensed ? pose : null));
  }
  expect(steps.filter(({ isNew }) => isNew).length).toBe(1);
  expect(steps.at(-1)!.added!.views).toBeLessThan(8);
});

test("a light switched before a camera that stands still is seen, as in Python", async () => {
  const tracker = await lookedAround(true);
  const lit = (x: number, y: number, z: number) => 1 - here(x, y, z);
  const steps = [];
  for (let k = 0; k < 3; k++) steps.push(await shown(tracker, picture(at(60), 1, lit), at(60)));
  expect(steps.map(({ isNew }) => isNew)).toEqual([false, false, true]);
});

import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { expect, test } from "vitest";
import { Session } from "../fuse/session.ts";
import { VisualRotation } from "../fuse/visual-rotation.ts";
import { IDENTITY, type Matrix3x3 } from "../light/matrix.ts";
import { npzArrays } from "./npz.ts";
import { sessionFile, sessionOf } from "./session-file.ts";

const [HEIGHT, WIDTH] = [96, 54];

function turned(yaw: number): Matrix3x3 {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  return [c, 0, s, 0, 1, 0, -s, 0, c];
}

/** What a camera that is turned by `yaw` sees of a world of waves. */
function picture(yaw: number) {
  const half = Math.tan(0.575);
  const pixels = Uint8Array.from({ length: 3 * HEIGHT * WIDTH }, (_, i) => {
    const [row, column] = [Math.floor(i / 3 / WIDTH), Math.floor(i / 3) % WIDTH];
    const right = (((column + 0.5) / WIDTH) * 2 - 1) * half * (WIDTH / HEIGHT);
    const up = (1 - ((row + 0.5) / HEIGHT) * 2) * half;
    const across = Math.atan(right) - yaw;
    const wave =
      Math.sin(9 * across + 4 * across * across) +
      Math.sin(23 * across + 5 * up) +
      Math.cos(13 * up);
    return 120 + 30 * wave + 5 * (i % 3);
  });
  return { pixels, width: WIDTH, height: HEIGHT, verticalFovRad: 1.15 };
}

const estimate = (k: number) => new Float32Array(3 * 32 * 32).fill(-1 + 0.1 * k);
const YAWS = [0, 0.3, 0.6];

function seen(): Session {
  const session = new Session();
  YAWS.forEach((yaw, k) => {
    session.add(picture(yaw), turned(yaw), estimate(k));
  });
  return session;
}

test("what was saved goes on as if it had not been", () => {
  const [before, after] = [seen(), sessionOf(sessionFile(seen()))];
  expect(after.environment(64).radiance).toEqual(before.environment(64).radiance);
  const next = [picture(0.9), turned(0.9), estimate(3)] as const;
  expect(after.add(...next)).toEqual(before.add(...next));
  expect(after.gains).toEqual(before.gains);
  after.add({ ...picture(0.9), pixels: new Uint8Array(3 * HEIGHT * WIDTH) }, IDENTITY, estimate(9));
  expect(after.environment(64).radiance).not.toEqual(before.environment(64).radiance);
});

test("the same bytes each time, of which any other is refused", () => {
  const file = sessionFile(seen());
  expect(sessionFile(seen())).toEqual(file);
  expect(npzArrays(file).get("rotations")!.shape).toEqual([3, 3, 3]);
  for (const at of [60, 5000, 30_000]) {
    const damaged = file.slice();
    damaged[at]! ^= 64;
    expect(() => sessionOf(damaged)).toThrow(RangeError);
  }
  expect(() => sessionOf(file.slice(0, -30))).toThrow("expected an .npz file");
  expect(() => sessionFile(new Session())).toThrow("add one first");
});

test("among pictures that are known, one is found wherever it looks", () => {
  const visual = new VisualRotation();
  visual.goOn(seen().views);
  const pose = visual.next(picture(0.55))!;
  expect(Math.atan2(pose[2], pose[0])).toBeCloseTo(0.55, 1);
  visual.goOn(seen().views);
  const other = { ...picture(0), pixels: picture(0).pixels.map((_, i) => (i * 7919) % 251) };
  expect(visual.next(other)).toBeNull();
});

test("one is left for Python where it asks for it, and Python's own is read", () => {
  const folder = process.env.DEEPLIGHT_WEB_FILES;
  const file = sessionFile(seen());
  expect(file.length).toBeGreaterThan(40_000);
  if (folder === undefined) return;
  writeFileSync(`${folder}/web.npz`, file);
  const light = seen().environment(64).radiance;
  writeFileSync(
    `${folder}/web.f32`,
    new Uint8Array(light.buffer, light.byteOffset, light.byteLength),
  );
  expect(existsSync(`${folder}/python.npz`)).toBe(true);
  const session = sessionOf(new Uint8Array(readFileSync(`${folder}/python.npz`)));
  expect(session.views.map(({ number }) => number)).toEqual([0, 1]);
  expect(session.environment(32).radiance.every(Number.isFinite)).toBe(true);
});

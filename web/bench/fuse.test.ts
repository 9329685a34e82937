/** Processor time of what fusing adds to the network: npm run bench --prefix web. */
import { test } from "vitest";
import { Session } from "../packages/deeplight/src/fuse/session.ts";
import type { SmallPicture } from "../packages/deeplight/src/fuse/view.ts";
import { rotationOf, VisualRotation } from "../packages/deeplight/src/fuse/visual-rotation.ts";
import { IDENTITY } from "../packages/deeplight/src/light/matrix.ts";
import { Light } from "../packages/deeplight/src/light.ts";
import { noise } from "../tests/noise.ts";

const [WIDTH, HEIGHT] = [108, 192]; // what is kept of a frame of 720 x 1280
const FRAMES = 72;

function picture(shift: number): SmallPicture {
  const rgba = noise(WIDTH + FRAMES, HEIGHT);
  const pixels = new Uint8Array(3 * WIDTH * HEIGHT);
  for (let i = 0; i < pixels.length; i++) {
    const [row, column] = [Math.floor(i / 3 / WIDTH), Math.floor(i / 3) % WIDTH];
    pixels[i] = rgba[4 * (row * (WIDTH + FRAMES) + column + shift) + (i % 3)]!;
  }
  return { pixels, width: WIDTH, height: HEIGHT, verticalFovRad: 1.15 };
}

/** Milliseconds of processor time. */
function timed(act: () => void): number {
  const before = process.cpuUsage();
  act();
  const { user, system } = process.cpuUsage(before);
  return (user + system) / 1000;
}

const median = (values: number[]): string =>
  values.sort((a, b) => a - b)[values.length >> 1]!.toFixed(1);

test("says what each part of a session costs", () => {
  const session = new Session();
  const visual = new VisualRotation();
  const estimate = new Float32Array(3 * 32 * 32).fill(-0.5);
  const pictures = Array.from({ length: FRAMES }, (_, k) => picture(k));
  const [added, lit, turned, balls]: number[][] = [[], [], [], []];
  pictures.forEach((small, k) => {
    const pose = rotationOf([k % 2 ? 0.3 : -0.2, (k * 2 * Math.PI) / 36, 0]);
    added!.push(timed(() => session.add(small, pose, estimate)));
    turned!.push(timed(() => visual.next(small)));
  });
  for (let k = 0; k < 9; k++) {
    // As a film asks for it: with a new view since the last time, in the world's frame.
    session.add(picture(k), rotationOf([0.05, 0.01 * k, 0]), estimate);
    lit!.push(timed(() => session.environment(128, IDENTITY)));
    const light = session.environment(128, IDENTITY);
    balls!.push(timed(() => Light.of(light, null)));
  }
  console.log(`${session.views.length} views; processor time, median, ms`);
  console.log(`  a frame into the session      ${median(added!)}`);
  console.log(`  how the phone turned          ${median(turned!)}`);
  console.log(`  the light of all, 128 rows    ${median(lit!)}`);
  console.log(`  its ball, on the page's side  ${median(balls!)}`);
});

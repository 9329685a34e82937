/** The shaders of transfer against the pictures that Python made of the same file. */
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { build, defaultClientConditions } from "vite";
import { afterAll, beforeAll, expect, test } from "vitest";
import type { Shot } from "../tests/browser/transfer.ts";
import { floats, golden } from "../tests/golden.ts";
import { launch } from "./browser.ts";

const stored = golden("transfer");
const NEAR = 2.5; // of 255: eight bits, and Python's ray through each pixel's middle
let browser: Browser;
let page: Page;

beforeAll(async () => {
  const entry = fileURLToPath(new URL("../tests/browser/transfer.ts", import.meta.url));
  const lib = { entry, formats: ["es" as const], fileName: "transfer" };
  const built = await build({
    configFile: false,
    logLevel: "error",
    resolve: { conditions: ["deeplight-source", ...defaultClientConditions] },
    build: { lib, write: false },
  });
  const chunk = (Array.isArray(built) ? built : [built]).flatMap((one) =>
    "output" in one ? one.output : [],
  )[0]!;
  browser = await launch();
  page = await browser.newPage();
  if (chunk.type === "chunk") await page.addScriptTag({ type: "module", content: chunk.code });
  await page.waitForFunction(() => "drawTransfer" in globalThis);
});

afterAll(() => browser?.close());

function drawn(show: Shot["show"], light = floats(stored.light)): Promise<number[]> {
  const { file, eye, size, backdrop } = stored;
  const shot: Shot = { file, light: Array.from(light), show, eye, size, backdrop };
  return page.evaluate((what) => {
    return (globalThis as unknown as { drawTransfer: (shot: Shot) => number[] }).drawTransfer(what);
  }, shot);
}

/** Differences from Python where `counts` says so, from least to greatest. */
function differences(
  rgba: number[],
  want: Float32Array,
  counts: (pixel: number) => boolean,
): number[] {
  const found: number[] = [];
  for (let pixel = 0; pixel < rgba.length / 4; pixel++) {
    if (!counts(pixel)) continue;
    for (let c = 0; c < 3; c++) found.push(Math.abs(rgba[4 * pixel + c]! - want[3 * pixel + c]!));
  }
  return found.sort((a, b) => a - b);
}

/** Pixels whose neighbours show the object, too. */
function inner(pixel: number): boolean {
  const cover = floats(stored.cover);
  return [0, 1, -1, stored.size, -stored.size].every((step) => cover[pixel + step] === 1);
}

test.each(["diffuse", "glossy"] as const)(
  "the %s object is Python's, and another light's is not",
  async (finish) => {
    const want = floats(stored.pictures[finish]);
    const found = differences(await drawn(finish), want, inner);
    expect(found.length).toBeGreaterThan(600);
    expect(found.at(Math.floor(0.99 * found.length))).toBeLessThan(NEAR);
    const mirrored = floats(stored.light).map((value, i) =>
      Math.floor(i / 3) === 3 ? -value : value,
    );
    const other = differences(await drawn(finish, mirrored), want, inner);
    expect(other.at(Math.floor(other.length / 2))).toBeGreaterThan(NEAR);
  },
);

test("the ground is darkened as in Python, and not without light from a side", async () => {
  const want = floats(stored.ground);
  const counts = (pixel: number) => want[3 * pixel]! >= 0;
  const found = differences(await drawn("ground"), want, counts);
  expect(found.length).toBeGreaterThan(600);
  // Between the points, squares are two triangles here and bilinear there.
  expect(found.at(Math.floor(0.5 * found.length))).toBeLessThan(0.5);
  expect(found.at(Math.floor(0.9 * found.length))).toBeLessThan(NEAR);
  const even = floats(stored.light).fill(0, 3);
  const other = differences(await drawn("ground", even), want, counts);
  expect(other.at(Math.floor(0.9 * other.length))).toBeGreaterThan(10);
});

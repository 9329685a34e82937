/** The estimator in a real browser: the same light as Python, its errors, its speed. */
import { readFileSync } from "node:fs";
import { type Browser, chromium, type Page } from "playwright-core";
import { createServer, type ViteDevServer } from "vite";
import { afterAll, beforeAll, expect, test } from "vitest";
import { CellMeans } from "../packages/deeplight/src/estimate/cell-means.ts";
import { framePhoto, looks, slidIntoPhoto } from "../packages/deeplight/src/estimate/framing.ts";
import { seenFromPhoto } from "../packages/deeplight/src/estimate/look.ts";
import { coverage } from "../packages/deeplight/src/light/mirror-ball.ts";
import { contractOf } from "../packages/deeplight/src/network/contract.ts";
import { Network } from "../packages/deeplight/src/network/network.ts";
import type { Harness } from "../tests/browser/harness.ts";
import { floats, golden, largestError } from "../tests/golden.ts";
import { noise } from "../tests/noise.ts";
import { PATIENCE } from "./browser.ts";

const MODEL = new URL("../../src/deeplight/weights/deeplight.onnx", import.meta.url);
const model = new Uint8Array(readFileSync(MODEL));
const want = golden("photo");
let server: ViteDevServer;
let browser: Browser;
let page: Page;

beforeAll(async () => {
  server = await createServer({ root: new URL("..", import.meta.url).pathname, logLevel: "error" });
  await server.listen();
  browser = await chromium.launch({
    executablePath: process.env.DEEPLIGHT_CHROMIUM ?? "/usr/bin/chromium",
    args: ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"],
  });
  page = await browser.newPage();
  await serveModels(page);
  await page.goto(new URL("/tests/browser/harness.html", address()).href);
  await page.waitForFunction(() => "harness" in window);
  expect(await call("load", "/model/deeplight.onnx")).toMatchObject({ got: "ok" });
});

afterAll(async () => {
  await browser?.close();
  await server?.close();
});

test("gives Python's light within 2e-3 in log radiance", async () => {
  const { rgb, width, height } = want.photo;
  const got = await call("logRadiance", rgb, width, height);
  const isOnDisc = coverage(32).map((share) => Number(share > 0.5)); // beyond it light means nothing
  const shown = [got, floats(want.record_log_radiance)].map((light) =>
    light.filter((_, i) => isOnDisc[Math.floor(i / 3)]),
  );
  expect(shown[0]!.length).toBeGreaterThan(0.7 * got.length);
  expect(largestError(shown[0]!, shown[1]!)).toBeLessThan(2e-3);
});

test.each([
  [720, 1280],
  [1919, 1081], // lying, and more than one strip
])("loses nothing of a frame of %i x %i on its way through the canvas", async (width, height) => {
  const contract = contractOf(model);
  const views = looks(slidIntoPhoto(framePhoto(height, width, undefined, contract)));
  const network = await Network.open(model);
  const answers = views.map((view) => {
    const means = new CellMeans(view);
    const start = 4 * (means.top * width + means.left);
    const end = 4 * (means.top + means.height) * width;
    means.add(noise(width, height).slice(start, end), means.top, width);
    return network.estimate(means.planes(contract.input_low, contract.input_high));
  });
  const want = seenFromPhoto(answers, contract, views).logRadiance;
  const error = largestError(await call("ofNoise", width, height), want);
  console.log(`${width} x ${height}: largest difference in log radiance ${error}`);
  expect(error).toBeLessThan(1e-4);
});

test("knows which model it runs", async () => {
  const facts = await call("facts");
  expect(facts.sha256).toBe(want.model_sha256);
  expect(facts.file).toBe("deeplight.onnx");
});

test("reports the progress of the download up to the whole", async () => {
  const { progress } = await call("load", "/model/plain.onnx");
  const size = readFileSync(MODEL).length;
  expect(progress.at(-1)).toEqual([size, size]);
});

test("estimates the newest frame only", async () => {
  const came = await call("burst", 8);
  expect(came).toEqual([true, false, false, false, false, false, false, true]);
});

test.each([
  ["/model/none.onnx", "model-missing"],
  ["/model/cut.onnx", "model-damaged"],
  ["/model/page.onnx", "model-damaged"],
  ["/model/version-9.onnx", "model-version"],
])("says what is wrong: %s", async (model, kind) => {
  expect((await call("load", model)).got).toBe(kind);
});

test("never keeps the page waiting for long", async () => {
  expect(await call("longestPause", 10)).toBeLessThan(100 * PATIENCE);
});

test("asks the network for a film's frame only where something moved or changed", async () => {
  const still = [false, false];
  expect(await call("asked", [120, 120, 120], [0, 0, 0])).toEqual([true, ...still]);
  expect(await call("asked", [120, 120, 120], [0, 0.1, 0.1])).toEqual([true, true, false]);
  expect(await call("asked", [120, 121, 140], [0, 0, 0])).toEqual([true, false, true]);
});

test("reports its speed", async () => {
  for (const [width, height] of [
    [720, 1280],
    [1080, 1920],
  ] as const) {
    await call("time", width, height, 30); // until the code is compiled
    const times = await call("time", width, height, 60);
    const [prepare, run] = [0, 1].map((k) => middle(times.map((pair) => pair[k]!))) as [
      number,
      number,
    ];
    const best = Math.min(...times.map(([before, after]) => before + after));
    const [rate, most] = [prepare + run, best].map((ms) => (1000 / ms).toFixed(0));
    console.log(
      `${width} x ${height}, median of 60: averages ${prepare.toFixed(1)} ms, ` +
        `network ${run.toFixed(1)} ms: ${rate} a second, the fastest ${most}`,
    );
    expect(prepare).toBeGreaterThan(0);
    expect(run).toBeGreaterThan(0);
  }
});

test("gives null for frames that were waiting when it closed, and for later ones", async () => {
  expect(await call("closed")).toEqual([true, true]);
});

function call<K extends keyof Harness>(
  name: K,
  ...args: Parameters<Harness[K]>
): Promise<Awaited<ReturnType<Harness[K]>>> {
  return page.evaluate(
    // biome-ignore lint/suspicious/noExplicitAny: inside the browser
    ([method, values]) => (window as any).harness[method](...values),
    [name, args] as const,
  );
}

/** Answers for model files that are not there: damaged, of another version, a web page. */
async function serveModels(target: Page): Promise<void> {
  const old = Buffer.from(model);
  old.write('"version": 9,', old.indexOf('"version": 3,'));
  const bodies: Record<string, Buffer> = {
    "plain.onnx": Buffer.from(model),
    "cut.onnx": Buffer.from(model).subarray(0, 2_000_000),
    "page.onnx": Buffer.from("<!doctype html><title>Not found</title>"),
    "version-9.onnx": old,
  };
  await target.route("**/model/*", async (route) => {
    const name = new URL(route.request().url()).pathname.split("/").at(-1)!;
    const body = bodies[name];
    if (body === undefined) {
      await (name === "none.onnx" ? route.fulfill({ status: 404 }) : route.continue());
    } else {
      await route.fulfill({ body, headers: { "Content-Length": String(body.length) } });
    }
  });
}

function address(): string {
  return server.resolvedUrls!.local[0]!;
}

function middle(values: number[]): number {
  return values.sort((a, b) => a - b)[Math.floor(values.length / 2)]!;
}

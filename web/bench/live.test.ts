/**
 * What a frame of a film costs the live page in Chromium, sensors on: processor time of its two threads,
 * so that neither drawing without a graphics card (another process) nor other work on the machine counts.
 * After `npm run build`: npm run bench -- bench/live.test.ts.
 */
import { mkdtemp } from "node:fs/promises";
import { tmpdir } from "node:os";
import path from "node:path";
import type { Browser, Page } from "playwright-core";
import { test } from "vitest";
import { launch, untilLit, visit } from "../e2e/browser.ts";
import { makeClip } from "../e2e/clip.ts";
import { serve } from "../e2e/python.ts";
import { type TraceEvent, threadTimes } from "./trace.ts";

const LARGER = 5 / 3; // 720 x 1280
const WARM_UP_FRAMES = 40;
const FRAMES = 60;

interface Count {
  frames: number;
  added: number;
  lights: number;
  drawn: number;
  /** By the worker's own clock. */
  prepare: number[];
  network: number[];
  fuse: number[];
}

declare global {
  interface Window {
    count: Count;
    /** No light of all frames is asked for. */
    isDark: boolean;
  }
}

/** Runs in the page before its own scripts: counts what comes from the worker and what is drawn. */
function countFrames(): void {
  window.count = { frames: 0, added: 0, lights: 0, drawn: 0, prepare: [], network: [], fuse: [] };
  const Plain = window.Worker;
  window.Worker = class extends Plain {
    constructor(...args: ConstructorParameters<typeof Plain>) {
      super(...args);
      this.addEventListener("message", ({ data: { tracked } }) => {
        if (!tracked) return;
        const { count } = window;
        count.frames++;
        count.added += Number(tracked.added !== null);
        count.lights += Number(tracked.light !== null);
        count.prepare.push(tracked.preprocessMs);
        if (tracked.added) count.network.push(tracked.runMs);
        if (tracked.added && !tracked.light) count.fuse.push(tracked.fuseMs);
      });
    }

    // biome-ignore lint/suspicious/noExplicitAny: any message passes
    override postMessage(message: any, more?: any) {
      if (message.track && window.isDark) message.track.rows = 0;
      super.postMessage(message, more);
    }
  };
  const ask = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (act) =>
    ask((time) => {
      window.count.drawn++;
      act(time);
    });
}

/** Turns the phone through a whole turn, as its sensors say it. */
function turnPhone(): void {
  let step = 0;
  setInterval(() => {
    const angles = { alpha: 1.5 * step++, beta: 80 + 4 * Math.sin(step / 9), gamma: 0 };
    dispatchEvent(new DeviceOrientationEvent("deviceorientation", angles));
  }, 33);
}

const counted = (page: Page): Promise<Count> => page.evaluate(() => window.count);

async function untilCounted(page: Page, frames: number): Promise<void> {
  await page.waitForFunction((least) => window.count.frames >= least, frames, { timeout: 0 });
}

interface Cost {
  readonly count: Count;
  readonly workerMs: number;
  readonly pageMs: number;
}

/** Of the next frames. */
async function costOf(browser: Browser, page: Page): Promise<Cost> {
  await browser.startTracing(page, { categories: ["toplevel", "__metadata"] });
  const before = await counted(page);
  await untilCounted(page, before.frames + FRAMES);
  const after = await counted(page);
  const trace = await browser.stopTracing();
  const { traceEvents } = JSON.parse(trace.toString()) as { traceEvents: TraceEvent[] };
  const times = [...threadTimes(traceEvents)];
  // The largest of each kind: other workers and pages rest.
  const most = (kind: RegExp): number =>
    Math.max(...times.filter(([thread]) => kind.test(thread)).map(([, ms]) => ms));
  const count = { ...after };
  for (const name of ["frames", "added", "lights", "drawn"] as const) count[name] -= before[name];
  for (const name of ["prepare", "network", "fuse"] as const) {
    count[name] = after[name].slice(before[name].length);
  }
  return { count, workerMs: most(/DedicatedWorker/), pageMs: most(/CrRendererMain/) };
}

test("says what a frame costs", async () => {
  const folder = await mkdtemp(path.join(tmpdir(), "deeplight-live-"));
  const clip = await makeClip(folder, LARGER);
  const [site, browser] = await Promise.all([serve(), launch(clip)]);
  const { page, leave } = await visit(browser, site.url, {
    before: (of) => of.addInitScript(countFrames),
  });
  await page.click("#open-camera");
  await page.click('[data-tray="object"]');
  await page.getByText("Ball", { exact: true }).click(); // drawn the quickest
  await page.evaluate(turnPhone);
  await untilLit(page);
  await untilCounted(page, WARM_UP_FRAMES);
  const size = await page.locator("video").evaluate((of: HTMLVideoElement) => {
    return `${of.videoWidth} x ${of.videoHeight}`;
  });
  const lit = await costOf(browser, page);
  await page.evaluate(() => {
    window.isDark = true;
  });
  const dark = await costOf(browser, page);
  report(size, lit, dark);
  await leave();
  await browser.close();
  await site.stop();
});

function report(size: string, lit: Cost, dark: Cost): void {
  console.log(`${size}, milliseconds of processor time       worker   page`);
  const { frames, lights } = lit.count;
  const say = (name: string, worker: number, pageMs: number): void =>
    console.log(
      `  ${name.padEnd(42)} ${worker.toFixed(1).padStart(6)} ${pageMs.toFixed(1).padStart(6)}`,
    );
  const [worker, own] = [dark.workerMs / dark.count.frames, dark.pageMs / dark.count.drawn];
  say(`a frame into the light; a picture drawn`, worker, own);
  const light = (lit.workerMs - worker * frames) / lights;
  const lightHere = (lit.pageMs - own * lit.count.drawn) / lights;
  say("a light of all frames", light, lightHere);
  // The page asks for no more: LIVE_MS and LIVE_SHARE of watch.ts.
  const perFrame = Math.min(5, 1000 / 6 / light) / 30;
  say("both at 30 frames a second", worker + light * perFrame, own + lightHere * perFrame);
  const { prepare, network, fuse } = dark.count;
  console.log(
    `wall clock of the worker, median: pixels ${middle(prepare)}, network ${middle(network)}, session ${middle(fuse)}`,
  );
}

const middle = (values: readonly number[]): string =>
  ([...values].sort((a, b) => a - b)[values.length >> 1] ?? Number.NaN).toFixed(1);

/**
 * How long the first light takes after the page was asked for, on loopback with a warm cache: an example,
 * clicked as soon as it is there. Wall clock with its steps, the load of the machine, and processor time
 * of the page's and the worker's thread, which other work does not lengthen as much.
 * After `npm run build`: npm run bench -- bench/first-light.test.ts.
 */
import { loadavg } from "node:os";
import type { Browser } from "playwright-core";
import { test } from "vitest";
import { DESKTOP, launch, visit } from "../e2e/browser.ts";
import { serve } from "../e2e/python.ts";
import { type TraceEvent, threadTimes } from "./trace.ts";

const VISITS = 7;

interface Steps {
  /** Milliseconds after the page was asked for, in the order in which they come. */
  [step: string]: number;
}

declare global {
  interface Window {
    steps: Steps;
  }
}

/** Runs in the page before its own scripts: notes when what happens, and clicks. */
function noteSteps(): void {
  window.steps = {};
  const note = (name: string): void => {
    window.steps[name] ??= performance.now();
  };
  const Plain = window.Worker;
  window.Worker = class extends Plain {
    constructor(...args: ConstructorParameters<typeof Plain>) {
      super(...args);
      if (!String(args[0]).includes("estimate-worker")) return;
      note("scripts ran, worker asked for");
      this.addEventListener("message", ({ data }) => {
        if ("progress" in data) note("worker runs, network comes");
        if (data.progress?.[0] === data.progress?.[1]) note("network is there");
        if ("loaded" in data) note("network is ready");
        if ("first" in data) note("network's light");
      });
    }
  };
  new MutationObserver(() => {
    const example = document.querySelector<HTMLElement>("#examples button");
    if (example && !window.steps.clicked) {
      note("clicked");
      example.click();
    }
    if (document.querySelector("#viewer[data-light]")) note("light on the page");
    if (document.querySelector("#viewer[data-light=whole]")) note("whole light");
  }).observe(document, { subtree: true, childList: true, attributes: true });
}

async function once(browser: Browser, url: string): Promise<Steps> {
  const { page, leave } = await visit(browser, url, {
    viewport: DESKTOP,
    keeps: true,
    before: (of) => of.addInitScript(noteSteps),
  });
  await page.waitForSelector("#viewer[data-light=whole]");
  await page.waitForFunction(() => navigator.serviceWorker.controller !== null);
  await browser.startTracing(page, { categories: ["toplevel", "__metadata"] });
  await page.reload();
  await page.waitForFunction(() => window.steps["light on the page"]);
  const trace = await browser.stopTracing();
  await page.waitForSelector("#viewer[data-light=whole]");
  const steps = await page.evaluate(() => window.steps);
  await leave();
  const { traceEvents } = JSON.parse(trace.toString()) as { traceEvents: TraceEvent[] };
  for (const [thread, ms] of threadTimes(traceEvents)) {
    const name = /CrRendererMain/.test(thread)
      ? "page"
      : /DedicatedWorker/.test(thread)
        ? "worker"
        : "";
    if (name) steps[`processor: ${name}`] = Math.max(steps[`processor: ${name}`] ?? 0, ms);
  }
  return steps;
}

test("says what the first light waits for", async () => {
  const [site, browser] = await Promise.all([serve(), launch()]);
  const visits: Steps[] = [];
  for (let i = 0; i < VISITS; i++) visits.push(await once(browser, site.url));
  await browser.close();
  await site.stop();
  const load = loadavg()[0]!.toFixed(1);
  console.log(`${VISITS} visits, load ${load}; milliseconds: fastest, median`);
  const names = [...new Set(visits.flatMap((steps) => Object.keys(steps)))];
  const rows = names.map((name) => {
    const times = visits.map((steps) => steps[name] ?? Number.NaN).sort((a, b) => a - b);
    return [name, times[0]!, times[VISITS >> 1]!] as const;
  });
  for (const [name, least, middle] of rows.sort((a, b) => a[2] - b[2])) {
    console.log(
      `  ${name.padEnd(32)} ${[least, middle].map((ms) => ms.toFixed(0).padStart(6)).join("")}`,
    );
  }
});

/** A real Chromium with the built page in it, watched for errors and foreign requests. */
import { type Browser, chromium, type Page } from "playwright-core";
import { expect } from "vitest";

const FLAGS = [
  "--no-sandbox",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
  "--use-gl=angle",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--disable-gpu-watchdog", // it ends the graphics where a busy machine draws slowly
];

/** A busy machine needs more. */
const PATIENCE_MS = Number(process.env.DEEPLIGHT_PATIENCE_MS ?? 30_000);
/** How much longer things may take than on an idle one. */
export const PATIENCE = PATIENCE_MS / 30_000;

export const PHONE = { width: 390, height: 844 };
export const PHONE_LYING = { width: 844, height: 390 };
export const DESKTOP = { width: 1280, height: 800 };

/** @param clip what the fake camera plays; without one there is no camera. */
export function launch(clip?: string): Promise<Browser> {
  const camera = clip
    ? [
        "--use-fake-device-for-media-stream",
        "--use-fake-ui-for-media-stream",
        `--use-file-for-fake-video-capture=${clip}`,
      ]
    : [];
  const executablePath = process.env.DEEPLIGHT_CHROMIUM ?? "/usr/bin/chromium";
  return chromium.launch({ executablePath, args: [...FLAGS, ...camera] });
}

export interface Visit {
  readonly page: Page;
  /** Closes the page; fails if it logged an error or asked anybody else for anything, but for what is expected. */
  leave(expected?: RegExp, asked?: RegExp): Promise<void>;
}

export interface How {
  readonly viewport?: { width: number; height: number };
  readonly touch?: boolean;
  readonly reducedMotion?: boolean;
  /** The user's own few colours instead of the page's. */
  readonly forcedColours?: boolean;
  /** Lets the page keep itself for offline use; else every file comes from the server. */
  readonly keeps?: boolean;
  /** Never gets the model: quicker, where no light is needed. */
  readonly withoutModel?: boolean;
  readonly userAgent?: string;
  /** Runs before the page's own scripts. */
  readonly before?: (page: Page) => Promise<unknown>;
}

export async function visit(browser: Browser, url: string, how: How = {}): Promise<Visit> {
  const context = await browser.newContext({
    viewport: how.viewport ?? PHONE,
    hasTouch: how.touch ?? false,
    isMobile: how.touch ?? false,
    reducedMotion: how.reducedMotion ? "reduce" : "no-preference",
    forcedColors: how.forcedColours ? "active" : "none",
    acceptDownloads: true,
    ...(how.userAgent ? { userAgent: how.userAgent } : {}),
    serviceWorkers: how.keeps ? "allow" : "block",
  });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  const errors: string[] = [];
  const foreign: string[] = [];
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("console", (message) => {
    if (message.type() === "error") errors.push(message.text());
  });
  context.on("request", (request) => {
    const { origin, protocol } = new URL(request.url());
    const own = origin === new URL(url).origin || protocol === "blob:" || protocol === "data:";
    if (!own || request.method() !== "GET") foreign.push(`${request.method()} ${request.url()}`);
  });
  if (how.withoutModel) await page.route("**/deeplight.onnx", () => {});
  await how.before?.(page);
  await page.goto(url);
  return {
    page,
    async leave(expected, asked) {
      await context.close();
      expect(errors.filter((error) => !expected?.test(error))).toEqual([]);
      expect(foreign.filter((request) => !asked?.test(request))).toEqual([]);
    },
  };
}

/** Waits until the light of what is on screen is there. */
export async function untilLit(page: Page): Promise<void> {
  await page.waitForSelector("#save-json:enabled", { state: "attached" });
}

/** Runs before the page: links open in Quick Look, as Safari on a phone answers. */
export function opensUsdz(): void {
  const supports = DOMTokenList.prototype.supports;
  DOMTokenList.prototype.supports = function (token) {
    return token === "ar" || supports.call(this, token);
  };
}

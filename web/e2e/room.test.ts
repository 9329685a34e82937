/**
 * "In your room" in Chromium with an emulated headset (iwer). What iwer has not is stood in for: the
 * camera's pixels, a floor to hit, a light probe.
 */
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { findings } from "./axe.ts";
import { launch, visit } from "./browser.ts";
import { type Site, serve } from "./python.ts";

const IWER = createRequire(import.meta.url)
  .resolve("iwer")
  .replace(/lib\/index\.js$/, "build/iwer.min.js");
let site: Site;
let browser: Browser;
let runtime: string;

beforeAll(async () => {
  [site, browser, runtime] = await Promise.all([serve(), launch(), readFile(IWER, "utf8")]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

interface Offers {
  readonly camera: boolean;
  readonly probe: boolean;
}

/** Runs before the page: a headset whose camera sees red above and blue below, over a floor. */
function emulate({ camera, probe }: Offers): void {
  const it = globalThis as unknown as {
    // biome-ignore lint/suspicious/noExplicitAny: an emulator without types here
    IWER: any;
    XRWebGLBinding: unknown;
    device: unknown;
    tap: () => void;
    VideoFrame: typeof VideoFrame;
    taken: number[][];
  };
  const device = new it.IWER.XRDevice(it.IWER.metaQuest3);
  device.installRuntime({ forceInstall: true }); // Chromium has a WebXR of its own, without devices
  device.stereoEnabled = false;
  it.device = device;
  it.taken = [];
  it.VideoFrame = class extends VideoFrame {
    constructor(...given: unknown[]) {
      super(...(given as [AllowSharedBufferSource, VideoFrameBufferInit]));
      const [pixels] = given;
      if (pixels instanceof Uint8ClampedArray) {
        it.taken.push([...pixels.slice(0, 3)], [...pixels.slice(-4, -1)]);
      }
    }
  };
  const xr = navigator.xr as XRSystem;
  const request = xr.requestSession.bind(xr);
  Object.assign(xr, {
    requestSession: async (mode: XRSessionMode) => {
      const session = await request(mode, { requiredFeatures: ["local"] });
      const extra: Record<string, unknown> = {
        requestHitTestSource: async () => ({ cancel: () => {} }),
      };
      if (probe) extra.requestLightProbe = async () => ({});
      Object.assign(session, extra);
      Object.defineProperty(session, "enabledFeatures", {
        value: ["local", "hit-test", ...(camera ? ["camera-access"] : [])],
      });
      it.tap = () => session.dispatchEvent(new Event("select"));
      return session;
    },
  });
  const place = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1.2, -2, 1]);
  Object.assign(XRFrame.prototype, {
    getHitTestResults: () => [{ getPose: () => ({ transform: { matrix: place } }) }],
    getLightEstimate: () => ({
      sphericalHarmonicsCoefficients: Float32Array.from({ length: 27 }, (_, i) => (i < 3 ? 1 : 0)),
      primaryLightDirection: { x: 1, y: 0, z: 0 },
      primaryLightIntensity: { x: 20, y: 20, z: 20 },
    }),
  });
  if (!camera) return;
  const [width, height] = [720, 1280];
  Object.defineProperty(XRView.prototype, "camera", { get: () => ({ width, height }) });
  it.XRWebGLBinding = class {
    private readonly texture: WebGLTexture;

    constructor(
      _: XRSession,
      readonly gl: WebGL2RenderingContext,
    ) {
      const pixels = new Uint8Array(4 * width * height);
      for (let i = 0; i < width * height; i++) {
        const isAbove = i >= (width * height) / 2; // a texture's rows count from below
        pixels.set(isAbove ? [230, 20, 20, 255] : [20, 20, 120, 255], 4 * i);
      }
      this.texture = gl.createTexture();
      const bound = gl.getParameter(gl.TEXTURE_BINDING_2D);
      gl.bindTexture(gl.TEXTURE_2D, this.texture);
      const form = [gl.RGBA, width, height, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels] as const;
      gl.texImage2D(gl.TEXTURE_2D, 0, ...form);
      gl.bindTexture(gl.TEXTURE_2D, bound);
    }

    getCameraImage(): WebGLTexture {
      return this.texture;
    }
  };
}

async function enter(offers: Offers) {
  const before = async (page: Page) => {
    await page.addInitScript(runtime);
    await page.addInitScript(emulate, offers);
  };
  // The emulator draws all the time, in software here.
  const visited = await visit(browser, site.url, { before, viewport: { width: 240, height: 360 } });
  await visited.page.click("#open-room:visible");
  await visited.page.waitForSelector('#room[data-hint="found"]');
  return visited;
}

const seenShare = (page: Page): Promise<number> =>
  page.locator("#room").evaluate((room) => Number((room as HTMLElement).dataset.seen));

/** The emulator lays its canvas over the page; a phone lays the page's overlay over its own. */
const leaveRoom = (page: Page): Promise<void> =>
  page.locator("#leave-room").evaluate((button: HTMLElement) => button.click());

const screen = (page: Page): Promise<Buffer> => page.screenshot();

test("an object stands where one taps, lit by what the camera has seen so far", async () => {
  const { page, leave } = await enter({ camera: true, probe: true });
  await page.waitForSelector("#room[data-seen]");
  const ahead = await seenShare(page);
  expect(ahead).toBeGreaterThan(3); // percent of the sphere
  expect(ahead).toBeLessThan(40);
  const [first, last] = await page.evaluate(
    () => (globalThis as unknown as { taken: number[][] }).taken,
  );
  expect(first).toEqual([230, 20, 20]); // the upper half's colour: rows from the top
  expect(last).toEqual([20, 20, 120]);
  const empty = await screen(page);
  await page.evaluate(() => (globalThis as unknown as { tap: () => void }).tap());
  await page.waitForSelector('#room[data-hint="placed"]');
  expect(await findings(page)).toEqual([]);
  await expect.poll(async () => (await screen(page)).equals(empty)).toBe(false);
  await page.evaluate(() => {
    const { device } = globalThis as unknown as {
      device: { quaternion: { set(x: number, y: number, z: number, w: number): void } };
    };
    device.quaternion.set(0, Math.SQRT1_2, 0, Math.SQRT1_2); // a quarter turn to the left
  });
  await expect.poll(() => seenShare(page)).toBeGreaterThan(1.5 * ahead);
  await leaveRoom(page);
  await page.waitForSelector("#start:visible");
  expect(await page.isVisible("#room")).toBe(false);
  await leave();
});

test("without the camera's pixels the platform's own estimate lights the object", async () => {
  const { page, leave } = await enter({ camera: false, probe: true });
  await page.waitForSelector('#room[data-seen="0"]');
  await page.evaluate(() => (globalThis as unknown as { tap: () => void }).tap());
  await page.waitForSelector('#room[data-hint="dark"]');
  await leaveRoom(page);
  await page.waitForSelector("#start:visible");
  await leave();
});

test("a browser without augmented reality does not offer the room", async () => {
  const { page, leave } = await visit(browser, site.url, { withoutModel: true });
  await page.waitForSelector("#examples button:nth-child(3)");
  expect(await page.isVisible("#open-room")).toBe(false);
  await leave();
});

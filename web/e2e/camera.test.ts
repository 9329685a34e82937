/** The live camera in the built page, played by a clip. */
import { mkdtemp, readFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import path from "node:path";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { launch, PHONE_LYING, untilLit, visit } from "./browser.ts";
import { makeClip } from "./clip.ts";
import { pixels, saved } from "./pictures.ts";
import { ballOf, type Site, serve } from "./python.ts";

let site: Site;
let browser: Browser;
let folder: string;

beforeAll(async () => {
  folder = await mkdtemp(path.join(tmpdir(), "deeplight-camera-"));
  const clip = process.env.DEEPLIGHT_CLIP || (await makeClip(folder)); // a simulated one: docs/demo.md
  [site, browser] = await Promise.all([serve(), launch(clip)]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

async function openCamera(page: Page): Promise<void> {
  await page.click("#open-camera");
  await untilLit(page);
}

const isFilming = (page: Page): Promise<boolean> =>
  page.locator("video").evaluate((video: HTMLVideoElement) => {
    const stream = video.srcObject as MediaStream | null;
    return stream?.getVideoTracks()[0]?.readyState === "live";
  });

test("estimates frame after frame; a frozen one keeps the picture and the light so far", async () => {
  const { page, leave } = await visit(browser, site.url);
  await openCamera(page);
  await page.waitForFunction(() =>
    /per second/.test(document.querySelector("#meter")!.textContent!),
  );
  await page.waitForTimeout(2000);
  console.log(`live: ${(await page.textContent("#meter-text"))!.trim()}`);
  // The frame that is kept is the one that the paused video shows.
  const frame = await page.locator("video").evaluate(async (video: HTMLVideoElement) => {
    video.pause();
    await new Promise((settled) => setTimeout(settled, 300));
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [video.videoWidth, video.videoHeight];
    canvas.getContext("2d")!.drawImage(video, 0, 0);
    return canvas.toDataURL("image/png").split(",")[1]!;
  });
  await page.click("#freeze");
  await untilFrozen(page);
  expect(await isFilming(page)).toBe(false);
  const light = JSON.parse((await saved(page, "#save-json")).toString());
  expect(light.notes.join()).toMatch(/camera's frames so far/);
  expect(ballOf(JSON.stringify(light)).some((value) => value > 0)).toBe(true);
  const picture = await pixels(page, await saved(page, "#save-picture"));
  const film = await pixels(page, Buffer.from(frame, "base64"));
  for (const [x, y] of [
    [0.05, 0.05],
    [0.95, 0.05],
    [0.05, 0.5],
    [0.95, 0.5],
  ] as const) {
    const around = [x - 0.04, y - 0.04, x + 0.04, y + 0.04] as const; // not mirrored, not turned
    const off = picture.mean(...around, 1) - film.mean(...around, 1);
    expect(Math.abs(off)).toBeLessThan(1); // of 255: one is a JPEG
  }
  await page.click("#freeze");
  await expect.poll(() => isFilming(page)).toBe(true);
  await leave();
});

async function untilFrozen(page: Page): Promise<void> {
  await page.waitForSelector('#freeze[aria-pressed="true"]');
  await untilLit(page);
}

test("the camera is off while nobody sees the page, and on again after", async () => {
  const { page, leave } = await visit(browser, site.url);
  await openCamera(page);
  expect(await isFilming(page)).toBe(true);
  const hide = (is: boolean): Promise<void> =>
    page.evaluate((hidden) => {
      Object.defineProperty(document, "hidden", { configurable: true, get: () => hidden });
      document.dispatchEvent(new Event("visibilitychange"));
    }, is);
  await hide(true);
  expect(await isFilming(page)).toBe(false);
  await hide(false);
  await expect.poll(() => isFilming(page)).toBe(true);
  await untilLit(page);
  await page.click("#close");
  await page.waitForSelector("#start:visible");
  await expect.poll(() => isFilming(page)).toBe(false); // where it was just opening, as soon as it is open
  await leave();
});

test("the phone is turned: the picture fills the screen as before", async () => {
  const { page, leave } = await visit(browser, site.url, { viewport: PHONE_LYING });
  await openCamera(page);
  const box = async () => (await page.locator("#view").boundingBox())!;
  expect((await box()).height).toBeCloseTo(390, 0);
  await page.setViewportSize({ width: 390, height: 844 });
  await expect.poll(async () => (await box()).height).toBeGreaterThan(690);
  expect((await box()).width).toBeCloseTo(390, 0);
  for (const tool of await page.locator("nav button:visible").all()) {
    const { x, y, width, height } = (await tool.boundingBox())!;
    expect(Math.min(x, y, 390 - x - width, 844 - y - height)).toBeGreaterThanOrEqual(0);
    expect(Math.min(width, height)).toBeGreaterThanOrEqual(44); // a finger's size
  }
  await leave();
});

/** As its sensors say it. */
const holdPhone = (page: Page, alpha: number, beta: number): Promise<void> =>
  page.evaluate(
    (angles) => {
      dispatchEvent(new DeviceOrientationEvent("deviceorientation", angles));
    },
    { alpha, beta, gamma: 0 },
  );

test("follows the phone's motion: what stands on the floor leaves the view when it is turned away", async () => {
  const { page, leave } = await visit(browser, site.url, { touch: true });
  await openCamera(page);
  await holdPhone(page, 0, 60);
  await page.click('[data-tray="camera"]');
  await page.waitForSelector('#motion[aria-pressed="true"]');
  await expect.poll(() => page.textContent("#tilt-value")).toBe("-30°");
  expect(await page.isDisabled("#tilt")).toBe(true);
  await page.click('[data-tray="camera"]');
  await page.locator("video").evaluate((video: HTMLVideoElement) => video.pause());
  const ahead = await page.locator("#view").screenshot();
  await holdPhone(page, 90, 60);
  await page.waitForTimeout(400);
  expect((await page.locator("#view").screenshot()).equals(ahead)).toBe(false);
  await leave();
});

test("a video of the object in the picture is filmed and saved", async () => {
  const { page, leave } = await visit(browser, site.url);
  await openCamera(page);
  await page.click('[data-tray="save"]');
  await page.click("#record");
  await page.waitForTimeout(3000);
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#record")]);
  expect(download.suggestedFilename()).toMatch(/\.(mp4|webm)$/);
  const film = await readFile(await download.path());
  expect(film.length).toBeGreaterThan(5000);
  const seconds = await page.evaluate(async (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const video = document.createElement("video");
    video.muted = true;
    video.src = URL.createObjectURL(new Blob([bytes]));
    await video.play();
    return [video.videoWidth, video.videoHeight];
  }, film.toString("base64"));
  expect(Math.min(...seconds)).toBeGreaterThan(300);
  await leave();
});

test("a camera that goes away is reported", async () => {
  const { page, leave } = await visit(browser, site.url);
  await openCamera(page);
  await page.locator("video").evaluate((video: HTMLVideoElement) => {
    const [track] = (video.srcObject as MediaStream).getVideoTracks();
    track!.dispatchEvent(new Event("ended"));
  });
  await page.waitForSelector('#notice[open][data-kind="camera-lost"]');
  expect(await isFilming(page)).toBe(false);
  await page.click('#notice [data-remedy="camera"]');
  await expect.poll(() => isFilming(page)).toBe(true);
  await leave();
});

test("motion that nobody senses is reported", async () => {
  const { page, leave } = await visit(browser, site.url);
  await openCamera(page);
  await page.click('[data-tray="camera"]');
  await page.click("#motion");
  await page.waitForSelector('#notice[open][data-kind="no-motion"]');
  await leave();
});

/** Runs before the page: the sensors are an iPhone's, which answers a question in a tap like this. */
function asksFirst(answer: PermissionState | "throws"): void {
  const asked: boolean[] = [];
  Object.assign(window, { asked });
  Object.assign(DeviceOrientationEvent, {
    requestPermission(): Promise<PermissionState> {
      asked.push(navigator.userActivation.isActive);
      return answer === "throws" ? Promise.reject(new Error("no tap")) : Promise.resolve(answer);
    },
  });
}

const asked = (page: Page): Promise<boolean[] | undefined> =>
  page.evaluate(() => (window as { asked?: boolean[] }).asked);

test.each([
  ["granted", true],
  ["denied", false],
  ["throws", false],
] as const)("an iPhone asks for motion in the camera's tap, once: %s", async (answer, follows) => {
  const before = (page: Page) => page.addInitScript(asksFirst, answer);
  const { page, leave } = await visit(browser, site.url, { touch: true, before });
  expect(await asked(page)).toEqual([]); // not without a tap
  await page.tap("#open-camera");
  await untilLit(page);
  expect(await asked(page)).toEqual([true]);
  await holdPhone(page, 0, 60);
  await page.click('[data-tray="camera"]');
  await page.waitForSelector(`#motion[aria-pressed="${follows}"]`);
  expect(await page.isDisabled("#tilt")).toBe(follows);
  expect(await isFilming(page)).toBe(true); // a refusal costs the sensors, not the camera
  expect(await page.isVisible("#notice")).toBe(false);
  if (!follows) {
    await page.click("#motion");
    await page.waitForSelector('#notice[open][data-kind="motion-denied"]');
    expect(await asked(page)).toEqual([true, true]);
  }
  await leave();
});

test("where nobody needs to ask, motion is followed at once", async () => {
  const { page, leave } = await visit(browser, site.url, { touch: true });
  await openCamera(page);
  expect(await asked(page)).toBeUndefined();
  await holdPhone(page, 0, 60);
  await page.click('[data-tray="camera"]');
  await page.waitForSelector('#motion[aria-pressed="true"]');
  await leave();
});

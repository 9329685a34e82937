/** What axe finds wrong with the page for people who cannot see, hear or point: nothing, in no state. */
import { mkdtemp } from "node:fs/promises";
import { tmpdir } from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { findings } from "./axe.ts";
import { launch, opensUsdz, untilLit, visit } from "./browser.ts";
import { makeClip, PHOTOS } from "./clip.ts";
import { type Site, serve } from "./python.ts";

const PHOTO = fileURLToPath(new URL("canteen.jpg", PHOTOS));
let site: Site;
let browser: Browser;

beforeAll(async () => {
  const clip = await makeClip(await mkdtemp(path.join(tmpdir(), "deeplight-axe-")));
  [site, browser] = await Promise.all([serve(), launch(clip)]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

test("axe finds nothing on the start screen, with a photo, in any tray, in a notice", async () => {
  const before = (of: Page) => of.addInitScript(opensUsdz); // all that a tray may hold
  const { page, leave } = await visit(browser, site.url, { reducedMotion: true, before });
  await page.waitForSelector("#examples button:nth-child(3)");
  expect(await findings(page), "start").toEqual([]);
  await page.setInputFiles("#photo-file", PHOTO);
  await untilLit(page);
  expect(await findings(page), "photo").toEqual([]);
  for (const tray of ["object", "material", "camera", "save"]) {
    await page.click(`[data-tray="${tray}"]`);
    if (tray === "object") expect(await page.isVisible("#hand-over")).toBe(true);
    expect(await findings(page), tray).toEqual([]);
  }
  await page.setInputFiles("#photo-file", {
    name: "a.jpg",
    mimeType: "image/jpeg",
    buffer: Buffer.from("no"),
  });
  await page.waitForSelector("#notice[open]");
  expect(await findings(page), "notice").toEqual([]);
  await page.keyboard.press("Escape");
  await page.evaluate(() => {
    for (const id of ["update", "drop-hint"]) document.getElementById(id)!.hidden = false;
  });
  expect(await findings(page), "a new version, and a file over the page").toEqual([]);
  await leave();
});

test("axe finds nothing while the camera films, and in a frozen frame", async () => {
  const { page, leave } = await visit(browser, site.url, { reducedMotion: true });
  await page.click("#open-camera");
  await untilLit(page);
  await page.waitForSelector("#around:visible");
  expect(await findings(page), "live").toEqual([]);
  await page.click("#freeze");
  await page.waitForSelector('#freeze[aria-pressed="true"]');
  expect(await findings(page), "frozen").toEqual([]);
  await leave();
});

test.each([
  ["a phone's", { width: 195, height: 422 }],
  ["a desktop's", { width: 640, height: 400 }],
])("twice as large, all of %s tools are in reach, also in forced colours", async (_, viewport) => {
  const { page, leave } = await visit(browser, site.url, { viewport, forcedColours: true });
  await page.setInputFiles("#photo-file", PHOTO);
  await untilLit(page);
  for (const tray of ["object", "material", "camera", "save"]) {
    await page.click(`[data-tray="${tray}"]`);
    const { x, y, width, height } = (await page.locator(`#tray-${tray}`).boundingBox())!;
    expect(Math.min(x, y), tray).toBeGreaterThanOrEqual(0);
    expect(x + width, tray).toBeLessThanOrEqual(viewport.width);
    expect(y + height, tray).toBeLessThanOrEqual(viewport.height);
  }
  for (const tool of await page.locator("nav button:visible, header button:visible").all()) {
    const { x, y, width, height } = (await tool.boundingBox())!;
    expect(Math.min(x, y)).toBeGreaterThanOrEqual(0);
    expect(x + width).toBeLessThanOrEqual(viewport.width);
    expect(y + height).toBeLessThanOrEqual(viewport.height);
  }
  expect(await findings(page)).toEqual([]);
  await leave();
});

test("axe would find a button without a name", async () => {
  const { page, leave } = await visit(browser, site.url, { withoutModel: true });
  await page.evaluate(() =>
    document.querySelector("main")!.append(document.createElement("button")),
  );
  expect((await findings(page)).join()).toContain("button-name");
  await leave();
});

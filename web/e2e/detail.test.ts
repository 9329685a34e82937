/** Made-up detail where a photo does not look: the same as Python's, left out where its library is not there. */
import { fileURLToPath } from "node:url";
import type { Browser } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { decodedHdr } from "../tests/hdr.ts";
import { launch, untilLit, visit } from "./browser.ts";
import { PHOTOS } from "./clip.ts";
import { apart, saved } from "./pictures.ts";
import { estimated, type Site, serve } from "./python.ts";

const LIBRARY = "**/model/detail.bin";
let site: Site;
let browser: Browser;

beforeAll(async () => {
  [site, browser] = await Promise.all([serve(), launch()]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

/** What the page saves of a photo, and what it asked for of the library until then. */
async function ofPage(file: string, withLibrary = true) {
  const asked: string[] = [];
  const { page, leave } = await visit(browser, site.url, {
    before: async (of) => {
      of.on("request", (request) => asked.push(request.url()));
      if (!withLibrary) await of.route(LIBRARY, (route) => route.abort());
    },
  });
  await page.waitForSelector("#loading", { state: "hidden" });
  expect(asked.filter((url) => url.endsWith("detail.bin"))).toEqual([]); // no photo, no library
  await page.setInputFiles("#photo-file", file);
  await untilLit(page);
  await page.waitForSelector("#viewer[data-light=whole]");
  const caption = page.locator("#panorama-text");
  await expect.poll(() => caption.textContent()).toMatch(withLibrary ? /invented$/ : /ahead$/);
  const json = JSON.parse((await saved(page, "#save-json")).toString());
  const hdr = decodedHdr(await saved(page, "#save-hdr"));
  await leave(/Failed to load resource/);
  expect(asked.some((url) => url.endsWith("detail.bin"))).toBe(true);
  return { seen: json.seen, hdr };
}

/** The same of Python. */
async function ofPython(file: string, ...options: string[]) {
  const { json, hdr } = await estimated(file, ...options);
  return { seen: JSON.parse(json).seen, hdr: decodedHdr(hdr) };
}

test.each(["coffee.jpg", "meadow.jpg"])("%s gets the detail that Python gives it", async (name) => {
  const file = fileURLToPath(new URL(name, PHOTOS));
  const [ours, theirs] = [await ofPage(file), await ofPython(file)];
  expect(ours.seen.detail_of).toBe(theirs.seen.detail_of);
  expect(ours.seen.elsewhere).toBe(theirs.seen.elsewhere);
  expect(apart(ours.hdr, theirs.hdr)).toBeLessThan(0.03); // RGBE steps by 0.8 %
  expect(apart(ours.hdr, (await ofPython(file, "--fill", "photo")).hdr)).toBeGreaterThan(0.1);
});

test("without the library the photo's own rows go on, as Python's", async () => {
  const file = fileURLToPath(new URL("meadow.jpg", PHOTOS));
  const [ours, theirs] = [await ofPage(file, false), await ofPython(file, "--fill", "photo")];
  expect(ours.seen.elsewhere).toBe(theirs.seen.elsewhere);
  expect(ours.seen.detail_of).toBeUndefined();
  expect(apart(ours.hdr, theirs.hdr)).toBeLessThan(0.03);
});

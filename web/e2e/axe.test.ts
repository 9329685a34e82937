/** What axe finds wrong with the page for people who cannot see, hear or point: nothing, in no state. */
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { launch, untilLit, visit } from "./browser.ts";
import { PHOTOS } from "./clip.ts";
import { type Site, serve } from "./python.ts";

const AXE = createRequire(import.meta.url).resolve("axe-core/axe.min.js");
const PHOTO = fileURLToPath(new URL("canteen.jpg", PHOTOS));
let site: Site;
let browser: Browser;
let axe: string;

beforeAll(async () => {
  [site, browser, axe] = await Promise.all([serve(), launch(), readFile(AXE, "utf8")]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

/** Each finding with the elements that it is about. */
async function findings(page: Page): Promise<string[]> {
  await page.evaluate(axe); // not a script element: the content policy forbids those
  return page.evaluate(async () => {
    const { violations } = await (
      window as unknown as { axe: { run(): Promise<{ violations: Finding[] }> } }
    ).axe.run();
    return violations.map(
      ({ id, nodes }) => `${id}: ${nodes.map((n) => n.target.join(" ")).join(", ")}`,
    );
  });
}

interface Finding {
  readonly id: string;
  readonly nodes: readonly { readonly target: readonly string[] }[];
}

test("axe finds nothing on the start screen, with a photo, in any tray, in a notice", async () => {
  const { page, leave } = await visit(browser, site.url, { reducedMotion: true });
  await page.waitForSelector("#examples button:nth-child(3)");
  expect(await findings(page), "start").toEqual([]);
  await page.setInputFiles("#photo-file", PHOTO);
  await untilLit(page);
  expect(await findings(page), "photo").toEqual([]);
  for (const tray of ["object", "material", "camera", "save"]) {
    await page.click(`[data-tray="${tray}"]`);
    expect(await findings(page), tray).toEqual([]);
  }
  await page.setInputFiles("#photo-file", {
    name: "a.jpg",
    mimeType: "image/jpeg",
    buffer: Buffer.from("no"),
  });
  await page.waitForSelector("#notice[open]");
  expect(await findings(page), "notice").toEqual([]);
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

/** The object given to the phone's own viewer, where the browser has no augmented reality. */
import { execFile } from "node:child_process";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { boxGlb } from "./box.ts";
import { launch, opensUsdz, untilLit, visit } from "./browser.ts";
import { PHOTOS } from "./clip.ts";
import { saved } from "./pictures.ts";
import { PYTHON, type Site, serve } from "./python.ts";

const CANTEEN = fileURLToPath(new URL("canteen.jpg", PHOTOS));
const READER = fileURLToPath(new URL("usdz.py", import.meta.url));
const IPHONE = "Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) Version/18.0 Mobile Safari";
const ANDROID = "Mozilla/5.0 (Linux; Android 15; Pixel 9) Chrome/140.0 Mobile Safari/537.36";
/** A name of the public network, as Scene Viewer wants it. */
const PUBLIC = "https://light.example/";
let site: Site;
let browser: Browser;

beforeAll(async () => {
  [site, browser] = await Promise.all([serve(), launch()]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

async function openPhoto(page: Page): Promise<void> {
  await page.setInputFiles("#photo-file", CANTEEN);
  await untilLit(page);
  await page.waitForSelector("#viewer[data-light=whole]");
  await page.click('[data-tray="object"]');
}

async function openBox(page: Page): Promise<void> {
  await page.setInputFiles("#model-file", {
    name: "box.glb",
    mimeType: "model/gltf-binary",
    buffer: boxGlb(),
  });
  await expect
    .poll(() => page.locator("#objects label:has(:checked)").textContent())
    .toContain("box");
}

interface Facts {
  readonly complaints: string[];
  readonly up: string;
  readonly triangles: number;
  readonly size: readonly number[];
  readonly metallic: readonly number[];
  readonly emits: readonly boolean[];
  readonly facing?: readonly [number, number, number];
}

async function handedOver(page: Page): Promise<Facts> {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#hand-over")]);
  expect(download.suggestedFilename()).toBe("deeplight.usdz");
  const file = `${await download.path()}.usdz`;
  await download.saveAs(file);
  const { stdout } = await promisify(execFile)(PYTHON, [READER, file]);
  return JSON.parse(stdout);
}

test("Quick Look gets what OpenUSD finds no fault with, lit from where the light is", async () => {
  const { page, leave } = await visit(browser, site.url, {
    userAgent: IPHONE,
    before: (to) => to.addInitScript(opensUsdz),
  });
  await openPhoto(page);
  expect(await page.isVisible("#hand-over-light")).toBe(true);
  const size = (await page.locator("#size-value").textContent())!; // of the longest side
  const bunny = await handedOver(page);
  expect(bunny).toMatchObject({ complaints: [], up: "Y", emits: [true], metallic: [0] });
  expect(bunny.triangles).toBeGreaterThan(1000);
  const asked = Number.parseFloat(size) / (size.includes("cm") ? 100 : 1);
  expect(Math.max(...bunny.size) / asked).toBeGreaterThan(0.8); // its bounds are turned with it
  expect(Math.max(...bunny.size) / asked).toBeLessThan(1.3);
  const { spherical_harmonics } = JSON.parse((await saved(page, "#save-json")).toString());
  const [even, , , x] = spherical_harmonics.spherical_harmonics_coefficients.map(
    ([r, g, b]: [number, number, number]) => r + g + b,
  );
  expect(Math.abs(x / even)).toBeGreaterThan(0.05); // from a side
  expect(Math.sign(bunny.facing![0])).toBe(Math.sign(x));
  expect(bunny.facing![1]).toBeGreaterThan(0); // from above
  // Another side of the object comes to the front, the light stays where it is.
  await page.click('[data-tray="object"]');
  await page.locator("#turn").fill("120");
  const turned = await handedOver(page);
  expect(Math.sign(turned.facing![0])).toBe(Math.sign(x));
  // A mirror shows the viewer's own surroundings: nothing is painted on it.
  await page.click('[data-tray="material"]');
  await page.getByText("Mirror", { exact: true }).click();
  await page.click('[data-tray="object"]');
  expect(await handedOver(page)).toMatchObject({ complaints: [], metallic: [1], emits: [false] });
  await openBox(page);
  expect(await handedOver(page)).toMatchObject({ complaints: [], triangles: 12, emits: [true] });
  await leave();
});

describe("Scene Viewer", () => {
  /** The page as if it stood on a public host. */
  const published = (page: Page) =>
    page.route(`${PUBLIC}**`, async (route) => {
      const url = route.request().url().replace(PUBLIC, site.url);
      await route.fulfill({ response: await route.fetch({ url }) });
    });

  /** Where a click on a link would lead. */
  function watchLinks(): void {
    addEventListener("click", (event) => {
      if (!(event.target instanceof HTMLAnchorElement)) return;
      event.preventDefault();
      document.documentElement.dataset.led = event.target.href;
    });
  }

  test("gets the address of the page's own object in its finish, on a public host", async () => {
    const before = async (page: Page) => {
      await published(page);
      await page.addInitScript(watchLinks);
    };
    const { page, leave } = await visit(browser, PUBLIC, { userAgent: ANDROID, before });
    await openPhoto(page);
    await page.click('[data-tray="material"]');
    await page.getByText("Glossy", { exact: true }).click();
    await page.click('[data-tray="object"]');
    await page.click("#hand-over");
    const led = await page.locator("html").getAttribute("data-led");
    const asked = new URL(led!.split("#")[0]!.replace("intent:", "https:"));
    const file = asked.searchParams.get("file")!;
    expect(file).toBe(`${PUBLIC}objects/bunny-glossy.gltf`);
    const own = await fetch(file.replace(PUBLIC, site.url));
    expect(own.headers.get("content-type")).toBe("model/gltf+json");
    const { buffers } = (await own.json()) as { buffers: { uri: string; byteLength: number }[] };
    const shape = await fetch(new URL(buffers[0]!.uri, file.replace(PUBLIC, site.url)));
    expect((await shape.arrayBuffer()).byteLength).toBe(buffers[0]!.byteLength);
    // The user's own object has no address.
    await openBox(page);
    await page.click("#hand-over");
    await page.waitForSelector('#notice[open][data-kind="no-scene-viewer"]');
    await leave();
  });

  test("is said to get nothing from a host that only this machine can reach", async () => {
    const { page, leave } = await visit(browser, site.url, { userAgent: ANDROID });
    await openPhoto(page);
    await page.click("#hand-over");
    await page.waitForSelector('#notice[open][data-kind="no-scene-viewer"]');
    await leave();
  });
});

test("a desktop offers neither", async () => {
  const { page, leave } = await visit(browser, site.url, { withoutModel: true });
  await page.click("#examples button:first-child");
  await page.click('[data-tray="object"]');
  expect(await page.isVisible("#own-object")).toBe(true);
  expect(await page.isVisible("#hand-over")).toBe(false);
  await leave();
});

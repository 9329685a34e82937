/** A photo in the built page: its light, its object, what can be done and taken away. */
import { mkdtemp, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { golden } from "../tests/golden.ts";
import { decodedHdr } from "../tests/hdr.ts";
import { boxGlb, LIT } from "./box.ts";
import { DESKTOP, launch, PHONE_LYING, untilLit, type Visit, visit } from "./browser.ts";
import { PHOTOS } from "./clip.ts";
import { apart, pixels, saved } from "./pictures.ts";
import { ballOf, estimated, farthest, type Site, serve } from "./python.ts";

const CANTEEN = fileURLToPath(new URL("canteen.jpg", PHOTOS));
const RACCOON = fileURLToPath(new URL("raccoon.jpg", PHOTOS)); // 4:3, on its side
const PAGODA = fileURLToPath(new URL("pagoda.jpg", PHOTOS)); // upright edges mend its pitch
const GLB = { name: "box.glb", mimeType: "model/gltf-binary" };
let site: Site;
let browser: Browser;

beforeAll(async () => {
  [site, browser] = await Promise.all([serve(), launch()]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

/** How far ln radiance may be off: decoders of JPEG differ a little. */
const NEAR = 5e-3;

interface LampEntry {
  readonly direction: readonly number[];
  readonly flux: readonly number[];
}

/** Opens a photo and waits until it stands in its light. */
async function openPhoto(page: Page, file: string): Promise<void> {
  await page.setInputFiles("#photo-file", file);
  await untilLit(page);
  await page.waitForSelector("#viewer[data-light=whole]");
}

/** Runs in the page: waits until the view has come back from where an open tray had moved it. */
async function atRest(view: Element): Promise<void> {
  await Promise.allSettled(view.getAnimations().map(({ finished }) => finished));
}

test.each([
  ["with a field of view in EXIF", CANTEEN],
  ["without", PAGODA],
  ["into which the network's view is slid", RACCOON],
])("a photo %s gets Python's light", async (_, file) => {
  const { page, leave } = await visit(browser, site.url);
  await openPhoto(page, file);
  const json = (await saved(page, "#save-json")).toString();
  const python = await estimated(file);
  const [ours, theirs] = [ballOf(json), ballOf(python.json)];
  expect(farthest(ours, theirs)).toBeLessThan(NEAR);
  const brighter = ours.map((value) => value + 2 * NEAR);
  expect(farthest(brighter, theirs)).toBeGreaterThan(NEAR);
  const [own, want] = [JSON.parse(json), JSON.parse(python.json)];
  expect(own.lamps.lamps.length).toBe(want.lamps.lamps.length);
  own.lamps.lamps.forEach((lamp: LampEntry, i: number) => {
    const other: LampEntry = want.lamps.lamps[i];
    const cosine = lamp.direction.reduce((sum, value, c) => sum + value * other.direction[c]!, 0);
    expect(cosine).toBeGreaterThan(0.9999);
    lamp.flux.forEach((value, c) => {
      expect(value / other.flux[c]!).toBeCloseTo(1, 1);
    });
  });
  const hdr = decodedHdr(await saved(page, "#save-hdr"));
  expect(apart(hdr, decodedHdr(python.hdr))).toBeLessThan(0.03); // RGBE steps by 0.8 %
  await leave();
});

/** PAGODA with the EXIF data of a golden photo. */
async function tilted(name: string): Promise<string> {
  const file = Buffer.from(golden("exif")[name].file, "base64");
  const start = file.indexOf("ffe1", 0, "hex");
  const exif = file.subarray(start, start + 2 + file.readUInt16BE(start + 2));
  const path = join(await mkdtemp(join(tmpdir(), "deeplight-")), "tilted.jpg");
  const plain = await readFile(PAGODA);
  await writeFile(path, Buffer.concat([plain.subarray(0, 2), exif, plain.subarray(2)]));
  return path;
}

test("a photo that says how the camera was tilted goes on all around as Python's", async () => {
  const { page, leave } = await visit(browser, site.url);
  const file = await tilted("orientation 1");
  await openPhoto(page, file);
  expect(await page.textContent("#tilt-value")).toBe("38°");
  const hdr = decodedHdr(await saved(page, "#save-hdr"));
  const [upwards, without] = await Promise.all([file, PAGODA].map((one) => estimated(one)));
  expect(apart(hdr, decodedHdr(upwards!.hdr))).toBeLessThan(0.03);
  expect(apart(hdr, decodedHdr(without!.hdr))).toBeGreaterThan(0.1);
  await leave();
});

describe("with one photo", () => {
  let page: Page;
  let leave: Visit["leave"];
  beforeAll(async () => {
    ({ page, leave } = await visit(browser, site.url));
    await openPhoto(page, CANTEEN);
  });
  afterAll(() => leave());

  test("the picture is the photo, with an object and its shadow only where it stands", async () => {
    const photo = await pixels(page, await readFile(CANTEEN));
    const picture = await pixels(page, await saved(page, "#save-picture"));
    expect([picture.width, picture.height]).toEqual([photo.width, photo.height]);
    const strips: readonly (readonly [number, number, number, number])[] = [
      [0, 0, 1, 0.3],
      [0, 0.3, 0.1, 1],
      [0.9, 0.3, 1, 1],
    ];
    for (const strip of strips) {
      for (const channel of [0, 1, 2]) {
        expect(picture.mean(...strip, channel)).toBeCloseTo(photo.mean(...strip, channel), 0);
      }
    }
    const [x, y] = [0.5, 0.64]; // the bunny's body
    expect(Math.abs(picture.at(x, y)[0]! - photo.at(x, y)[0]!)).toBeGreaterThan(10);
    const hdr = (await saved(page, "#save-hdr")).toString("latin1");
    expect(hdr).toMatch(/^#\?RADIANCE\n[\s\S]*-Y 256 \+X 512\n/);
  });

  test("the object is dragged, turned and scaled", async () => {
    await page.click('[data-tray="object"]');
    const shown = async (): Promise<(string | null)[]> => [
      await page.textContent("#turn-value"),
      await page.textContent("#size-value"),
    ];
    const before = await shown();
    await page.mouse.move(195, 500);
    await page.mouse.wheel(0, -300);
    await page.keyboard.down("Shift");
    await page.mouse.wheel(0, 120);
    await page.keyboard.up("Shift");
    await expect.poll(shown).not.toEqual(before);
    const [turn, size] = await shown();
    expect(turn).not.toBe(before[0]);
    expect(size).not.toBe(before[1]);
    const still = await pixels(page, await saved(page, "#save-picture"));
    await page.mouse.move(195, 560);
    await page.mouse.down();
    await page.mouse.move(300, 640, { steps: 4 });
    await page.mouse.up();
    const moved = await pixels(page, await saved(page, "#save-picture"));
    expect(moved.at(0.5, 0.62)).not.toEqual(still.at(0.5, 0.62));
  });

  test("a tap places the object where the floor is, and not in the sky", async () => {
    await page.locator("#view").press("Home");
    await page.click('[data-tray="save"]'); // closes it
    const photo = await pixels(page, await readFile(CANTEEN));
    await page.locator("#view").evaluate(atRest);
    const box = (await page.locator("#view").boundingBox())!;
    const tap = (x: number, y: number) =>
      page.mouse.click(box.x + x * box.width, box.y + y * box.height);
    const changed = async (x: number, y: number) => {
      const picture = await pixels(page, await saved(page, "#save-picture"));
      await page.click('[data-tray="save"]');
      await page.locator("#view").evaluate(atRest);
      return Math.abs(picture.at(x, y)[0]! - photo.at(x, y)[0]!);
    };
    expect(await changed(0.3, 0.72)).toBeLessThan(10);
    await tap(0.3, 0.78); // its foot
    expect(await changed(0.3, 0.72)).toBeGreaterThan(10);
    await tap(0.3, 0.12);
    expect(await changed(0.3, 0.06)).toBeLessThan(10); // far away on the floor instead
    expect(await changed(0.3, 0.72)).toBeLessThan(10);
    await page.locator("#view").press("Home");
  });

  test("a ring shows where a tap would place it: on the floor, not in the sky", async () => {
    await page.locator("#view").press("Home");
    await page.locator("#view").evaluate(atRest);
    const box = (await page.locator("#view").boundingBox())!;
    const [floor, sky] = [0.78, 0.12].map((down) => ({
      x: box.x + 0.25 * box.width,
      y: box.y + down * box.height,
    })) as [{ x: number; y: number }, { x: number; y: number }];
    const around = ({ x, y }: typeof floor) =>
      page.screenshot({ clip: { x: x - 60, y: y - 30, width: 120, height: 60 } });
    const aimedAt = async ({ x, y }: typeof floor) => {
      await page.mouse.move(x, y);
      await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(drawn)));
    };
    await aimedAt(sky);
    const [bare, clouds] = [await around(floor), await around(sky)];
    await aimedAt(floor);
    await expect.poll(async () => (await around(floor)).equals(bare)).toBe(false);
    expect((await around(sky)).equals(clouds)).toBe(true);
    await aimedAt(sky);
    await expect.poll(async () => (await around(floor)).equals(bare)).toBe(true);
    expect((await around(sky)).equals(clouds)).toBe(true);
  });

  test("an open tray does not cover the object", async () => {
    await page.locator("#view").press("Home");
    const [foot, height] = [0.7, 844]; // where it stands at first, of the view
    const tops: number[] = [];
    for (const tray of ["object", "material", "camera", "save"]) {
      await page.click(`[data-tray="${tray}"]`);
      await page.locator("#view").evaluate(atRest);
      const [view, panel] = await Promise.all(
        ["#view", `#tray-${tray}`].map(async (part) => (await page.locator(part).boundingBox())!),
      );
      expect(view!.y + foot * view!.height, tray).toBeLessThan(panel!.y);
      tops.push(panel!.y);
    }
    expect(Math.min(...tops)).toBeLessThan(foot * height); // it would
    await page.click('[data-tray="save"]');
    await page.locator("#view").evaluate(atRest);
    expect((await page.locator("#view").boundingBox())!.y).toBeCloseTo(0, 0);
  });

  test("every material is another picture", async () => {
    await page.locator("#view").press("Home");
    const seen: string[] = [];
    for (const material of ["Grey", "Matte silver", "Mirror", "Glossy"]) {
      await page.click('[data-tray="material"]');
      await page.getByText(material, { exact: true }).click();
      const picture = await pixels(page, await saved(page, "#save-picture"));
      seen.push(`${picture.at(0.53, 0.64)} ${picture.at(0.5, 0.62)}`); // one pixel may coincide
    }
    expect(new Set(seen).size).toBe(4);
  });

  test("the user's own .glb stands there in its own colours; a broken one is refused", async () => {
    await page.locator("#view").press("Home");
    await page.setInputFiles("#model-file", { ...GLB, buffer: boxGlb() });
    await page.waitForSelector("#objects >> text=box.glb", { state: "attached" });
    const picture = await pixels(page, await saved(page, "#save-picture"));
    const [red, green] = picture.at(0.5, 0.62);
    expect(red).toBeGreaterThan(2 * green!);
    await page.setInputFiles("#model-file", { ...GLB, name: "lit.glb", buffer: boxGlb(LIT) });
    await page.waitForSelector("#objects >> text=lit.glb", { state: "attached" });
    const lit = await pixels(page, await saved(page, "#save-picture"));
    expect(lit.at(0.5, 0.62)).toEqual(picture.at(0.5, 0.62)); // by the photo's light alone
    await page.setInputFiles("#model-file", { ...GLB, buffer: boxGlb().subarray(0, 900) });
    await page.waitForSelector('#notice[data-kind="glb-broken"]');
    await page.keyboard.press("Escape");
    const again = await pixels(page, await saved(page, "#save-picture"));
    expect(again.at(0.5, 0.62)).toEqual([red, green, picture.at(0.5, 0.62)[2]]);
  });
});

test("an example opens with one click, and its light is there within seconds", async () => {
  const { page, leave } = await visit(browser, site.url, { viewport: DESKTOP });
  await page.click("#examples button");
  await untilLit(page);
  const sinceLoad = await page.evaluate(() => performance.now());
  console.log(`first light ${(sinceLoad / 1000).toFixed(1)} s after the page was asked for`);
  expect(await page.textContent("#meter-text")).toMatch(/^[\d.]+ ms$/);
  expect(await page.textContent("#status")).toMatch(/Light estimated/);
  await page.goBack();
  await page.waitForSelector("#start:visible");
  await leave();
});

test("everything works with the keyboard alone", async () => {
  const { page, leave } = await visit(browser, site.url, { reducedMotion: true });
  const focused = (): Promise<string> =>
    page.evaluate(() => document.activeElement?.id || document.activeElement?.textContent || "");
  await page.waitForSelector("#examples button:nth-child(3)");
  for (let i = 0; i < 3; i++) await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await untilLit(page);
  expect(await focused()).toBe("view");
  const before = await page.locator("#view").screenshot();
  for (const key of ["ArrowRight", "ArrowRight", "ArrowDown", "e", "+"])
    await page.keyboard.press(key);
  await page.waitForTimeout(300);
  expect((await page.locator("#view").screenshot()).equals(before)).toBe(false);
  while ((await focused()) !== "Material") await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  await page.waitForSelector("#tray-material:visible");
  expect(
    await page.locator("#tray-material").evaluate((tray) => getComputedStyle(tray).animationName),
  ).toBe("none");
  while (!(await page.evaluate(() => document.activeElement?.matches("#materials input")))) {
    await page.keyboard.press("Shift+Tab");
  }
  await page.keyboard.press("ArrowRight");
  expect(await page.inputValue("#materials input:checked")).toBe("silver");
  await page.keyboard.press("Escape");
  await page.waitForSelector("#tray-material", { state: "hidden" });
  await leave();
});

/** Runs before the page: keeps what it would do with files that the system opens it with. */
function installed(): void {
  const queue = {
    setConsumer(take: (launch: { files: readonly { getFile(): Promise<File> }[] }) => void) {
      Object.assign(window, {
        openWith(name: string, type: string, text: string | null) {
          const bytes = Uint8Array.from(atob(text ?? ""), (letter) => letter.charCodeAt(0));
          const file = new File([bytes], name, { type });
          take({ files: text === null ? [] : [{ getFile: () => Promise.resolve(file) }] });
        },
      });
    },
  };
  Object.defineProperty(window, "launchQueue", { value: queue });
}

test("the installed page opens with a photo, then with a .glb, and with nothing", async () => {
  const { page, leave } = await visit(browser, site.url, {
    before: (of) => of.addInitScript(installed),
  });
  const manifest = await (await fetch(new URL("manifest.webmanifest", site.url))).json();
  const [handler] = manifest.file_handlers;
  expect(new URL(handler.action, site.url).href).toBe(site.url);
  const openWith = (name: string, type: string, content: Buffer | null): Promise<void> => {
    const endings: string[] = handler.accept[type];
    expect(endings.some((ending) => name.endsWith(ending))).toBe(true); // the system asks it for these
    const of = [name, type, content?.toString("base64") ?? null] as const;
    // biome-ignore lint/suspicious/noExplicitAny: of `installed`
    return page.evaluate((all) => (window as any).openWith(...all), of);
  };
  await openWith("none.jpg", "image/jpeg", null); // from the home screen
  expect(await page.isVisible("#start")).toBe(true);
  await openWith("pagoda.jpg", "image/jpeg", await readFile(PAGODA));
  await page.waitForSelector("#viewer[data-light=whole]");
  const { photo } = JSON.parse((await saved(page, "#save-json")).toString());
  expect(photo.file).toBe("pagoda.jpg");
  await openWith("box.glb", "model/gltf-binary", boxGlb());
  await page.waitForSelector("#objects >> text=box.glb", { state: "attached" });
  await leave();
});

test("a photo can be dropped, and the phone turned", async () => {
  const { page, leave } = await visit(browser, site.url);
  const text = (await readFile(PAGODA)).toString("base64");
  await page.evaluate((content) => {
    const bytes = Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0));
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([bytes], "dropped.jpg", { type: "image/jpeg" }));
    document.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
  }, text);
  await untilLit(page);
  const box = async () => (await page.locator("#view").boundingBox())!;
  const upright = await box();
  expect(upright.width).toBeCloseTo(390, 0); // a lying photo is shown whole
  expect(upright.width / upright.height).toBeCloseTo(640 / 427, 1);
  await page.setViewportSize(PHONE_LYING);
  await expect.poll(async () => (await box()).width).toBeGreaterThan(500);
  const lying = await box();
  expect(lying.height).toBeLessThanOrEqual(390);
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(844);
  await leave();
});

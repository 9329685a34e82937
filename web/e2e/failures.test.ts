/** Every failure has a sentence and a button that leads on. */
import { fileURLToPath } from "node:url";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { launch, untilLit, visit } from "./browser.ts";
import { PHOTOS } from "./clip.ts";
import { type Site, serve } from "./python.ts";

const PIXEL = Buffer.from("R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7", "base64");
const CANTEEN = fileURLToPath(new URL("canteen.jpg", PHOTOS));
let site: Site;
let browser: Browser;

beforeAll(async () => {
  [site, browser] = await Promise.all([serve(), launch()]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

/** The notice is open, says something and its first button has the focus. */
async function shows(page: Page, kind: string, remedy: string): Promise<void> {
  await page.waitForSelector(`#notice[open][data-kind="${kind}"]`);
  expect((await page.textContent("#notice-title"))!.length).toBeGreaterThan(5);
  expect((await page.textContent("#notice-text"))!.length).toBeGreaterThan(30);
  expect(await page.isVisible(`#notice [data-remedy="${remedy}"]`)).toBe(true);
  expect(await page.evaluate(() => document.activeElement?.closest("#notice") !== null)).toBe(true);
}

/** getUserMedia that fails as the browser's would. */
const cameraFails = (name: string) => (page: Page) =>
  page.addInitScript((error) => {
    navigator.mediaDevices.getUserMedia = () => Promise.reject(new DOMException("", error));
  }, name);

test("no camera: a photo instead", async () => {
  const { page, leave } = await visit(browser, site.url);
  await page.click("#open-camera");
  await shows(page, "no-camera", "photo");
  const [chooser] = await Promise.all([
    page.waitForEvent("filechooser"),
    page.click('#notice [data-remedy="photo"]'),
  ]);
  await chooser.setFiles(CANTEEN);
  await untilLit(page);
  await leave();
});

test.each([
  ["NotAllowedError", "denied"],
  ["NotReadableError", "camera-busy"],
])("%s is shown as %s, and the camera can be tried again", async (error, kind) => {
  const { page, leave } = await visit(browser, site.url, {
    withoutModel: true,
    before: cameraFails(error),
  });
  await page.click("#open-camera");
  await shows(page, kind, "camera");
  await page.click('#notice [data-remedy="camera"]');
  await shows(page, kind, "photo");
  await page.keyboard.press("Escape");
  expect(await page.isVisible("#open-camera")).toBe(true);
  await leave();
});

test("an address that is not safe", async () => {
  const before = (page: Page) =>
    page.addInitScript(() => {
      Object.defineProperty(navigator, "mediaDevices", { value: undefined });
      Object.defineProperty(window, "isSecureContext", { value: false });
    });
  const { page, leave } = await visit(browser, site.url, { withoutModel: true, before });
  await page.click("#open-camera");
  await shows(page, "insecure", "photo");
  await leave();
});

test("the model is missing, then there", async () => {
  let isThere = false;
  const before = (page: Page) =>
    page.route("**/deeplight.onnx", (route) =>
      isThere ? route.continue() : route.fulfill({ status: 404, body: "" }),
    );
  const { page, leave } = await visit(browser, site.url, { before });
  await page.click("#examples button");
  await shows(page, "model-missing", "retry");
  isThere = true;
  await page.click('#notice [data-remedy="retry"]');
  await untilLit(page);
  await leave(/404/);
});

test("the model is damaged", async () => {
  const before = (page: Page) =>
    page.route("**/deeplight.onnx", (route) => route.fulfill({ body: "<html>no model</html>" }));
  const { page, leave } = await visit(browser, site.url, { before });
  await page.click("#examples button");
  await shows(page, "model-damaged", "retry");
  await leave();
});

test("WebAssembly is missing", async () => {
  const before = (page: Page) =>
    page.route("**/estimate-worker-*.js", async (route) => {
      const response = await route.fetch();
      await route.fulfill({ response, body: `delete self.WebAssembly;${await response.text()}` });
    });
  const { page, leave } = await visit(browser, site.url, { before });
  await page.click("#examples button");
  await shows(page, "runtime", "retry");
  await leave();
});

test("an object's file is missing; the light is there all the same", async () => {
  const before = (page: Page) =>
    page.route("**/pot.transfer", (route) => route.fulfill({ status: 404 }));
  const { page, leave } = await visit(browser, site.url, { before });
  await page.click("#examples button");
  await untilLit(page);
  await page.click('[data-tray="object"]');
  await page.getByText("Teapot").click();
  await shows(page, "object-missing", "retry");
  await page.keyboard.press("Escape");
  expect(await page.inputValue("#objects input:checked")).toBe("bunny");
  await leave(/404/);
});

test("no WebGL", async () => {
  const before = (page: Page) =>
    page.addInitScript(() => {
      HTMLCanvasElement.prototype.getContext = () => null;
    });
  const { page, leave } = await visit(browser, site.url, { withoutModel: true, before });
  await shows(page, "no-webgl", "reload");
  await leave(/WebGL/);
});

test("a photo takes the notice of another one back, and one that opens late does not replace it", async () => {
  const { page, leave } = await visit(browser, site.url, { withoutModel: true });
  const pixel = { name: "pixel.gif", mimeType: "image/gif", buffer: PIXEL };
  await page.setInputFiles("#photo-file", pixel);
  await shows(page, "photo-too-small", "photo");
  await page.evaluate(() => {
    const open = createImageBitmap;
    window.createImageBitmap = (async (file: ImageBitmapSource) => {
      if ((file as File).name === "pixel.gif")
        await new Promise((later) => setTimeout(later, 2000));
      return open(file);
    }) as typeof createImageBitmap;
  });
  await page.setInputFiles("#photo-file", pixel);
  await page.setInputFiles("#photo-file", CANTEEN);
  await page.waitForSelector("#notice", { state: "hidden" });
  await page.waitForTimeout(3000);
  expect(await page.isVisible("#notice")).toBe(false);
  await leave();
});

test("a photo that waits for the model says how much of it is there", async () => {
  const before = async (page: Page) => {
    const network = await page.context().newCDPSession(page);
    await network.send("Network.enable");
    const downloadThroughput = 1_500_000; // bytes a second: the model takes some
    const how = { offline: false, latency: 0, downloadThroughput, uploadThroughput: -1 };
    await network.send("Network.emulateNetworkConditions", how);
  };
  const { page, leave } = await visit(browser, site.url, { before });
  await page.setInputFiles("#photo-file", CANTEEN);
  await expect.poll(() => page.textContent("#meter")).toMatch(/model [1-9]\d? %/);
  await untilLit(page);
  expect(await page.textContent("#meter")).not.toMatch(/model/);
  await leave();
});

test.each([
  ["a text", "photo-unreadable", Buffer.from("no photo")],
  ["100 megabytes", "photo-too-large", Buffer.alloc(1)],
  ["a single pixel", "photo-too-small", PIXEL],
])("%s instead of a photo", async (_, kind, buffer) => {
  const { page, leave } = await visit(browser, site.url, { withoutModel: true });
  if (kind === "photo-too-large") {
    await page.evaluate(() => {
      Object.defineProperty(File.prototype, "size", { get: () => 101e6 });
    });
  }
  await page.setInputFiles("#photo-file", { name: "a.jpg", mimeType: "image/jpeg", buffer });
  await shows(page, kind, "photo");
  await leave();
});

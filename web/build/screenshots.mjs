// node build/screenshots.mjs URL: takes the pictures of docs/demo.md from a running `deeplight demo`.
import { mkdtemp, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import path from "node:path";
import { chromium } from "playwright-core";

const [url] = process.argv.slice(2);
const folder = await mkdtemp(path.join(tmpdir(), "deeplight-pictures-"));
const clip = path.join(folder, "clip.mjpeg");
const photo = await readFile(new URL("../../examples/photos/hall.jpg", import.meta.url));
await writeFile(clip, Buffer.concat([photo, photo])); // a camera on a tripod
const browser = await chromium.launch({
  executablePath: process.env.DEEPLIGHT_CHROMIUM ?? "/usr/bin/chromium",
  args: [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--use-fake-device-for-media-stream",
    "--use-fake-ui-for-media-stream",
    `--use-file-for-fake-video-capture=${clip}`,
  ],
});

const PHONE = [390, 844];
/** How often plus is pressed, so that the object is seen well in a small picture. */
const LARGER = 4;
const shots = [
  { size: PHONE, show: async () => {} },
  { size: PHONE, show: (page) => view(page, 3, "Bunny", "Mirror", "material") },
  { size: PHONE, show: live },
  { size: [1280, 800], show: (page) => view(page, 1, "Bunny", "Matte silver", null) },
  { size: [844, 390], show: (page) => view(page, 2, "Ball", "Mirror", null) },
];

async function view(page, example, object, material, tray) {
  await page.click(`#examples button:nth-child(${example})`);
  await page.waitForSelector("#save-json:enabled", { state: "attached", timeout: 120_000 });
  await choose(page, object, material, tray);
}

async function live(page) {
  await page.click("#open-camera");
  await page.waitForSelector("#save-json:enabled", { state: "attached", timeout: 120_000 });
  await choose(page, "Teapot", "Glossy", null);
}

async function choose(page, object, material, tray) {
  await page.waitForSelector("#viewer[data-light=whole]", { timeout: 120_000 });
  for (let i = 0; i < LARGER; i++) await page.locator("#view").press("+");
  await page.click('[data-tray="object"]');
  await page.getByText(object, { exact: true }).click();
  await page.click('[data-tray="material"]');
  await page.getByText(material, { exact: true }).click();
  await page.click(`[data-tray="${tray ?? "material"}"]`);
  if (tray === "material") await page.click('[data-tray="material"]');
}

const pictures = [];
for (const { size, show } of shots) {
  const [width, height] = size;
  const context = await browser.newContext({
    viewport: { width, height },
    deviceScaleFactor: 1.5,
    serviceWorkers: "block",
  });
  const page = await context.newPage();
  await page.goto(url);
  await page.waitForSelector("#loading", { state: "hidden", timeout: 120_000 });
  await show(page);
  await page.mouse.move(width / 2, 2);
  await page.waitForTimeout(6000); // the spheres are drawn one by one
  pictures.push((await page.screenshot()).toString("base64"));
  await context.close();
}

const page = await browser.newPage({ viewport: { width: 1440, height: 620 } });
const shown = ([name, text]) => `<img class="${name}" src="data:image/png;base64,${text}">`;
const names = ["phone", "phone", "phone", "desktop", "lying"];
const [a, b, c, d, e] = pictures.map((text, i) => shown([names[i], text]));
await page.setContent(`<style>
  body { margin: 0; padding: 16px; display: flex; gap: 16px; background: #e9e7e2; }
  div { display: flex; flex-direction: column; gap: 16px; align-items: center; }
  img { border-radius: 14px; display: block; }
  .phone { height: 588px; } .desktop { width: 540px; } .lying { width: 508px; }
</style>${a}${b}${c}<div>${d}${e}</div>`);
const file = new URL("../../docs/pictures/demo.jpg", import.meta.url).pathname;
await page.screenshot({ path: file, type: "jpeg", quality: 82 });
await browser.close();

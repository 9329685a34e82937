/** Many frames of one place: the page's light is Python's, and the page keeps up with the camera. */
import { execFile } from "node:child_process";
import { mkdtemp, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { type Matrix3x3, product } from "deeplight/core";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { npzArrays, npzFile } from "../packages/deeplight/src/save/npz.ts";
import { worldFromCamera } from "../src/sensors/pose.ts";
import { launch, untilLit, visit } from "./browser.ts";
import { makeClip } from "./clip.ts";
import { saved } from "./pictures.ts";
import { PYTHON, type Site, serve } from "./python.ts";

const FRAMES = 8;
let site: Site;
let browser: Browser;
let folder: string;

beforeAll(async () => {
  folder = await mkdtemp(path.join(tmpdir(), "deeplight-fuse-"));
  const clip = await makeClip(folder);
  [site, browser] = await Promise.all([serve(), launch(clip)]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

/** A frame that went into the light, and the light after it where that was asked for. */
interface Recorded {
  readonly rotation: readonly number[];
  readonly image: ImageData;
  readonly light: { radiance: Float32Array; seen: Float32Array; height: number } | null;
}

declare global {
  interface Window {
    recorded: Recorded[];
  }
}

/** Runs in the page before its own scripts: notes what goes to the worker and what comes back. */
function watchWorkers(): void {
  window.recorded = [];
  const sent: { image: ImageData; rotation: readonly number[] | null }[] = [];
  const pictureOf = (frame: VideoFrame): ImageData => {
    const canvas = new OffscreenCanvas(frame.displayWidth, frame.displayHeight);
    const context = canvas.getContext("2d", { willReadFrequently: true })!;
    context.drawImage(frame, 0, 0);
    return context.getImageData(0, 0, canvas.width, canvas.height);
  };
  const Plain = window.Worker;
  window.Worker = class extends Plain {
    constructor(...args: ConstructorParameters<typeof Plain>) {
      super(...args);
      this.addEventListener("message", ({ data }) => {
        if (!data.tracked) return;
        const { image, rotation } = sent.shift()!;
        const { added, light, worldFromCamera } = data.tracked;
        if (added && window.recorded.length < 40) {
          window.recorded.push({ image, rotation: rotation ?? worldFromCamera, light });
        }
      });
    }

    // biome-ignore lint/suspicious/noExplicitAny: any message passes
    override postMessage(message: any, more?: any) {
      const { frame, track } = message;
      if (track) sent.push({ image: pictureOf(frame), rotation: track.worldFromCamera });
      super.postMessage(message, more);
    }
  };
}

/** Turns the phone, evenly, as its sensors say it. */
function turnPhone(): void {
  let step = 0;
  setInterval(() => {
    const angles = { alpha: 1.5 * step++, beta: 80 + 4 * Math.sin(step / 9), gamma: 0 };
    dispatchEvent(new DeviceOrientationEvent("deviceorientation", angles));
  }, 40);
}

/** The frames up to the last light, as files for Python, and that light. */
async function kept(page: Page): Promise<{ light: Float32Array; rows: number }> {
  const { frames, light, rows } = await page.evaluate(async () => {
    const last = window.recorded.findLastIndex((one) => one.light !== null);
    const text = (bytes: Uint8Array) => {
      let letters = "";
      for (let i = 0; i < bytes.length; i += 8192) {
        letters += String.fromCharCode(...bytes.subarray(i, i + 8192));
      }
      return btoa(letters);
    };
    const frames = window.recorded.slice(0, last + 1).map(async ({ image, rotation, light }) => {
      const canvas = new OffscreenCanvas(image.width, image.height);
      canvas.getContext("2d")!.putImageData(image, 0, 0);
      const blob = await canvas.convertToBlob({ type: "image/png" });
      return {
        rotation,
        isLit: light !== null,
        png: text(new Uint8Array(await blob.arrayBuffer())),
      };
    });
    const { radiance, seen, height } = window.recorded[last]!.light!;
    const values = new Float32Array([...radiance, ...seen]);
    const light = text(new Uint8Array(values.buffer));
    return { frames: await Promise.all(frames), light, rows: height };
  });
  const named = frames.map(({ png: _, ...frame }, i) => ({ ...frame, file: `${i}.png` }));
  for (const [i, { png }] of frames.entries()) {
    await writeFile(path.join(folder, `${i}.png`), Buffer.from(png, "base64"));
  }
  await writeFile(path.join(folder, "frames.json"), JSON.stringify({ frames: named, rows }));
  return { light: floatsOf(Buffer.from(light, "base64")), rows };
}

const floatsOf = (bytes: Buffer): Float32Array => new Float32Array(Uint8Array.from(bytes).buffer);

/** What Python's session makes of the same frames. */
async function ofPython(): Promise<Float32Array> {
  const script = fileURLToPath(new URL("fused.py", import.meta.url));
  await promisify(execFile)(PYTHON, [script, folder]);
  return floatsOf(await readFile(path.join(folder, "light.f32")));
}

/** Differences of ln radiance, least first, of the part of two panoramas that is no `seen` map. */
function differences(ours: Float32Array, python: Float32Array, rows: number): Float32Array {
  expect(ours.length).toBe(python.length);
  const radiance = ours.subarray(0, 6 * rows * rows);
  return radiance.map((value, i) => Math.abs(Math.log(value / python[i]!))).sort();
}

test("with sensors the light of many frames is Python's within 2e-2 in ln radiance", async () => {
  const { page, leave } = await visit(browser, site.url, {
    before: (of) => of.addInitScript(watchWorkers),
  });
  await page.click("#open-camera");
  await page.evaluate(turnPhone);
  await untilLit(page);
  await page.waitForFunction((least) => window.recorded.length >= least, FRAMES);
  await page.waitForFunction(() => window.recorded.at(-1)!.light !== null);
  const { light, rows } = await kept(page);
  const python = await ofPython();
  const off = differences(light, python, rows);
  console.log(
    "ln off, median, 99 %, most:",
    [0.5, 0.99, 1].map((p) => off[Math.floor(p * (off.length - 1))]),
  );
  expect(off[Math.floor(0.99 * off.length)]).toBeLessThan(2e-2);
  const seen = 6 * rows * rows;
  const apart = light.subarray(seen).map((value, i) => Math.abs(value - python[seen + i]!));
  expect(Math.max(...apart)).toBeLessThan(2e-2);
  const brighter = differences(
    light.map((value) => 1.03 * value),
    python,
    rows,
  );
  expect(brighter[Math.floor(0.99 * brighter.length)]).toBeGreaterThan(2e-2);
  await leave();
});

test("without sensors the pictures say how the phone turns, and the ring fills", async () => {
  const { page, leave } = await visit(browser, site.url, {
    before: (of) => of.addInitScript(watchWorkers),
  });
  await page.click("#open-camera");
  await untilLit(page);
  await page.waitForFunction(() => window.recorded.length >= 6);
  const turns = await page.evaluate(() => window.recorded.map(({ rotation }) => [...rotation]));
  const across = turns.map((m) => Math.atan2(-m[2]!, m[8]!));
  expect(Math.max(...across) - Math.min(...across)).toBeGreaterThan(0.02); // the clip is panned
  expect(await page.getAttribute("#around", "aria-label")).toMatch(/^[1-9]\d? % of all directions/);
  await page.click("#around");
  expect(await page.textContent("#status")).toMatch(/forgotten/);
  await leave();
});

test("what was seen can be taken away: as .hdr, as .json, as a picture of all around", async () => {
  const { page, leave } = await visit(browser, site.url);
  await page.click("#open-camera");
  await untilLit(page);
  const hdr = (await saved(page, "#save-hdr")).toString("latin1");
  expect(hdr).toMatch(/^#\?RADIANCE\n[\s\S]*-Y 512 \+X 1024\n/);
  const json = JSON.parse((await saved(page, "#save-json")).toString());
  expect(json.seen.width).toBe(128);
  expect(json.notes.join()).toMatch(/camera's frames/);
  const picture = await saved(page, "#save-panorama");
  expect(picture.subarray(0, 2).toString("hex")).toBe("ffd8");
  await leave();
});

test("what was seen is a file that the page goes on from; another file is refused", async () => {
  const { page, leave } = await visit(browser, site.url);
  await page.click("#open-camera");
  await untilLit(page);
  const buffer = await saved(page, "#save-session");
  expect(buffer.subarray(0, 2).toString()).toBe("PK");
  await page.click("#close");
  const file = { name: "place.npz", mimeType: "application/octet-stream", buffer };
  await page.setInputFiles("#session-file", file); // opens the camera, too
  await page.waitForFunction(() =>
    /Opened \d+/.test(document.querySelector("#status")!.textContent!),
  );
  await untilLit(page);
  // The same place by another compass: the object stays in sight.
  await page.setInputFiles("#session-file", { ...file, buffer: turnedAside(buffer) });
  await page.waitForTimeout(3000);
  await page.click("#freeze");
  const inMaterial = async (name: string) => {
    await page.click('[data-tray="material"]');
    await page.getByText(name, { exact: true }).click();
    return saved(page, "#save-picture");
  };
  const grey = await inMaterial("Grey");
  expect((await inMaterial("Grey")).equals(grey)).toBe(true);
  expect((await inMaterial("Mirror")).equals(grey)).toBe(false);
  await page.setInputFiles("#session-file", { ...file, buffer: buffer.subarray(0, 999) });
  await page.waitForSelector("#notice[open]");
  expect(await page.textContent("#notice-title")).toBe("This file cannot be read");
  await leave();
});

/** A saved place whose world is turned by 120 degrees. */
function turnedAside(file: Buffer): Buffer {
  const arrays = new Map(npzArrays(new Uint8Array(file)));
  const aside = worldFromCamera((2 * Math.PI) / 3, 0);
  for (const name of ["rotations", "first_turn"]) {
    const { shape, values } = arrays.get(name)!;
    const turned = Float64Array.from(values as Float64Array);
    for (let at = 0; at < turned.length; at += 9) {
      const own = [...turned.subarray(at, at + 9)] as unknown as Matrix3x3;
      turned.set(product(aside, own), at);
    }
    arrays.set(name, { shape, values: turned });
  }
  return Buffer.from(npzFile(Object.fromEntries(arrays)));
}

/** Pixels of what the page saves and shows. */
import { readFile } from "node:fs/promises";
import type { Page } from "playwright-core";

/** What a click on a button of the page downloads. */
export async function saved(page: Page, button: string): Promise<Buffer> {
  if (!(await page.isVisible("#tray-save"))) await page.click('[data-tray="save"]');
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
  return readFile(await download.path());
}

export interface Pixels {
  readonly width: number;
  readonly height: number;
  /** RGB at shares of the width and height. */
  at(x: number, y: number): readonly number[];
  /** Mean of a channel over a part, from and to shares. */
  mean(left: number, top: number, right: number, bottom: number, channel: number): number;
}

/** A JPEG or PNG file, decoded by the browser. */
export async function pixels(page: Page, file: Buffer): Promise<Pixels> {
  const { width, height, rgba } = await page.evaluate(async (text) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes]));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d")!;
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    let letters = "";
    for (let i = 0; i < data.length; i += 8192) {
      letters += String.fromCharCode(...data.subarray(i, i + 8192));
    }
    return { width: bitmap.width, height: bitmap.height, rgba: btoa(letters) };
  }, file.toString("base64"));
  const data = Buffer.from(rgba, "base64");
  const offset = (x: number, y: number): number =>
    4 *
    (Math.min(Math.floor(y * height), height - 1) * width +
      Math.min(Math.floor(x * width), width - 1));
  return {
    width,
    height,
    at: (x, y) => [...data.subarray(offset(x, y), offset(x, y) + 3)],
    mean(left, top, right, bottom, channel) {
      let [sum, count] = [0, 0];
      for (let y = Math.floor(top * height); y < bottom * height; y++) {
        for (let x = Math.floor(left * width); x < right * width; x++, count++) {
          sum += data[4 * (y * width + x) + channel]!;
        }
      }
      return sum / count;
    },
  };
}

/** How far two environments are apart in ln radiance, but for one texel of a hundred. */
export function apart(ours: Float32Array, theirs: Float32Array): number {
  const off = ours.map((value, i) => Math.abs(Math.log((value + 0.01) / (theirs[i]! + 0.01))));
  return off.sort()[Math.floor(0.99 * off.length)]!;
}

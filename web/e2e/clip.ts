/** Clips for the fake camera, made of an example photo: a phone panned over it. */
import { readFile, writeFile } from "node:fs/promises";
import path from "node:path";
import { launch } from "./browser.ts";

export const PHOTOS = new URL("../../examples/photos/", import.meta.url);
const FRAMES = 24;
const SIZE = { width: 432, height: 768 };

/**
 * Makes a clip in a folder: concatenated JPEGs, which Chromium plays over and over.
 *
 * @param larger than 432 x 768 by this factor.
 */
export async function makeClip(folder: string, larger = 1): Promise<string> {
  const browser = await launch();
  const photo = (await readFile(new URL("canteen.jpg", PHOTOS))).toString("base64");
  const page = await browser.newPage();
  const frames = await page.evaluate(panned, { photo, ...SIZE, count: FRAMES, larger });
  await browser.close();
  const clip = path.join(folder, "clip.mjpeg");
  await writeFile(clip, Buffer.concat(frames.map((frame) => Buffer.from(frame, "base64"))));
  return clip;
}

/** Runs in the browser. */
async function panned(of: {
  photo: string;
  width: number;
  height: number;
  count: number;
  larger: number;
}) {
  const bytes = Uint8Array.from(atob(of.photo), (letter) => letter.charCodeAt(0));
  const photo = await createImageBitmap(new Blob([bytes], { type: "image/jpeg" }));
  const canvas = new OffscreenCanvas(of.width * of.larger, of.height * of.larger);
  const context = canvas.getContext("2d")!;
  context.scale(of.larger, of.larger);
  const frames: string[] = [];
  for (let i = 0; i < of.count; i++) {
    const swing = (1 - Math.cos((2 * Math.PI * i) / of.count)) / 2;
    const [left, top] = [swing * (photo.width - of.width), swing * (photo.height - of.height)];
    context.drawImage(photo, -left, -top);
    const blob = await canvas.convertToBlob({ type: "image/jpeg", quality: 0.9 });
    let text = "";
    for (const byte of new Uint8Array(await blob.arrayBuffer())) text += String.fromCharCode(byte);
    frames.push(btoa(text));
  }
  return frames;
}

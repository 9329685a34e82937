/** What a ball on a page shows of the light that it mirrors. */
import type { Page } from "playwright-core";

/** Of the ball's radius, right and up from its middle. */
export type Place = readonly [right: number, up: number];
type Direction = readonly [number, number, number];

/** Where a ball seen from far away along -Z mirrors a direction. */
export function mirrored([x, y, z]: Direction): Place {
  const length = Math.hypot(x, y, z + 1);
  return [x / length, y / length];
}

/** Brightness over a ball that mirrors a lamp as wide as a wall: the way to its bright side. */
export function brightSideOf(towards: Direction, sharpness: number): Place {
  const sum: [number, number] = [0, 0];
  for (let u = -0.975; u < 1; u += 0.05) {
    for (let v = -0.975; v < 1; v += 0.05) {
      const z = Math.sqrt(Math.max(1 - u * u - v * v, 0));
      if (z === 0) continue;
      const cosine = 2 * z * (u * towards[0] + v * towards[1] + z * towards[2]) - towards[2];
      const value = Math.exp(sharpness * (cosine - 1));
      sum[0] += u * value;
      sum[1] += v * value;
    }
  }
  return sum;
}

export interface Seen {
  /** The middle of the brightest part. */
  readonly highlight: Place;
  /** The way to the brighter side, of any length. */
  readonly brightSide: Place;
}

/** The ball in the element `#view`; the page behind it is black. */
export async function seenOn(page: Page): Promise<Seen> {
  const picture = (await page.locator("#view").screenshot()).toString("base64");
  const { left, right, top, bottom, brightest, all } = await page.evaluate(measured, picture);
  const [across, down] = [(right - left) / 2, (bottom - top) / 2];
  const place = ([x, y]: readonly [number, number]): Place => [
    (x - left) / across - 1,
    1 - (y - top) / down,
  ];
  return { highlight: place(brightest), brightSide: place(all) };
}

/** Runs in the browser: the ball's edges in pixels, and its middles of brightness. */
async function measured(picture: string) {
  const bytes = Uint8Array.from(atob(picture), (letter) => letter.charCodeAt(0));
  const bitmap = await createImageBitmap(new Blob([bytes]));
  const { width, height } = bitmap;
  const context = new OffscreenCanvas(width, height).getContext("2d")!;
  context.drawImage(bitmap, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  const value = (i: number) => data[4 * i]! + data[4 * i + 1]! + data[4 * i + 2]!;
  let [left, right, top, bottom, most] = [width, 0, height, 0, 0];
  for (let i = 0; i < width * height; i++) {
    if (value(i) < 24) continue;
    [left, right] = [Math.min(left, i % width), Math.max(right, i % width)];
    [top, bottom] = [Math.min(top, Math.floor(i / width)), Math.max(bottom, Math.floor(i / width))];
    most = Math.max(most, value(i));
  }
  const middle = (weight: (value: number) => number): [number, number] => {
    let [x, y, sum] = [0, 0, 0];
    for (let i = 0; i < width * height; i++) {
      const w = weight(value(i));
      x += w * (i % width);
      y += w * Math.floor(i / width);
      sum += w;
    }
    return [x / sum, y / sum];
  };
  const brightest = middle((v) => (v >= 0.97 * most ? 1 : 0));
  return { left, right, top, bottom, brightest, all: middle((v) => v) };
}

export function apart(a: Place, b: Place): number {
  return Math.hypot(a[0] - b[0], a[1] - b[1]);
}

/** Cosine of the angle between two ways. */
export function alike(a: Place, b: Place): number {
  return (a[0] * b[0] + a[1] * b[1]) / (Math.hypot(...a) * Math.hypot(...b));
}

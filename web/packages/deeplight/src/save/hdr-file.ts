/** Radiance .hdr: RGBE pixels, top row first, run-length encoded. */
import { LATLONG_HEIGHT } from "../contract/generated.ts";
import type { Lighting } from "../light/lighting.ts";

const LONGEST_COPY = 128;
const LONGEST_RUN = 127;
const SHORTEST_RUN = 4; // a shorter one saves nothing

/**
 * The light as `deeplight estimate --hdr` writes it: centre = the view, right of it +X, top up.
 *
 * @param viewU where the view stands instead, 0 to 1 from the left edge, for other tools' frames.
 */
export function hdrFile(lighting: Lighting, viewU = 0.5): Blob {
  return panoramaFile(lighting.equirect(LATLONG_HEIGHT), LATLONG_HEIGHT, viewU);
}

/** A panorama of `height` x 2 `height` at its own size. */
export function panoramaFile(radiance: Float32Array, height: number, viewU = 0.5): Blob {
  const panorama = rolled(radiance, 2 * height, viewU - 0.5);
  return new Blob([encodedHdr(panorama, 2 * height)], { type: "image/vnd.radiance" });
}

/** Each row of `width` RGB pixels moved right by a share of it, around the edge. */
export function rolled(panorama: Float32Array, width: number, share: number): Float32Array {
  const by = 3 * ((Math.round(share * width) + width) % width);
  if (by === 0) return panorama;
  const result = new Float32Array(panorama.length);
  for (let from = 0; from < panorama.length; from += 3 * width) {
    const end = from + 3 * width;
    result.set(panorama.subarray(end - by, end), from);
    result.set(panorama.subarray(from, end - by), from + by);
  }
  return result;
}

/** A file of linear RGB rows, `width` pixels each, 8 to 32767. */
export function encodedHdr(radiance: Float32Array, width: number): Uint8Array<ArrayBuffer> {
  const height = radiance.length / 3 / width;
  const header = `#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y ${height} +X ${width}\n`;
  const bytes: number[] = Array.from(header, (letter) => letter.charCodeAt(0));
  for (let row = 0; row < height; row++) {
    bytes.push(2, 2, width >> 8, width & 255);
    const planes = rgbe(radiance.subarray(3 * row * width, 3 * (row + 1) * width));
    for (const plane of planes) pushEncoded(bytes, plane);
  }
  return Uint8Array.from(bytes);
}

/** Red, green, blue and exponent of each pixel, one plane after the other. */
function rgbe(row: Float32Array): Uint8Array[] {
  const count = row.length / 3;
  const planes = [0, 1, 2, 3].map(() => new Uint8Array(count));
  for (let pixel = 0; pixel < count; pixel++) {
    const colour = [row[3 * pixel]!, row[3 * pixel + 1]!, row[3 * pixel + 2]!];
    const largest = Math.max(...colour);
    if (!(largest > 1e-32)) continue; // black is all zeros
    const exponent = exponentOf(largest);
    const scale = 2 ** (8 - exponent);
    colour.forEach((value, c) => {
      planes[c]![pixel] = Math.min(Math.floor(Math.max(value, 0) * scale), 255);
    });
    planes[3]![pixel] = exponent + 128;
  }
  return planes;
}

/** The power of two with which a positive number lies in [0.5, 1). */
function exponentOf(value: number): number {
  const exponent = Math.floor(Math.log2(value)) + 1;
  if (value >= 2 ** exponent) return exponent + 1; // the logarithm was rounded down ...
  return value < 2 ** (exponent - 1) ? exponent - 1 : exponent; // ... or up
}

function pushEncoded(bytes: number[], plane: Uint8Array): void {
  let at = 0;
  while (at < plane.length) {
    const run = runAt(plane, at);
    if (run >= SHORTEST_RUN) {
      bytes.push(128 + run, plane[at]!);
      at += run;
      continue;
    }
    const start = at;
    while (at < plane.length && at - start < LONGEST_COPY && runAt(plane, at) < SHORTEST_RUN) at++;
    bytes.push(at - start, ...plane.subarray(start, at));
  }
}

/** How many equal bytes follow each other from here. */
function runAt(plane: Uint8Array, at: number): number {
  let end = at + 1;
  while (end < plane.length && end - at < LONGEST_RUN && plane[end] === plane[at]) end++;
  return end - at;
}

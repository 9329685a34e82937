/** Opaque pixels that look like nothing, but have large and small shapes: RGBA. */
export function noise(width: number, height: number): Uint8ClampedArray<ArrayBuffer> {
  const pixels = new Uint8ClampedArray(4 * width * height);
  for (let i = 0; i < width * height; i++) {
    const [x, y] = [i % width, Math.floor(i / width)];
    const grain = Math.imul(i, 2654435761) >>> 26; // 0 to 63
    pixels[4 * i] = (((x >> 5) * 7) & 127) + grain;
    pixels[4 * i + 1] = (((y >> 6) * 13) & 127) + grain;
    pixels[4 * i + 2] = ((((x + y) >> 7) * 29) & 127) + grain;
    pixels[4 * i + 3] = 255;
  }
  return pixels;
}

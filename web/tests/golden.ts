/** Golden values that tests/golden/make_web*.py made with the Python package. */
import { readFileSync } from "node:fs";

export interface Packed {
  shape: number[];
  float32: string;
}

// biome-ignore lint/suspicious/noExplicitAny: the file's shape is what the tests check
export function golden(name: "light" | "photo" | "scene" | "exif" | "transfer" | "edges"): any {
  return JSON.parse(readFileSync(new URL(`golden/${name}.json`, import.meta.url), "utf-8"));
}

export function floats(packed: Packed): Float32Array {
  const bytes = Uint8Array.from(Buffer.from(packed.float32, "base64"));
  return new Float32Array(bytes.buffer);
}

export function bytes(base64: string): Uint8Array {
  return Uint8Array.from(Buffer.from(base64, "base64"));
}

/** Rows of `width` values. */
export function rows(packed: Packed): number[][] {
  const values = Array.from(floats(packed));
  const width = packed.shape.at(-1)!;
  return Array.from({ length: values.length / width }, (_, i) =>
    values.slice(i * width, (i + 1) * width),
  );
}

/** Largest difference between two lists; infinite where they are not of one length. */
export function largestError(got: ArrayLike<number>, want: ArrayLike<number>): number {
  if (got.length !== want.length) return Number.POSITIVE_INFINITY;
  return Array.from(got).reduce((most, value, i) => Math.max(most, Math.abs(value - want[i]!)), 0);
}

/** The same relative to the largest value wanted. */
export function relativeError(got: ArrayLike<number>, want: ArrayLike<number>): number {
  const largest = Array.from(want).reduce((a, b) => Math.max(a, Math.abs(b)), 0);
  return largestError(got, want) / largest;
}

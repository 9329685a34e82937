/** The library of places whose detail is made up where no photo looks: one file, which the page's build makes. */
import { DETAIL } from "../contract/generated.ts";
import { detailed, type LibraryPlace, sureKind } from "../scene/detail.ts";
import type { DetailSource } from "./worker.ts";

const { DETAIL_ROWS, ROWS } = DETAIL;
const NUMBERS = 6 * ROWS * ROWS;

/** What the file begins with, as JSON, after its length. */
interface Head {
  readonly names: readonly string[];
  readonly kinds: readonly string[];
  /** Bytes of each picture, a JPEG; they come after all smooth maps, numbers of 16 bits. */
  readonly sizes: readonly number[];
}

let fetching: Promise<readonly LibraryPlace[]> | undefined;

/** The library at an address, fetched once; a photo that comes after a failure asks again. */
export const libraryAt: DetailSource = (url) => {
  fetching ??= fetchedPlaces(url).catch(() => {
    fetching = undefined;
    return [];
  });
  const places = fetching;
  return async (heads) => {
    const kind = sureKind(heads);
    if (!kind) return undefined;
    const alike = (await places).filter((place) => place.kind === kind);
    return alike.length ? (...known) => detailed(...known, alike) : undefined;
  };
};

/** Fetches all places and decodes their pictures. */
async function fetchedPlaces(url: string): Promise<readonly LibraryPlace[]> {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: HTTP ${response.status}`);
  const file = await response.arrayBuffer();
  const start = 4 + new DataView(file).getUint32(0, true);
  const head: Head = JSON.parse(new TextDecoder().decode(file.slice(4, start)));
  let at = start + 2 * NUMBERS * head.names.length;
  return Promise.all(
    head.names.map(async (name, i) => {
      const from = start + 2 * NUMBERS * i;
      const smooth = Float32Array.from(
        new Uint16Array(file.slice(from, from + 2 * NUMBERS)),
        ofHalf,
      );
      at += head.sizes[i]!;
      const levels = await decoded(file.slice(at - head.sizes[i]!, at));
      return { name, kind: head.kinds[i]!, smooth, levels };
    }),
  );
}

/** RGBA as the file has it, whatever the screen's colours. */
async function decoded(jpeg: ArrayBuffer): Promise<Uint8ClampedArray> {
  const bitmap = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }), {
    colorSpaceConversion: "none",
  });
  const canvas = new OffscreenCanvas(2 * DETAIL_ROWS, DETAIL_ROWS);
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  return context.getImageData(0, 0, 2 * DETAIL_ROWS, DETAIL_ROWS).data;
}

/** The number that 16 bits hold: IEEE 754's half. */
function ofHalf(bits: number): number {
  const [exponent, fraction] = [(bits >> 10) & 31, (bits & 1023) / 1024];
  const size = exponent === 0 ? fraction * 2 ** -14 : (1 + fraction) * 2 ** (exponent - 15);
  return bits >> 15 ? -size : size;
}

/** Entries of a JPEG's EXIF data. */

/** An entry: the type of its values, and where they lie. */
interface Entry {
  readonly type: number;
  readonly values: DataView;
}

/** Entries of a directory by their numbers. */
export type Entries = ReadonlyMap<number, Entry>;

export interface Exif {
  /** The picture itself. */
  readonly main: Entries;
  /** How it was taken. */
  readonly camera: Entries;
  readonly isLittle: boolean;
}

const CAMERA = 0x8769;
const [SHORT, LONG, RATIONAL, SIGNED_LONG] = [3, 4, 5, 9];
export const SIGNED_RATIONAL = 10;
const [FLOAT, DOUBLE] = [11, 12]; // not in the standard, but what Pillow makes of a number
const BYTES_OF_TYPE = [0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8];

/** Null where there is none, or where it is damaged. */
export function exifOf(file: ArrayBuffer): Exif | null {
  try {
    const tiff = tiffOf(new DataView(file));
    if (!tiff) return null;
    const isLittle = tiff.getUint16(0) === 0x4949;
    const main = entriesAt(tiff, tiff.getUint32(4, isLittle), isLittle);
    const at = numberOf(main.get(CAMERA), isLittle);
    return { main, camera: at ? entriesAt(tiff, at, isLittle) : new Map(), isLittle };
  } catch (error) {
    if (error instanceof RangeError) return null; // an offset outside the file
    throw error;
  }
}

/** The TIFF block inside a JPEG's APP1 segment. */
function tiffOf(file: DataView): DataView | null {
  if (file.byteLength < 4 || file.getUint16(0) !== 0xffd8) return null;
  let at = 2;
  while (at + 4 <= file.byteLength && file.getUint8(at) === 0xff) {
    const marker = file.getUint16(at);
    const length = file.getUint16(at + 2);
    if (marker === 0xffe1 && file.getUint32(at + 4) === 0x45786966) {
      return new DataView(file.buffer, file.byteOffset + at + 10, length - 8);
    }
    if (marker === 0xffda) return null; // pixels begin
    at += 2 + length;
  }
  return null;
}

/** All entries of the directory at `directory` but those that lie outside, or their values. */
export function entriesAt(tiff: DataView, directory: number, isLittle: boolean): Entries {
  const found = new Map<number, Entry>();
  if (directory + 2 > tiff.byteLength) return found;
  const count = tiff.getUint16(directory, isLittle);
  const end = Math.min(directory + 2 + 12 * count, tiff.byteLength - 11);
  for (let at = directory + 2; at < end; at += 12) {
    const type = tiff.getUint16(at + 2, isLittle);
    const bytes = tiff.getUint32(at + 4, isLittle) * (BYTES_OF_TYPE[type] ?? 0);
    const start = bytes > 4 ? tiff.getUint32(at + 8, isLittle) : at + 8;
    if (start + bytes > tiff.byteLength) continue;
    const values = new DataView(tiff.buffer, tiff.byteOffset + start, bytes);
    found.set(tiff.getUint16(at, isLittle), { type, values });
  }
  return found;
}

/** Its first number; undefined where it has none, or the standard's word for unknown (CIPA DC-008). */
export function numberOf(entry: Entry | undefined, isLittle: boolean): number | undefined {
  if (!entry?.values.byteLength) return undefined;
  const { type, values } = entry;
  if (type === SHORT) return values.getUint16(0, isLittle);
  if (type === LONG) return values.getUint32(0, isLittle);
  if (type === SIGNED_LONG) return values.getInt32(0, isLittle);
  if (type === FLOAT) return values.getFloat32(0, isLittle);
  if (type === DOUBLE) return values.getFloat64(0, isLittle);
  if (type !== RATIONAL && type !== SIGNED_RATIONAL) return undefined;
  const [above, below] = [0, 4].map((at) =>
    type === RATIONAL ? values.getUint32(at, isLittle) : values.getInt32(at, isLittle),
  );
  return below === 0 || below === -1 || below === 0xffffffff ? undefined : above! / below!;
}

/** NumPy's .npz: a zip of .npy files. Written as they are; read as numpy.savez writes them, not compressed. */
import { crc32 } from "./crc32.ts";

const MAKES = {
  "|u1": Uint8Array,
  "<f4": Float32Array,
  "<f8": Float64Array,
  "<i8": BigInt64Array,
} as const;
type Kind = keyof typeof MAKES;

export type Values = Uint8Array | Float32Array | Float64Array | BigInt64Array;

/** Values row by row; a single number has the shape []. */
export interface NumpyArray {
  readonly shape: readonly number[];
  readonly values: Values;
}

const [LOCAL, CENTRAL, END] = [0x04034b50, 0x02014b50, 0x06054b50];
const VERSION = 20; // of zip: the first with folders and deflate, which every reader has
const JANUARY_1980 = 0x21; // zip's first day: the same file each time
const MAGIC = [0x93, 0x4e, 0x55, 0x4d, 0x50, 0x59]; // \x93NUMPY
const ALIGNED = 64;

export function npzFile(arrays: Readonly<Record<string, NumpyArray>>): Uint8Array<ArrayBuffer> {
  const files: Uint8Array[] = [];
  const directory: Uint8Array[] = [];
  let at = 0;
  for (const [name, array] of Object.entries(arrays)) {
    const [head, entry, content] = zipped(`${name}.npy`, npy(array), at);
    files.push(head, content);
    directory.push(entry);
    at += head.length + content.length;
  }
  const size = directory.reduce((sum, { length }) => sum + length, 0);
  const end = record([END, 4], [0, 4], [directory.length, 2], [directory.length, 2]);
  return joined([...files, ...directory, end, record([size, 4], [at, 4], [0, 2])]);
}

/** @throws RangeError that says what is wrong with the file. */
export function npzArrays(file: Uint8Array): ReadonlyMap<string, NumpyArray> {
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  let end = file.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== END) end--;
  if (end < 0) throw new RangeError("expected an .npz file, got another, or one cut short");
  const arrays = new Map<string, NumpyArray>();
  let at = view.getUint32(end + 16, true);
  for (let left = view.getUint16(end + 10, true); left > 0; left--) {
    if (view.getUint32(at, true) !== CENTRAL) throw new RangeError("a damaged .npz file");
    const [method, size] = [view.getUint16(at + 10, true), view.getUint32(at + 24, true)];
    if (method !== 0) throw new RangeError("expected an .npz that is not compressed");
    const [name, extra, note] = [28, 30, 32].map((offset) => view.getUint16(at + offset, true));
    const local = view.getUint32(at + 42, true);
    const start = local + 30 + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
    const content = file.slice(start, start + size); // a copy: values start where their kind may
    if (crc32(content) !== view.getUint32(at + 16, true)) throw new RangeError("a damaged .npz");
    const words = new TextDecoder().decode(file.subarray(at + 46, at + 46 + name!));
    arrays.set(words.replace(/\.npy$/, ""), arrayOf(content));
    at += 46 + name! + extra! + note!;
  }
  return arrays;
}

/** Header, entry of the directory, content of one file. */
function zipped(
  name: string,
  content: Uint8Array,
  at: number,
): [Uint8Array, Uint8Array, Uint8Array] {
  const letters = new TextEncoder().encode(name);
  const facts = joined([
    record([VERSION, 2], [0, 2], [0, 2], [0, 2], [JANUARY_1980, 2], [crc32(content), 4]),
    record([content.length, 4], [content.length, 4], [letters.length, 2], [0, 2]),
  ]);
  const head = joined([record([LOCAL, 4]), facts, letters]);
  const place = record([0, 2], [0, 2], [0, 2], [0, 4], [at, 4]);
  return [head, joined([record([CENTRAL, 4], [VERSION, 2]), facts, place, letters]), content];
}

function npy({ shape, values }: NumpyArray): Uint8Array {
  const kind = Object.entries(MAKES).find(([, made]) => values instanceof made)![0];
  const sizes = shape.length === 1 ? `${shape[0]},` : shape.join(", ");
  const words = `{'descr': '${kind}', 'fortran_order': False, 'shape': (${sizes}), }`;
  const length = Math.ceil((words.length + 11) / ALIGNED) * ALIGNED;
  const text = `${words.padEnd(length - 11)}\n`;
  const head = [...MAGIC, 1, 0, text.length & 255, text.length >> 8];
  const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
  return joined([Uint8Array.from(head), new TextEncoder().encode(text), bytes]);
}

function arrayOf(content: Uint8Array): NumpyArray {
  const isNumpy = MAGIC.every((byte, i) => content[i] === byte) && content[6] === 1;
  const start = 10 + (content[8] ?? 0) + 256 * (content[9] ?? 0);
  const words = new TextDecoder().decode(content.subarray(10, start));
  const [, kind, byColumn] = /'descr': '([^']+)', 'fortran_order': (True|False)/.exec(words) ?? [];
  const sizes = /'shape': \(([\d, ]*)\)/.exec(words)?.[1];
  const make = MAKES[kind as Kind];
  if (!isNumpy || !make || byColumn === "True" || sizes === undefined) {
    throw new RangeError(`expected numbers row by row, got ${words.slice(0, 80)}`);
  }
  const shape = sizes
    .split(",")
    .filter((one) => one.trim() !== "")
    .map(Number);
  const count = shape.reduce((a, b) => a * b, 1);
  const bytes = content.slice(start);
  if (bytes.length !== count * make.BYTES_PER_ELEMENT) throw new RangeError("a damaged array");
  return { shape, values: new make(bytes.buffer) };
}

/** Numbers of 2 or 4 bytes, little-endian. */
function record(...numbers: readonly (readonly [value: number, bytes: number])[]): Uint8Array {
  return Uint8Array.from(
    numbers.flatMap(([value, bytes]) =>
      Array.from({ length: bytes }, (_, i) => (value >>> (8 * i)) & 255),
    ),
  );
}

function joined(parts: readonly Uint8Array[]): Uint8Array<ArrayBuffer> {
  const all = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
  }
  return all;
}

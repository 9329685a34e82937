import { readFileSync } from "node:fs";
import { inflateRawSync } from "node:zlib";
import type { Connect, Plugin } from "vite";

/** Where the page finds it, relative to its own address. */
const NAME = "model/detail.bin";

/** Puts the library of made-up detail next to the page, in a form that a few lines read. */
export function detailLibrary(path: string): Plugin {
  const serve: Connect.NextHandleFunction = (request, response, next) => {
    if (request.url?.split("?")[0] !== `/${NAME}`) return next();
    response.setHeader("Content-Type", "application/octet-stream");
    response.end(libraryFile(readFileSync(path)));
  };
  return {
    name: "deeplight:detail-library",
    configureServer: (server) => void server.middlewares.use(serve),
    generateBundle() {
      this.emitFile({ type: "asset", fileName: NAME, source: libraryFile(readFileSync(path)) });
    },
  };
}

/** The length of a head of JSON, that head, smooth maps as numbers of 16 bits, then the pictures. */
export function libraryFile(npz: Buffer): Uint8Array {
  const arrays = unzipped(npz);
  const head = {
    names: words(arrays.get("names")!),
    kinds: words(arrays.get("kinds")!),
    sizes: Array.from(new BigInt64Array(valuesOf(arrays.get("sizes")!).buffer), Number),
  };
  const json = Buffer.from(JSON.stringify(head));
  const length = Buffer.alloc(4);
  length.writeUInt32LE(json.length);
  const values = ["smooth", "pictures"].map((name) => valuesOf(arrays.get(name)!));
  return Buffer.concat([length, json, ...values]);
}

/** The .npy files of an .npz by their names. */
function unzipped(npz: Buffer): ReadonlyMap<string, Buffer> {
  const files = new Map<string, Buffer>();
  let at = npz.readUInt32LE(npz.length - 6);
  for (let left = npz.readUInt16LE(npz.length - 12); left > 0; left--) {
    const [name, extra, note] = [28, 30, 32].map((offset) => npz.readUInt16LE(at + offset));
    const local = npz.readUInt32LE(at + 42);
    const start = local + 30 + npz.readUInt16LE(local + 26) + npz.readUInt16LE(local + 28);
    const content = npz.subarray(start, start + npz.readUInt32LE(at + 20));
    const isPlain = npz.readUInt16LE(at + 10) === 0;
    const key = npz.toString("utf8", at + 46, at + 46 + name!).replace(/\.npy$/, "");
    files.set(key, isPlain ? content : inflateRawSync(content));
    at += 46 + name! + extra! + note!;
  }
  return files;
}

/** An array's values, from where any kind may start. */
function valuesOf(npy: Buffer): Uint8Array {
  return Uint8Array.from(npy.subarray(10 + npy.readUInt16LE(8)));
}

/** Of an array of words: as many characters of four bytes for each. */
function words(npy: Buffer): string[] {
  const size = Number(/'<U(\d+)'/.exec(npy.toString("latin1"))![1]);
  const codes = new Uint32Array(valuesOf(npy).buffer);
  return Array.from({ length: codes.length / size }, (_, i) =>
    String.fromCodePoint(...codes.slice(i * size, (i + 1) * size)).replace(/\0+$/, ""),
  );
}

/** Which ways of packing a .glb uses, and what unpacks them: fetched only when a file needs it. */
import type { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";

const JSON_CHUNK = 0x4e4f534a;
const DRACO = "KHR_draco_mesh_compression";
const MESHOPT = ["EXT_meshopt_compression", "KHR_meshopt_compression"];
const KTX2 = "KHR_texture_basisu";

/** The extensions that a file names; none where it is no .glb, which its reader will say. */
export function extensionsOf(file: ArrayBuffer): readonly string[] {
  if (file.byteLength < 20) return [];
  const view = new DataView(file);
  const [length, kind] = [view.getUint32(12, true), view.getUint32(16, true)];
  if (kind !== JSON_CHUNK || 20 + length > file.byteLength) return [];
  try {
    const text = new TextDecoder().decode(new Uint8Array(file, 20, length));
    const { extensionsUsed } = JSON.parse(text) as { extensionsUsed?: unknown };
    return Array.isArray(extensionsUsed) ? extensionsUsed.filter((x) => typeof x === "string") : [];
  } catch {
    return [];
  }
}

/** What unpacks a file; to be disposed of when it has been read. */
export interface Unpackers {
  /** What could not be unpacked and was left out. */
  readonly problem: Error | null;
  dispose(): void;
}

/** Gives a loader what it needs to unpack a file. */
export async function unpackersOf(loader: GLTFLoader, file: ArrayBuffer): Promise<Unpackers> {
  const extensions = extensionsOf(file);
  if (MESHOPT.some((name) => extensions.includes(name))) {
    const { MeshoptDecoder } = await import("three/addons/libs/meshopt_decoder.module.js");
    loader.setMeshoptDecoder(MeshoptDecoder);
  }
  const [draco, ktx2] = await Promise.all([
    extensions.includes(DRACO) ? import("./draco.ts").then((it) => new it.DracoUnpacker()) : null,
    extensions.includes(KTX2) ? import("./ktx2.ts").then((it) => new it.Ktx2Unpacker()) : null,
  ]);
  // Their types are of three.js's own loaders, of which GLTFLoader uses what these have.
  if (draco) loader.setDRACOLoader(draco as unknown as DracoLoader);
  if (ktx2) loader.setKTX2Loader(ktx2 as unknown as Ktx2Loader);
  return {
    get problem() {
      return ktx2?.problem ?? null;
    },
    dispose() {
      draco?.dispose();
      ktx2?.dispose();
    },
  };
}

type DracoLoader = Parameters<GLTFLoader["setDRACOLoader"]>[0];
type Ktx2Loader = Parameters<GLTFLoader["setKTX2Loader"]>[0];

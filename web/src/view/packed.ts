/** Which ways of packing a .glb uses, and what unpacks them: fetched only when a file needs it. */
import type { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Failure } from "../failure.ts";

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

/**
 * Gives a loader what it needs to unpack a file; the result is to be called when it has been read.
 *
 * @throws Failure `glb-packed` for KTX2 textures: their decoder makes code of text, which the page's
 * content policy forbids.
 */
export async function unpackedBy(loader: GLTFLoader, file: ArrayBuffer): Promise<() => void> {
  const extensions = extensionsOf(file);
  if (extensions.includes(KTX2)) throw new Failure("glb-packed", KTX2);
  if (MESHOPT.some((name) => extensions.includes(name))) {
    const { MeshoptDecoder } = await import("three/addons/libs/meshopt_decoder.module.js");
    loader.setMeshoptDecoder(MeshoptDecoder);
  }
  if (!extensions.includes(DRACO)) return () => {};
  const { DracoUnpacker } = await import("./draco.ts");
  const unpacker = new DracoUnpacker();
  loader.setDRACOLoader(unpacker as unknown as Parameters<GLTFLoader["setDRACOLoader"]>[0]);
  return () => unpacker.dispose();
}

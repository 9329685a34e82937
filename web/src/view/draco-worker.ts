/** Unpacks Draco's meshes next to the page. */

import wasm from "draco3dgltf/draco_decoder_gltf.wasm?url";
import createDecoder from "draco3dgltf/draco_decoder_gltf_nodejs.js";
import { type Decoded, type Draco, decodeMesh, startedDraco, type Wanted } from "./draco-decode.ts";

export interface DracoJob {
  readonly number: number;
  readonly bytes: ArrayBuffer;
  readonly wanted: Wanted;
}

export type DracoAnswer =
  | { readonly number: number; readonly decoded: Decoded }
  | { readonly number: number; readonly failed: string };

const loading: Promise<Draco> = fetch(new URL(wasm, self.location.href))
  .then((response) => response.arrayBuffer())
  .then((wasmBinary) => startedDraco(createDecoder, wasmBinary));

self.onmessage = async ({ data }: MessageEvent<DracoJob>) => {
  const { number, bytes, wanted } = data;
  try {
    const decoded = decodeMesh(await loading, new Int8Array(bytes), wanted);
    self.postMessage({ number, decoded } satisfies DracoAnswer);
  } catch (error) {
    self.postMessage({ number, failed: String(error) } satisfies DracoAnswer);
  }
};

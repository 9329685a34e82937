/** Unpacks Draco's meshes next to the page. */

import wasm from "draco3dgltf/draco_decoder_gltf.wasm?url";
import createDecoder from "draco3dgltf/draco_decoder_gltf_nodejs.js";
import { answer } from "./asked-worker.ts";
import { type Draco, decodeMesh, startedDraco, type Wanted } from "./draco-decode.ts";

export interface DracoJob {
  readonly bytes: ArrayBuffer;
  readonly wanted: Wanted;
}

const loading: Promise<Draco> = fetch(new URL(wasm, self.location.href))
  .then((response) => response.arrayBuffer())
  .then((wasmBinary) => startedDraco(createDecoder, wasmBinary));

answer(async ({ bytes, wanted }: DracoJob) =>
  decodeMesh(await loading, new Int8Array(bytes), wanted),
);

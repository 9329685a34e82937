/** Unpacks KTX2 textures next to the page. */
import createBasis from "three/addons/libs/basis/basis_transcoder.js";
import wasm from "three/addons/libs/basis/basis_transcoder.wasm?url";
import { answer } from "./asked-worker.ts";
import { type Basis, decodeTexture, startedBasis } from "./ktx2-decode.ts";

const loading: Promise<Basis> = fetch(new URL(wasm, self.location.href))
  .then((response) => response.arrayBuffer())
  .then((wasmBinary) => startedBasis(createBasis, wasmBinary));

answer(async (bytes: ArrayBuffer) => decodeTexture(await loading, new Uint8Array(bytes)));

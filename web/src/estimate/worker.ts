/** Runs the network beside the page: one model, then one frame after the other. */
import { CellMeans } from "./cell-means.ts";
import type { Contract } from "./contract.ts";
import { download } from "./download.ts";
import { EstimateError, type EstimateErrorKind } from "./errors.ts";
import { framePhoto } from "./framing.ts";
import { Network } from "./network.ts";
import { Picker } from "./picker.ts";

export type Request =
  | { readonly load: { readonly model: string; readonly runtime: string } }
  | { readonly frame: ImageBitmap; readonly verticalFovRad: number | undefined };

export type Reply =
  | { readonly progress: readonly [done: number, all: number] }
  | { readonly loaded: { readonly contract: Contract; readonly sha256: string | null } }
  | {
      readonly logRadiance: Float32Array;
      readonly preprocessMs: number;
      readonly runMs: number;
    }
  | { readonly failed: { readonly kind: EstimateErrorKind; readonly detail: string } };

let network: Network | undefined;
const picker = new Picker();

self.onmessage = ({ data }: MessageEvent<Request>) => {
  const answer = "load" in data ? load(data.load) : estimate(data.frame, data.verticalFovRad);
  answer.then(reply, (error: unknown) => {
    const kind = error instanceof EstimateError ? error.kind : "runtime";
    reply({ failed: { kind, detail: error instanceof Error ? error.message : String(error) } });
  });
};

async function load({ model, runtime }: { model: string; runtime: string }): Promise<Reply> {
  const bytes = await download(model, (done, all) => reply({ progress: [done, all] }));
  const sha256 = await hash(bytes);
  network = await Network.open(bytes, runtime);
  // The first run is the slowest: it is done before somebody waits for it.
  const { contract } = network;
  await network.logRadiance(new Float32Array(3 * contract.height * contract.width));
  return { loaded: { contract, sha256 } };
}

async function estimate(frame: ImageBitmap, verticalFovRad?: number): Promise<Reply> {
  if (network === undefined) throw new EstimateError("runtime", "expected a loaded model");
  const { contract } = network;
  const started = performance.now();
  const means = new CellMeans(framePhoto(frame.height, frame.width, verticalFovRad, contract));
  picker.pick(frame, means);
  frame.close();
  const planes = means.planes(contract.input_low, contract.input_high);
  const prepared = performance.now();
  const logRadiance = await network.logRadiance(planes);
  const done = performance.now();
  if (!logRadiance.every((value) => value < 88.7)) {
    throw new EstimateError("no-light", "expected finite light, got NaN or infinity");
  }
  return { logRadiance, preprocessMs: prepared - started, runMs: done - prepared };
}

/** Of the model file, for the JSON; null where the browser has no hashes (plain http). */
async function hash(bytes: Uint8Array): Promise<string | null> {
  if (!globalThis.crypto?.subtle) return null;
  const digest = await crypto.subtle.digest("SHA-256", bytes as Uint8Array<ArrayBuffer>);
  return Array.from(new Uint8Array(digest), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

function reply(message: Reply): void {
  self.postMessage(message);
}

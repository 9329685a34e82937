/** Runs the network next to the page: one model, then one frame after the other. */

import { EstimateError, type EstimateErrorKind } from "../errors.ts";
import type { Contract } from "../network/contract.ts";
import { Network } from "../network/network.ts";
import type { Dense } from "../network/onnx.ts";
import { CellMeans } from "./cell-means.ts";
import { download } from "./download.ts";
import { framePhoto } from "./framing.ts";
import { type Frame, Picker, sizeOf } from "./picker.ts";

export type Request =
  /** The address of a model file, or its bytes. */
  | { readonly load: string | Uint8Array }
  | { readonly frame: Frame; readonly verticalFovRad: number | undefined };

export type Reply =
  | { readonly progress: readonly [done: number, all: number] }
  | { readonly loaded: { readonly contract: Contract; readonly sha256: string | null } }
  | {
      readonly logRadiance: Float32Array;
      /** What else the network gives, by name. */
      readonly others: ReadonlyMap<string, Dense>;
      readonly preprocessMs: number;
      readonly runMs: number;
    }
  | { readonly failed: Fault }
  | { readonly notLoaded: Fault };

export interface Fault {
  readonly kind: EstimateErrorKind;
  readonly detail: string;
}

/** Where nobody asks for light so soon, the first run, which is slow, is done beforehand. */
const IDLE_MS = 300;

let loading: Promise<Network> | undefined;
let isAsked = false;
const picker = new Picker();

self.onmessage = ({ data }: MessageEvent<Request>) => {
  if ("load" in data) {
    load(data.load).then(reply, (error: unknown) => reply({ notLoaded: faultOf(error) }));
  } else {
    const light = estimate(data.frame, data.verticalFovRad);
    light.then(reply, (error: unknown) => reply({ failed: faultOf(error) }));
  }
};

function faultOf(error: unknown): Fault {
  const kind = error instanceof EstimateError ? error.kind : "runtime";
  return { kind, detail: error instanceof Error ? error.message : String(error) };
}

async function load(model: string | Uint8Array): Promise<Reply> {
  const bytes =
    typeof model === "string"
      ? download(model, (done, all) => reply({ progress: [done, all] }))
      : Promise.resolve(model);
  loading = bytes.then((file) => Network.open(file));
  const sha256 = bytes.then(hash);
  sha256.catch(() => {}); // reported by what waits for the network
  const network = await loading;
  setTimeout(() => warmUp(network), IDLE_MS);
  return { loaded: { contract: network.contract, sha256: await sha256 } };
}

function warmUp(network: Network): void {
  if (isAsked) return;
  const { height, width } = network.contract;
  network.run(new Float32Array(3 * height * width));
}

async function estimate(frame: Frame, verticalFovRad?: number): Promise<Reply> {
  isAsked = true;
  const network = await loading;
  if (network === undefined) throw new EstimateError("runtime", "expected a loaded model");
  const { contract } = network;
  const started = performance.now();
  const { width, height } = sizeOf(frame);
  const means = new CellMeans(framePhoto(height, width, verticalFovRad, contract));
  const isReversed = await picker.pick(frame, means);
  frame.close();
  const planes = means.planes(contract.input_low, contract.input_high, isReversed);
  const prepared = performance.now();
  const { logRadiance, others } = network.estimate(planes);
  const done = performance.now();
  if (!logRadiance.every((value) => value < 88.7)) {
    throw new EstimateError("no-light", "expected finite light, got NaN or infinity");
  }
  return { logRadiance, others, preprocessMs: prepared - started, runMs: done - prepared };
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

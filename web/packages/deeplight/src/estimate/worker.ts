/** Runs the network next to the page: one model, then one frame after the other. */

import { EstimateError, type EstimateErrorKind } from "../errors.ts";
import type { Environment } from "../light/environment.ts";
import { type Lamp, lampsOf } from "../light/lamp.ts";
import type { Matrix3x3, Vector3 } from "../light/matrix.ts";
import { radianceOfBall } from "../light/mirror-ball.ts";
import type { Contract } from "../network/contract.ts";
import { Network, requireFinite } from "../network/network.ts";
import type { Dense } from "../network/onnx.ts";
import { planeOf, reducedSize } from "../scene/image-plane.ts";
import { type Detail, type SceneLight, sceneLight } from "../scene/scene-light.ts";
import { CellMeans, wholePhoto } from "./cell-means.ts";
import {
  type Confidence,
  CROPS,
  confidenceOf,
  cutFraming,
  headsIn,
  mirroredBall,
  mirroredPlanes,
  surenessOf,
} from "./confidence.ts";
import { download } from "./download.ts";
import { framePhoto, looks, slidIntoPhoto } from "./framing.ts";
import { seenFromPhoto } from "./look.ts";
import { type Frame, Picker, sizeOf } from "./picker.ts";
import { type Tracked, Tracker } from "./tracker.ts";
import { edgeGrid, seenTilt } from "./upright-edges.ts";

interface WithFrame {
  readonly frame: Frame;
  readonly verticalFovRad: number | undefined;
}

interface Alone {
  readonly sceneRows?: number | undefined;
  /** Against gravity, camera frame, where that is known. */
  readonly up?: Vector3 | null | undefined;
}

export type Request =
  /** The address of a model file, or its bytes; and of the library of made-up detail. */
  | { readonly load: string | Uint8Array; readonly detail?: string | undefined }
  /** One frame for itself; with `sceneRows` put into its light, a panorama of this number of rows. */
  | (WithFrame & Alone)
  /** One of many frames of a place. */
  | (WithFrame & { readonly track: TrackRequest })
  /** The light of all tracked frames once more, in a camera's frame. */
  | { readonly fused: FusedRequest }
  /** All that was tracked, as a file. */
  | { readonly save: true }
  /** Goes on from such a file. */
  | { readonly restore: Uint8Array }
  /** What was tracked is forgotten. */
  | { readonly leave: true };

export interface TrackRequest {
  /** How the camera was held; null where only the pictures say it. */
  readonly worldFromCamera: Matrix3x3 | null;
  /** For the first one where only the pictures say it. */
  readonly start: Matrix3x3;
  /** Rows of the fused light; 0 leaves it out. */
  readonly rows: number;
  /** Gives it even if it is the same as before. */
  readonly evenIfSame?: boolean | undefined;
}

export interface FusedRequest {
  readonly worldFromCamera: Matrix3x3;
  readonly rows: number;
}

export interface Answer {
  readonly logRadiance: Float32Array;
  /** What else the network gives, by name. */
  readonly others: ReadonlyMap<string, Dense>;
  /** Where it was asked for. */
  readonly scene: SceneLight | null;
  /** How far the answers to the same photo differ, where a scene was asked for. */
  readonly confidence: Confidence | null;
  readonly preprocessMs: number;
  readonly runMs: number;
}

export type Reply =
  | { readonly progress: readonly [done: number, all: number] }
  | { readonly loaded: { readonly contract: Contract; readonly sha256: string | null } }
  | Answer
  /** The network's light alone; the rest follows. */
  | { readonly first: Answer }
  | { readonly fused: Environment | null }
  | { readonly tracked: Tracked }
  | { readonly saved: Uint8Array<ArrayBuffer> | null }
  | { readonly restored: number }
  | { readonly failed: Fault }
  | { readonly notLoaded: Fault };

export interface Fault {
  readonly kind: EstimateErrorKind;
  readonly detail: string;
}

/**
 * Begins to fetch a library of detail; gives what of it suits a photo, by what the network says of that
 * one. Nothing where it cannot be fetched, or nothing suits.
 */
export type DetailSource = (
  url: string,
) => (heads: Readonly<Record<string, number>> | null) => Promise<Detail | undefined>;

/** Where nobody asks for light so soon, the first run, which is slow, is done beforehand. */
const IDLE_MS = 300;

let loading: Promise<Network> | undefined;
let detailUrl: string | undefined;
let detailAt: DetailSource | undefined;
let isAsked = false;
const picker = new Picker();

const tracker = new Tracker();

/** From now on photos get detail where a library is named: for workers that hold what that takes. */
export function layDetail(source: DetailSource): void {
  detailAt = source;
}

self.onmessage = ({ data }: MessageEvent<Request>) => {
  if ("load" in data) {
    detailUrl = data.detail;
    load(data.load).then(reply, (error: unknown) => reply({ notLoaded: faultOf(error) }));
  } else if ("leave" in data) {
    tracker.leave();
  } else if ("fused" in data) {
    reply({ fused: tracker.fused(data.fused) });
  } else if ("save" in data) {
    reply({ saved: tracker.saved() });
  } else if ("restore" in data) {
    reply(restored(data.restore));
  } else {
    const answer =
      "track" in data
        ? tracker
            .next(whenLoaded(), picker, data.frame, data.verticalFovRad, data.track)
            .then((tracked) => ({ tracked }))
        : estimate(data).finally(() => data.frame.close());
    answer.then(reply, (error: unknown) => reply({ failed: faultOf(error) }));
  }
};

function restored(file: Uint8Array): Reply {
  try {
    return { restored: tracker.restore(file) };
  } catch (error) {
    return { failed: faultOf(error) };
  }
}

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

async function whenLoaded(): Promise<Network> {
  isAsked = true;
  const network = await loading;
  if (network === undefined) throw new EstimateError("runtime", "expected a loaded model");
  return network;
}

async function estimate(asked: WithFrame & Alone): Promise<Answer> {
  const { frame, verticalFovRad, sceneRows } = asked;
  const detail = sceneRows && detailUrl ? detailAt?.(detailUrl) : undefined;
  const network = await whenLoaded();
  const { contract } = network;
  const started = performance.now();
  const photo = sizeOf(frame);
  const framing = slidIntoPhoto(framePhoto(photo.height, photo.width, verticalFovRad, contract));
  const views = looks(framing);
  const seen = views.map((view) => new CellMeans(view));
  const plane = planeOf(photo, framing.verticalFovRad);
  const small = sceneRows ? reducedSize(photo, plane, sceneRows) : null;
  const whole = small && new CellMeans(wholePhoto(photo, small));
  const asksAgain = whole !== null && contract.heads.length === 0;
  const cuts = asksAgain
    ? [framing, ...CROPS.map((crop) => cutFraming(framing, crop))].map((cut) => new CellMeans(cut))
    : [];
  const isReversed = await picker.pick(frame, ...seen, ...(whole ? [whole] : []), ...cuts);
  if (!whole) frame.close(); // soon: a camera has few
  const { input_low, input_high } = contract;
  const planes = seen.map((means) => means.planes(input_low, input_high, isReversed));
  const prepared = performance.now();
  const shown = planes.map((view) => network.estimate(view));
  const { logRadiance, others } = seenFromPhoto(shown, contract, views);
  const done = performance.now();
  requireFinite(logRadiance);
  const times = { preprocessMs: prepared - started, runMs: done - prepared };
  const answer: Answer = { logRadiance, others, scene: null, confidence: null, ...times };
  if (!whole || !small || !sceneRows) return answer;
  reply({ first: answer });
  const placed = { ...small, pixels: whole.rgb(isReversed), plane };
  const ball = radianceOfBall(logRadiance, contract.output_size);
  const heads = headsIn(others, contract);
  const tilt = asked.up
    ? { up: asked.up, scaleRad: 0 }
    : await seenTilt(heads, plane, async () => {
        const cells = new CellMeans(edgeGrid(photo));
        return { grid: cells.grid, pixels: cells.rgb(await picker.pick(frame, cells), 255) };
      });
  const own = lampsIn(others, contract);
  const scene = sceneLight(ball, placed, sceneRows, own, tilt, await detail?.(heads));
  if (heads) return { ...answer, scene, confidence: surenessOf(heads, logRadiance, placed) };
  const answers = cuts.map((cut, i) => {
    const given = cut.planes(input_low, input_high, isReversed);
    const again = network.logRadiance(i === 0 ? mirroredPlanes(given, contract) : given);
    const own = i === 0 ? mirroredBall(again) : again;
    return seenFromPhoto([{ logRadiance: own, others: new Map() }], contract, [framing])
      .logRadiance;
  });
  return { ...answer, scene, confidence: confidenceOf(logRadiance, answers, placed) };
}

/** Those that the network names. */
function lampsIn(others: ReadonlyMap<string, Dense>, contract: Contract): readonly Lamp[] {
  const lamps = others.get(contract.lamps_name);
  return lamps ? lampsOf(lamps) : [];
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

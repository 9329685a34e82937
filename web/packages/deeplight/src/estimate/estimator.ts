/** A frame in, its light out, computed in a worker: the view never waits for it. */

import { EstimateError } from "../errors.ts";
import type { Environment } from "../light/environment.ts";
import { Lighting } from "../light/lighting.ts";
import type { Contract } from "../network/contract.ts";
import type { Dense } from "../network/onnx.ts";
import type { CameraFacts } from "../photo/camera-facts.ts";
import type { SceneLight } from "../scene/scene-light.ts";
import type { Confidence } from "./confidence.ts";
import type { Progress } from "./download.ts";
import type { Frame } from "./picker.ts";
import type { Tracked } from "./tracker.ts";
import type { Answer, Fault, FusedRequest, Reply, Request, TrackRequest } from "./worker.ts";

export interface Estimate {
  readonly lighting: Lighting;
  /** What else the network gives, by the names of its outputs. */
  readonly others: ReadonlyMap<string, Dense>;
  /** The photo in its light, where that was asked for. */
  readonly scene: SceneLight | null;
  /** How far the answers to the same photo differ; with `scene`. */
  readonly confidence: Confidence | null;
  readonly preprocessMs: number;
  readonly runMs: number;
}

export interface Setup {
  /** Where the model file is, on any host that allows it (CORS), or its bytes. */
  readonly model: URL | Uint8Array;
  /** Starts `deeplight/worker`. */
  readonly worker: () => Worker;
  readonly onProgress?: Progress | undefined;
  /** Where the library of detail is that goes over what a photo does not show; without it none does. */
  readonly detail?: URL | undefined;
}

/** Which network it is. */
export interface ModelFacts {
  /** Null where it came as bytes. */
  readonly file: string | null;
  readonly contract: Contract;
  readonly sha256: string | null; // null where the browser offers no hashes: plain http
}

/** What the worker says of one frame. */
type Answered = Extract<
  Reply,
  | { runMs: number }
  | { tracked: unknown }
  | { fused: unknown }
  | { saved: unknown }
  | { restored: unknown }
  | { failed: unknown }
>;
type Result = Answer | Tracked | Environment | Uint8Array<ArrayBuffer> | number | null;

interface Job {
  readonly request: Extract<
    Request,
    { frame: unknown } | { fused: unknown } | { save: unknown } | { restore: unknown }
  >;
  /** Called with the network's light alone, where more follows. */
  readonly first?: ((answer: Answer) => void) | undefined;
  readonly done: (answer: Result) => void;
  readonly failed: (error: EstimateError) => void;
}

export class Estimator {
  /** @throws EstimateError that says what is missing, damaged or not supported. */
  readonly loaded: Promise<ModelFacts>;
  /** Null until everything has been loaded. */
  model: ModelFacts | null = null;
  #running: Job | null = null;
  #waiting: Job | null = null;
  #closed = false;

  private constructor(
    private readonly worker: Worker,
    { model, onProgress, detail }: Setup,
  ) {
    this.loaded = this.#load({ model, detail }, onProgress ?? (() => {})).catch(
      (error: unknown) => {
        this.close();
        throw error;
      },
    );
  }

  /** Takes frames from now on; their light comes when everything has been loaded. */
  static start(setup: Setup): Estimator {
    return new Estimator(setup.worker(), setup);
  }

  /**
   * The light of an upright, opaque frame, which is closed. Without a field of view the long side is
   * taken to span 66 degrees, without `up` it is what is seen in it. Null when a newer frame took its place, after `close`, and where
   * `loaded` fails.
   *
   * @param sceneRows also puts the photo into its light: a panorama of this number of rows.
   * @param first then gets the network's light alone as soon as it is there.
   */
  async estimate(
    frame: Frame,
    { verticalFovRad, up }: Partial<CameraFacts> = {},
    sceneRows?: number,
    first?: (estimate: Estimate) => void,
  ): Promise<Estimate | null> {
    const request = { frame, verticalFovRad, up, sceneRows };
    const answer = await this.#asked(request, (one) => first?.(estimateOf(one)));
    return isRecord(answer) && "logRadiance" in answer ? estimateOf(answer) : null;
  }

  /** Takes a frame, which is closed, into the light of the place; null as from `estimate`. */
  async track(
    frame: Frame,
    verticalFovRad: number | undefined,
    track: TrackRequest,
  ): Promise<Tracked | null> {
    const answer = await this.#asked({ frame, verticalFovRad, track });
    return isRecord(answer) && "isStill" in answer ? answer : null;
  }

  /** The light of all tracked frames once more, in a camera's frame; null where there is none. */
  async fused(fused: FusedRequest): Promise<Environment | null> {
    const answer = await this.#asked({ fused });
    return isRecord(answer) && "seen" in answer ? answer : null;
  }

  /** What was tracked as a file, the .npz of Python's `Session.load`; null where nothing was. */
  async savedPlace(): Promise<Uint8Array<ArrayBuffer> | null> {
    const answer = await this.#asked({ save: true });
    return answer instanceof Uint8Array ? answer : null;
  }

  /** Goes on from such a file; how many views it has. @throws EstimateError "session-damaged" */
  async restorePlace(file: Uint8Array): Promise<number> {
    const answer = await this.#asked({ restore: file });
    return typeof answer === "number" ? answer : 0;
  }

  /** Forgets what was tracked: the place has been left. */
  leavePlace(): void {
    if (!this.#closed) this.worker.postMessage({ leave: true } satisfies Request);
  }

  #asked(request: Job["request"], first?: Job["first"]): Promise<Result> {
    return new Promise((done, failed) => {
      drop(this.#waiting);
      this.#waiting = { request, first, done, failed };
      this.#next();
    });
  }

  close(): void {
    this.#closed = true;
    this.worker.terminate();
    this.#running?.done(null);
    this.#running = null;
    this.#next();
  }

  #next(): void {
    const job = this.#waiting;
    if (this.#running !== null || job === null) return;
    this.#waiting = null;
    if (this.#closed) {
      drop(job);
      return;
    }
    this.#running = job;
    this.worker.postMessage(job.request, "frame" in job.request ? [job.request.frame] : []);
  }

  #load(
    { model, detail }: Pick<Setup, "model" | "detail">,
    onProgress: Progress,
  ): Promise<ModelFacts> {
    const file = model instanceof URL ? model.pathname.split("/").at(-1)! : null;
    return new Promise((done, failed) => {
      this.worker.onmessage = ({ data }: MessageEvent<Reply>) => {
        if ("progress" in data) onProgress(...data.progress);
        else if ("loaded" in data) {
          this.model = { file, ...data.loaded };
          done(this.model);
        } else if ("notLoaded" in data) failed(errorOf(data.notLoaded));
        else if ("first" in data) this.#running?.first?.(data.first);
        else this.#answered(data);
      };
      this.worker.onerror = (event) => {
        const fault: Fault = { kind: "runtime", detail: event.message || "the worker broke" };
        if (this.model) this.#answered({ failed: fault });
        else failed(errorOf(fault));
      };
      const load = model instanceof URL ? model.href : model;
      this.worker.postMessage({ load, detail: detail?.href } satisfies Request);
    });
  }

  #answered(reply: Answered): void {
    const job = this.#running;
    this.#running = null;
    if ("failed" in reply) job?.failed(errorOf(reply.failed));
    else if ("tracked" in reply) job?.done(reply.tracked);
    else if ("saved" in reply) job?.done(reply.saved);
    else if ("restored" in reply) job?.done(reply.restored);
    else job?.done("fused" in reply ? reply.fused : reply);
    this.#next();
  }
}

function isRecord(result: Result): result is Answer | Tracked | Environment {
  return typeof result === "object" && result !== null && !(result instanceof Uint8Array);
}

function estimateOf({ logRadiance, ...others }: Answer): Estimate {
  return { lighting: new Lighting(logRadiance), ...others };
}

function errorOf({ kind, detail }: Fault): EstimateError {
  return new EstimateError(kind, detail);
}

function drop(job: Job | null): void {
  if (job && "frame" in job.request) job.request.frame.close();
  job?.done(null);
}

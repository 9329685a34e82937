/** A frame in, its light out, computed in a worker: the view never waits for it. */
import { Lighting } from "../light/lighting.ts";
import type { Contract } from "./contract.ts";
import type { Progress } from "./download.ts";
import { EstimateError } from "./errors.ts";
import type { Frame } from "./picker.ts";
import type { Fault, Reply, Request } from "./worker.ts";

export interface Estimate {
  readonly lighting: Lighting;
  readonly preprocessMs: number;
  readonly runMs: number;
}

/** Where the model file is, and the folder (with its last slash) that holds onnxruntime's files. */
export interface Where {
  readonly model: URL;
  readonly runtime: URL;
}

/** Which network it is. */
export interface ModelFacts {
  readonly file: string;
  readonly contract: Contract;
  readonly sha256: string | null; // null where the browser offers no hashes: plain http
}

type Answer = Extract<Reply, { logRadiance: unknown } | { failed: unknown }>;

interface Job {
  readonly frame: Frame;
  readonly verticalFovRad: number | undefined;
  readonly done: (estimate: Estimate | null) => void;
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
    where: Where,
    onProgress: Progress,
  ) {
    this.loaded = this.#load(where, onProgress).catch((error: unknown) => {
      this.close();
      throw error;
    });
  }

  /** Takes frames from now on; their light comes when everything has been loaded. */
  static start(where: Where, onProgress: Progress = () => {}): Estimator {
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    return new Estimator(worker, where, onProgress);
  }

  /**
   * The light of an upright, opaque frame, which is closed. Without a field of view the long side is
   * taken to span 66 degrees. Null when a newer frame took its place, after `close`, and where
   * `loaded` fails.
   */
  estimate(frame: Frame, verticalFovRad?: number): Promise<Estimate | null> {
    return new Promise((done, failed) => {
      drop(this.#waiting);
      this.#waiting = { frame, verticalFovRad, done, failed };
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
    const request: Request = { frame: job.frame, verticalFovRad: job.verticalFovRad };
    this.worker.postMessage(request, [job.frame]);
  }

  #load(where: Where, onProgress: Progress): Promise<ModelFacts> {
    const file = where.model.pathname.split("/").at(-1)!;
    return new Promise((done, failed) => {
      this.worker.onmessage = ({ data }: MessageEvent<Reply>) => {
        if ("progress" in data) onProgress(...data.progress);
        else if ("loaded" in data) {
          this.model = { file, ...data.loaded };
          done(this.model);
        } else if ("notLoaded" in data) failed(errorOf(data.notLoaded));
        else this.#answered(data);
      };
      this.worker.onerror = (event) => {
        const fault: Fault = { kind: "runtime", detail: event.message || "the worker broke" };
        if (this.model) this.#answered({ failed: fault });
        else failed(errorOf(fault));
      };
      const load = { model: where.model.href, runtime: where.runtime.href };
      this.worker.postMessage({ load } satisfies Request);
    });
  }

  #answered(reply: Answer): void {
    const job = this.#running;
    this.#running = null;
    if ("logRadiance" in reply) {
      const { logRadiance, preprocessMs, runMs } = reply;
      job?.done({ lighting: new Lighting(logRadiance), preprocessMs, runMs });
    } else {
      job?.failed(errorOf(reply.failed));
    }
    this.#next();
  }
}

function errorOf({ kind, detail }: Fault): EstimateError {
  return new EstimateError(kind, detail);
}

function drop(job: Job | null): void {
  job?.frame.close();
  job?.done(null);
}

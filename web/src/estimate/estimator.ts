/** A frame in, its light out, computed in a worker: the view never waits for it. */
import { Lighting } from "../light/lighting.ts";
import type { Contract } from "./contract.ts";
import type { Progress } from "./download.ts";
import { EstimateError } from "./errors.ts";
import type { Reply, Request } from "./worker.ts";

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

interface Job {
  readonly frame: ImageBitmap;
  readonly verticalFovRad: number | undefined;
  readonly done: (estimate: Estimate | null) => void;
  readonly failed: (error: EstimateError) => void;
}

export class Estimator {
  #running: Job | null = null;
  #waiting: Job | null = null;
  #closed = false;

  private constructor(
    readonly model: ModelFacts,
    private readonly worker: Worker,
  ) {
    worker.onmessage = ({ data }: MessageEvent<Reply>) => this.#answered(data);
    worker.onerror = (event) => this.#answered(brokenWorker(event));
  }

  /** @throws EstimateError that says what is missing, damaged or not supported. */
  static async load(where: Where, onProgress: Progress = () => {}): Promise<Estimator> {
    const worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
    try {
      const loaded = await new Promise<Omit<ModelFacts, "file">>((done, failed) => {
        worker.onmessage = ({ data }: MessageEvent<Reply>) => {
          if ("progress" in data) onProgress(...data.progress);
          else if ("loaded" in data) done(data.loaded);
          else if ("failed" in data) failed(errorOf(data.failed));
        };
        worker.onerror = (event) => failed(errorOf(brokenWorker(event).failed));
        const load = { model: where.model.href, runtime: where.runtime.href };
        worker.postMessage({ load } satisfies Request);
      });
      const file = where.model.pathname.split("/").at(-1)!;
      return new Estimator({ file, ...loaded }, worker);
    } catch (error) {
      worker.terminate();
      throw error;
    }
  }

  /**
   * The light of an upright frame, which is closed. Without a field of view the long side is taken
   * to span 66 degrees. Null when a newer frame took its place, or after `close`.
   */
  estimate(frame: ImageBitmap, verticalFovRad?: number): Promise<Estimate | null> {
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

  #answered(reply: Reply): void {
    const job = this.#running;
    this.#running = null;
    if ("logRadiance" in reply) {
      const { logRadiance, preprocessMs, runMs } = reply;
      job?.done({ lighting: new Lighting(logRadiance), preprocessMs, runMs });
    } else if ("failed" in reply) {
      job?.failed(errorOf(reply.failed));
    }
    this.#next();
  }
}

type Failed = Extract<Reply, { failed: unknown }>;

function errorOf({ kind, detail }: Failed["failed"]): EstimateError {
  return new EstimateError(kind, detail);
}

/** The worker's own file is missing, or it died. */
function brokenWorker(event: ErrorEvent): Failed {
  return { failed: { kind: "runtime", detail: event.message || "the worker could not start" } };
}

function drop(job: Job | null): void {
  job?.frame.close();
  job?.done(null);
}

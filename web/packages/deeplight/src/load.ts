/** The library's front door: `load`, then `estimate`. */

import { EstimateError } from "./errors.ts";
import { headsIn } from "./estimate/confidence.ts";
import { Estimator, type ModelFacts } from "./estimate/estimator.ts";
import { lampsOf } from "./light/lamp.ts";
import { IDENTITY, type Matrix3x3, normalised, type Vector3 } from "./light/matrix.ts";
import { Smoother } from "./light/smoother.ts";
import { Light } from "./light.ts";
import { type PhotoSource, taken } from "./photo/source.ts";
import { onEachFrame } from "./photo/video.ts";
import { type TrackedLight, type TrackOptions, track, type VideoTracking } from "./track.ts";
import InlineWorker from "./worker.ts?worker&inline";
import { type SessionOptions, type SessionTracking, trackSession } from "./xr/track-session.ts";
import type { XRSessionLike } from "./xr/types.ts";

export interface LoadOptions {
  /**
   * The network: an address on any host that allows it (the header `Access-Control-Allow-Origin`),
   * or its bytes. Without it the file that comes with this package, next to this module.
   */
  readonly model?: string | URL | ArrayBuffer | Uint8Array | undefined;
  /**
   * Starts the worker where the page's content policy forbids workers from `blob:`:
   * `() => new Worker(new URL("deeplight/worker", import.meta.url), { type: "module" })`.
   */
  readonly worker?: (() => Worker) | undefined;
  /** Called while the network is fetched; `all` is 0 where the host does not say. */
  readonly onProgress?: ((done: number, all: number) => void) | undefined;
}

export interface EstimateOptions {
  /** Of the whole upright picture; else what a JPEG file gives, else 66 degrees along the long side. */
  readonly verticalFovRad?: number | undefined;
  /** Against gravity, in the camera's frame; else what a JPEG file gives, else what is seen in it. With `rows`. */
  readonly up?: Vector3 | undefined;
  /**
   * Puts the photo's own pixels where the camera looked, and lamps at their size, into a panorama of
   * this number of rows (even, 64 to 2048): `Light.panorama`. Left out, the light is the network's alone.
   */
  readonly rows?: number | undefined;
}

export interface FollowOptions extends EstimateOptions {
  /** How the camera is held now: rows of the matrix that turns its directions into the world's. */
  readonly worldFromCamera?: (() => Matrix3x3) | undefined;
  /** After which 63 % of a change of light has been taken over; 0 takes each estimate as it is. */
  readonly smoothMs?: number | undefined;
  /** What went wrong; following has stopped then. */
  readonly onError?: ((error: unknown) => void) | undefined;
}

/**
 * Fetches the network and starts it in a worker.
 *
 * @throws EstimateError that says what is missing, damaged or not supported.
 */
export async function load(options: LoadOptions = {}): Promise<LightEstimator> {
  const estimator = Estimator.start({
    model: modelOf(options.model),
    worker: options.worker ?? (() => new InlineWorker()),
    onProgress: options.onProgress,
  });
  return new LightEstimator(estimator, await estimator.loaded);
}

export class LightEstimator {
  #last: Promise<unknown> = Promise.resolve();
  #isClosed = false;

  constructor(
    private readonly estimator: Estimator,
    /** Which network it is. */
    readonly model: ModelFacts,
  ) {}

  /**
   * The light of a picture; several are estimated in the order of the calls.
   *
   * @throws EstimateError; RangeError where the picture has no pixels or its view is impossible.
   */
  estimate(source: PhotoSource, options: EstimateOptions = {}): Promise<Light> {
    const light = this.#last.then(() => this.#one(source, options));
    this.#last = light.catch(() => {});
    return light;
  }

  /** Calls `seen` with the light of a video's newest frame, again and again; the result stops it. */
  follow(
    video: HTMLVideoElement,
    seen: (light: Light) => void,
    options: FollowOptions = {},
  ): () => void {
    const { smoothMs = 300, worldFromCamera = () => IDENTITY, onError } = options;
    const smoother = smoothMs > 0 ? new Smoother(smoothMs) : null;
    let isBusy = false;
    const stop = onEachFrame(video, () => {
      if (isBusy || !video.videoWidth) return;
      isBusy = true;
      const pose = worldFromCamera();
      const light = this.estimate(video, options).then(({ lighting, about, lamps }) => {
        const steady = smoother?.next(lighting, performance.now(), pose) ?? lighting;
        if (!isStopped) seen(new Light(steady, about, lamps));
      });
      void light
        .catch((error: unknown) => {
          if (!isStopped) onError?.(error);
          stopAll();
        })
        .finally(() => {
          isBusy = false;
        });
    });
    let isStopped = false;
    const stopAll = (): void => {
      isStopped = true;
      stop();
    };
    return stopAll;
  }

  /**
   * Gathers the light of a place while a camera looks around: `seen` gets the light of all frames so
   * far. Nothing is estimated while nothing moves. One place at a time.
   */
  track(
    video: HTMLVideoElement,
    seen: (tracked: TrackedLight) => void,
    options: TrackOptions = {},
  ): VideoTracking {
    return track(this.estimator, video, seen, options);
  }

  /**
   * The same in a WebXR session: of the camera's pictures where it has `camera-access`, fused with the
   * platform's `light-estimation` where it has that, else of that alone. `onFrame` of the result is to
   * be called in each of the session's animation frames.
   *
   * @param gl the context that the session draws with.
   */
  trackSession(
    session: XRSessionLike,
    gl: WebGL2RenderingContext,
    seen: (tracked: TrackedLight) => void,
    options: SessionOptions = {},
  ): SessionTracking {
    return trackSession(this.estimator, session, gl, seen, options);
  }

  /** Ends the worker. What is under way and what comes later fails with `closed`. */
  close(): void {
    this.#isClosed = true;
    this.estimator.close();
  }

  async #one(source: PhotoSource, options: EstimateOptions): Promise<Light> {
    if (this.#isClosed) throw closed();
    const { frame, width, height, file, ...known } = await taken(source);
    const verticalFovRad = options.verticalFovRad ?? known.verticalFovRad;
    const up = options.up ? normalised(options.up) : known.up;
    const facts = { verticalFovRad, up };
    const estimate = await this.estimator.estimate(frame, facts, options.rows);
    if (!estimate) throw closed();
    const photo = { file, width, height };
    const heads = headsIn(estimate.others, this.model.contract);
    const about = { model: this.model, photo, verticalFovRad, heads };
    const { scene } = estimate;
    if (scene) return Light.of(scene, about, scene.lamps);
    const lamps = estimate.others.get(this.model.contract.lamps_name);
    return new Light(estimate.lighting, about, lamps ? lampsOf(lamps) : []);
  }
}

function modelOf(model: LoadOptions["model"]): URL | Uint8Array {
  if (model instanceof Uint8Array) return model;
  if (model instanceof ArrayBuffer) return new Uint8Array(model);
  if (model === undefined) return new URL("./deeplight.onnx", import.meta.url);
  return new URL(model, document.baseURI);
}

function closed(): EstimateError {
  return new EstimateError("closed", "expected an open estimator, got a closed one");
}

/** The light of a place while somebody looks around in a WebXR session (`immersive-ar`). */
import type { Estimator } from "../estimate/estimator.ts";
import type { Frame } from "../estimate/picker.ts";
import { IDENTITY, type Matrix3x3 } from "../light/matrix.ts";
import { environmentOfProbe, type Probe, probeOf, withProbe } from "../light/probe.ts";
import { Light } from "../light.ts";
import type { TrackedLight, Tracking } from "../track.ts";
import { CameraPixels, type Pixels } from "./camera-pixels.ts";
import type { CameraBinding, XRFrameLike, XRSessionLike, XRViewLike } from "./types.ts";

export interface SessionOptions {
  /** Of the fused panorama; 128 if left out. */
  readonly rows?: number | undefined;
  /** Milliseconds between two fused lights at least; 200 if left out. */
  readonly everyMs?: number | undefined;
  /** What went wrong; the camera's pictures are not looked at any more, the platform's probe is. */
  readonly onError?: ((error: unknown) => void) | undefined;
}

export interface SessionTracking extends Tracking {
  /** To be called in each of the session's animation frames. */
  onFrame(frame: XRFrameLike, space: object): void;
}

/** To be asked for, as optional features, when the session is requested. */
export const LIGHT_FEATURES = ["camera-access", "light-estimation"] as const;

interface Held {
  readonly worldFromCamera: Matrix3x3;
  readonly verticalFovRad: number;
}

export function trackSession(
  estimator: Estimator,
  session: XRSessionLike,
  gl: WebGL2RenderingContext,
  seen: (tracked: TrackedLight) => void,
  options: SessionOptions,
): SessionTracking {
  const tracking = new Session(estimator, gl, seen, options);
  tracking.listen(session);
  return tracking;
}

class Session implements SessionTracking {
  readonly #pixels: CameraPixels;
  readonly #rows: number;
  readonly #everyMs: number;
  #binding: CameraBinding | null = null;
  #probe: object | null = null;
  #platform: Probe | null = null;
  #held: Held | null = null;
  #isBusy = false;
  #isStopped = false;
  #isNew = false;
  #latestMs = Number.NEGATIVE_INFINITY;

  constructor(
    private readonly estimator: Estimator,
    private readonly gl: WebGL2RenderingContext,
    private readonly seen: (tracked: TrackedLight) => void,
    private readonly options: SessionOptions,
  ) {
    this.#pixels = new CameraPixels(gl);
    this.#rows = options.rows ?? 128;
    this.#everyMs = options.everyMs ?? 200;
  }

  /** Asks for what the session offers of the light. */
  listen(session: XRSessionLike): void {
    this.#binding = bindingOf(session, this.gl);
    session.requestLightProbe?.().then(
      (probe) => {
        this.#probe = probe;
      },
      () => {}, // not offered, or not wanted by the user
    );
  }

  onFrame(frame: XRFrameLike, space: object): void {
    if (this.#isStopped) return;
    const estimate = this.#probe && frame.getLightEstimate?.(this.#probe);
    if (estimate) this.#platform = probeOf(estimate);
    const view = frame.getViewerPose(space)?.views[0];
    if (!view) return;
    if (this.#binding && view.camera) this.#look(this.#binding, view);
    else this.#showPlatform(heldOf(view).worldFromCamera);
  }

  reset(): void {
    this.estimator.leavePlace();
  }

  stop(): void {
    if (this.#isStopped) return;
    this.#isStopped = true;
    this.#pixels.dispose();
    this.estimator.leavePlace();
  }

  #look(binding: CameraBinding, view: XRViewLike): void {
    try {
      const pixels = this.#pixels.poll();
      if (pixels && this.#held) this.#give(pixels, this.#held);
      if (this.#isBusy || this.#pixels.isReading) return;
      const texture = binding.getCameraImage(view.camera!);
      if (!texture) return;
      this.#pixels.start(texture, view.camera!);
      this.#held = heldOf(view);
    } catch (error) {
      this.#fail(error);
    }
  }

  #give(pixels: Pixels, held: Held): void {
    this.#isBusy = true;
    this.#take(pixels, held)
      .catch((error: unknown) => this.#fail(error))
      .finally(() => {
        this.#isBusy = false;
      });
  }

  async #take(pixels: Pixels, { worldFromCamera, verticalFovRad }: Held): Promise<void> {
    const rows = this.#isDue() ? this.#rows : 0;
    const request = { worldFromCamera, start: IDENTITY, rows };
    const tracked = await this.estimator.track(await frameOf(pixels), verticalFovRad, request);
    if (!tracked || this.#isStopped) return;
    this.#isNew ||= tracked.isNew;
    if (!tracked.light) return;
    const fused = this.#platform ? withProbe(tracked.light, this.#platform) : tracked.light;
    this.#show(Light.of(fused, null), worldFromCamera);
  }

  /** Where no pictures are to be had. */
  #showPlatform(worldFromCamera: Matrix3x3): void {
    if (!this.#platform || !this.#isDue()) return;
    this.#show(Light.of(environmentOfProbe(this.#platform, this.#rows), null), worldFromCamera);
  }

  #show(light: Light, worldFromCamera: Matrix3x3): void {
    this.#latestMs = performance.now();
    this.seen({ light, worldFromCamera, isNew: this.#isNew });
    this.#isNew = false;
  }

  #isDue(): boolean {
    return performance.now() - this.#latestMs >= this.#everyMs;
  }

  #fail(error: unknown): void {
    if (this.#isStopped) return;
    this.#binding = null;
    this.options.onError?.(error);
  }
}

/** How the camera is held and how wide it sees: its picture fills the view. */
export function heldOf({ transform, projectionMatrix }: XRViewLike): Held {
  const e = transform.matrix; // column by column
  const worldFromCamera = [0, 4, 8, 1, 5, 9, 2, 6, 10].map((i) => e[i]!) as unknown as Matrix3x3;
  return { worldFromCamera, verticalFovRad: 2 * Math.atan(1 / projectionMatrix[5]!) };
}

/** Null where the browser has no way to the camera's pixels. */
function bindingOf(session: object, gl: WebGL2RenderingContext): CameraBinding | null {
  const Binding = (globalThis as { XRWebGLBinding?: new (...of: object[]) => CameraBinding })
    .XRWebGLBinding;
  if (!Binding || !("getCameraImage" in Binding.prototype)) return null;
  try {
    return new Binding(session, gl);
  } catch {
    return null; // a context or a session that it does not fit
  }
}

async function frameOf({ data, width, height }: Pixels): Promise<Frame> {
  if (typeof VideoFrame === "undefined") {
    return createImageBitmap(new ImageData(data, width, height));
  }
  const form = { format: "RGBX", codedWidth: width, codedHeight: height, timestamp: 0 } as const;
  return new VideoFrame(data, form);
}

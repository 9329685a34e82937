/** Many frames of one place: its light as far as it has been seen. */
import type { Estimator } from "./estimate/estimator.ts";
import { IDENTITY, type Matrix3x3 } from "./light/matrix.ts";
import { Light } from "./light.ts";
import { frameOfVideo, onEachFrame } from "./photo/video.ts";

export interface TrackOptions {
  /** Of the whole upright picture; else 66 degrees along the long side. */
  readonly verticalFovRad?: number | undefined;
  /**
   * How the camera is held now: rows of the matrix that turns its directions into the world's, whose
   * +Y is up. Left out, or where it gives null, the turning is found in the pictures.
   */
  readonly worldFromCamera?: (() => Matrix3x3 | null) | undefined;
  /** Of the fused panorama; 128 if left out. */
  readonly rows?: number | undefined;
  /** Milliseconds between two fused lights at least; 200 if left out. */
  readonly everyMs?: number | undefined;
  /** What went wrong; tracking has stopped then. */
  readonly onError?: ((error: unknown) => void) | undefined;
}

/** The light of a place as far as it has been seen, in the world's frame. */
export interface TrackedLight {
  /** Relative to the white of the newest frame. */
  readonly light: Light;
  /** How the camera was held; null where that is not known any more. */
  readonly worldFromCamera: Matrix3x3 | null;
  /** What was known was forgotten: the place or the light changed. */
  readonly isNew: boolean;
}

export interface Tracking {
  stop(): void;
  /** Forgets what was seen. */
  reset(): void;
}

export interface VideoTracking extends Tracking {
  /** What was seen so far as an .npz file, which Python's `Session.load` reads, too; null where nothing was. */
  save(): Promise<Uint8Array<ArrayBuffer> | null>;
  /** Goes on from such a file; gives how many views it has. @throws EstimateError "session-damaged" */
  open(file: Uint8Array): Promise<number>;
}

const ROWS = 128;
const EVERY_MS = 200;

export function track(
  estimator: Estimator,
  video: HTMLVideoElement,
  seen: (tracked: TrackedLight) => void,
  options: TrackOptions,
): VideoTracking {
  const { rows = ROWS, everyMs = EVERY_MS, verticalFovRad, onError } = options;
  const held = options.worldFromCamera ?? (() => null);
  let [isBusy, isStopped, latestMs, isNew] = [false, false, Number.NEGATIVE_INFINITY, false];
  const one = async (): Promise<void> => {
    const now = performance.now();
    const isDue = now - latestMs >= everyMs;
    const worldFromCamera = held();
    const frame = await frameOfVideo(video);
    const request = { worldFromCamera, start: IDENTITY, rows: isDue ? rows : 0 };
    const tracked = await estimator.track(frame, verticalFovRad, request);
    if (!tracked || isStopped) return;
    isNew ||= tracked.isNew;
    if (!tracked.light) return;
    latestMs = now;
    seen({ light: Light.of(tracked.light, null), worldFromCamera: tracked.worldFromCamera, isNew });
    isNew = false;
  };
  const stopFrames = onEachFrame(video, () => {
    if (isBusy || !video.videoWidth) return;
    isBusy = true;
    one()
      .catch((error: unknown) => {
        if (!isStopped) onError?.(error);
        stop();
      })
      .finally(() => {
        isBusy = false;
      });
  });
  const stop = (): void => {
    isStopped = true;
    stopFrames();
    estimator.leavePlace();
  };
  return {
    stop,
    reset: () => estimator.leavePlace(),
    save: () => estimator.savedPlace(),
    open: (file) => estimator.restorePlace(file),
  };
}

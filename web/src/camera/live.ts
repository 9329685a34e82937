/** The phone's camera: opened on demand, off while the page is hidden. */
import { type Frame, frameOfVideo } from "deeplight/core";
import { Failure, type FailureKind } from "../failure.ts";
import type { Facing } from "../sensors/orientation.ts";
import type { Picture } from "./picture.ts";

/** How long a camera may take to change its size. */
const RESIZE_MS = 1500;

interface Size {
  readonly width: number;
  readonly height: number;
}

const FAILURES: Record<string, FailureKind> = {
  NotAllowedError: "denied",
  SecurityError: "denied",
  NotFoundError: "no-camera",
  OverconstrainedError: "no-camera",
  DevicesNotFoundError: "no-camera",
  NotReadableError: "camera-busy",
  TrackStartError: "camera-busy",
  AbortError: "camera-busy",
};

export class LiveCamera implements Picture {
  readonly kind = "live";
  readonly file = null;
  readonly verticalFovRad = undefined;
  readonly up = null; // sensors say it
  /** Called when the camera goes away without having been asked to. */
  onLost: () => void = () => {};

  private constructor(
    readonly source: HTMLVideoElement,
    private readonly stream: MediaStream,
    readonly facing: Facing,
  ) {
    for (const track of stream.getVideoTracks())
      track.addEventListener("ended", () => this.onLost());
  }

  /**
   * Asks for the camera and waits for its first frame.
   *
   * @param video plays the stream; it stays in the document, or iPhones stop it.
   * @throws Failure with what stood in the way.
   */
  static async open(video: HTMLVideoElement, facing: Facing): Promise<LiveCamera> {
    if (!navigator.mediaDevices?.getUserMedia)
      throw new Failure(isSecureContext ? "no-camera" : "insecure");
    const stream = await navigator.mediaDevices.getUserMedia(wishes(facing)).catch(explain);
    const camera = new LiveCamera(video, stream, actualFacing(stream) ?? facing);
    try {
      video.srcObject = stream;
      await video.play();
      if (!video.videoWidth) await once(video, "resize");
      return camera;
    } catch (error) {
      camera.close();
      return explain(error);
    }
  }

  get width(): number {
    return this.source.videoWidth;
  }

  get height(): number {
    return this.source.videoHeight;
  }

  grab(): Promise<Frame> {
    return frameOfVideo(this.source);
  }

  /** Films as finely as the camera can, of the same shape, as long as `act` takes. */
  async atFullSize<T>(act: () => Promise<T>): Promise<T> {
    const [track] = this.stream.getVideoTracks();
    const { width, height } = this;
    const most = track && finestSize(track.getCapabilities?.(), { width, height });
    if (!track || !most) return act();
    try {
      const resized = soon(once(this.source, "resize"), RESIZE_MS);
      await track.applyConstraints({ width: most.width, height: most.height }).catch(() => {});
      await resized;
      return await act();
    } finally {
      await track.applyConstraints(wishes(this.facing).video).catch(() => {});
    }
  }

  close(): void {
    this.onLost = () => {};
    for (const track of this.stream.getTracks()) track.stop();
    if (this.source.srcObject === this.stream) this.source.srcObject = null;
  }
}

/** Whether there is another camera to change to. */
export async function hasSeveralCameras(): Promise<boolean> {
  const devices = (await navigator.mediaDevices?.enumerateDevices?.()) ?? [];
  return devices.filter((device) => device.kind === "videoinput").length > 1;
}

/** No size that the browser would crop for: that would change the field of view. */
function wishes(facing: Facing) {
  const video = {
    facingMode: { ideal: facing },
    width: { ideal: 1280 },
    height: { ideal: 720 },
    resizeMode: "none", // missing from the types
  };
  return { audio: false, video };
}

/** The largest size of the same shape that a camera offers; null where it is used already. */
export function finestSize(
  capabilities: MediaTrackCapabilities | undefined,
  { width, height }: Size,
): Size | null {
  const [widest, highest] = [capabilities?.width?.max ?? 0, capabilities?.height?.max ?? 0];
  // A phone held upright turns its frames: the camera counts its own long side as the width.
  const isTurned = height > width !== highest > widest;
  const [across, down] = isTurned ? [height, width] : [width, height];
  const scale = Math.min(widest / across, highest / down);
  if (!(scale > 1.05)) return null;
  return { width: Math.round(across * scale), height: Math.round(down * scale) };
}

/** Which way the camera looks that was really given; desktops do not say. */
function actualFacing(stream: MediaStream): Facing | undefined {
  const facing = stream.getVideoTracks()[0]?.getSettings().facingMode;
  return facing === "user" || facing === "environment" ? facing : undefined;
}

function explain(error: unknown): never {
  const name = error instanceof DOMException ? error.name : "";
  throw new Failure(FAILURES[name] ?? "unexpected", String(error));
}

/** Waits for something, but not longer. */
function soon(what: Promise<void>, patienceMs: number): Promise<void> {
  return Promise.race([what, new Promise<void>((done) => setTimeout(done, patienceMs))]);
}

function once(target: EventTarget, event: string): Promise<void> {
  return new Promise((resolve) => target.addEventListener(event, () => resolve(), { once: true }));
}

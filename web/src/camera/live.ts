/** The phone's camera: opened on demand, off while the page is hidden. */
import { type Frame, frameOfVideo } from "deeplight/core";
import { Failure, type FailureKind } from "../failure.ts";
import type { Facing } from "../sensors/orientation.ts";
import type { Picture } from "./picture.ts";

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
function wishes(facing: Facing): MediaStreamConstraints {
  const video = {
    facingMode: { ideal: facing },
    width: { ideal: 1280 },
    height: { ideal: 720 },
    resizeMode: "none", // missing from the types
  };
  return { audio: false, video };
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

function once(target: EventTarget, event: string): Promise<void> {
  return new Promise((resolve) => target.addEventListener(event, () => resolve(), { once: true }));
}

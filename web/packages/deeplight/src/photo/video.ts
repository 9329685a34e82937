/** Frames of a video. */
import type { Frame } from "../estimate/picker.ts";

/** What a video shows now, upright and at full size. */
export async function frameOfVideo(video: HTMLVideoElement): Promise<Frame> {
  return filmed(video) ?? createImageBitmap(video);
}

/** Calls `seen` for every new frame of a video; the result stops it. */
export function onEachFrame(video: HTMLVideoElement, seen: () => void): () => void {
  let stopped = false;
  const next = (): void => {
    if (stopped) return;
    seen();
    wait();
  };
  const wait = (): void => {
    if ("requestVideoFrameCallback" in video) video.requestVideoFrameCallback(next);
    else requestAnimationFrame(next);
  };
  wait();
  return () => {
    stopped = true;
  };
}

/**
 * The frame as it came from the camera, which costs nothing; undefined where the browser cannot
 * say that it is upright: that is why it gets this far only where frames know their rotation.
 */
function filmed(video: HTMLVideoElement): VideoFrame | undefined {
  if (typeof VideoFrame === "undefined" || !("rotation" in VideoFrame.prototype)) return undefined;
  try {
    return new VideoFrame(video);
  } catch {
    return undefined; // no frame yet, or one that must not be read
  }
}

/** Whatever holds a picture, as a frame for the worker; the caller keeps what it gave. */
import type { Frame } from "../estimate/picker.ts";
import { type CameraFacts, cameraFacts } from "./camera-facts.ts";
import { drawStill } from "./still.ts";
import { frameOfVideo } from "./video.ts";

export type PhotoSource =
  | Blob
  | HTMLImageElement
  | HTMLVideoElement
  | HTMLCanvasElement
  | OffscreenCanvas
  | ImageBitmap
  | ImageData
  | VideoFrame;

export interface Taken extends CameraFacts {
  readonly frame: Frame;
  readonly width: number;
  readonly height: number;
  /** The name of its file, where it has one. */
  readonly file: string | null;
}

/** @throws RangeError where there are no pixels, DOMException where they cannot be read, TypeError for an address. */
export async function taken(source: PhotoSource): Promise<Taken> {
  if (typeof source !== "object" || source === null) {
    const got = typeof source === "string" ? "a string" : String(source);
    throw new TypeError(
      `expected a File, image, video or canvas, got ${got}: fetch an address first`,
    );
  }
  if (source instanceof Blob) return fromFile(source);
  if (isA(source, "HTMLVideoElement")) {
    const { videoWidth: width, videoHeight: height } = source;
    measured(width, height);
    return { ...NOTHING_KNOWN, frame: await frameOfVideo(source), width, height };
  }
  if (isA(source, "HTMLImageElement")) {
    await source.decode();
    return still(source, source.naturalWidth, source.naturalHeight);
  }
  if (source instanceof ImageData) return fromBitmap(await createImageBitmap(source));
  if (isA(source, "VideoFrame")) return still(source, source.displayWidth, source.displayHeight);
  return still(source, source.width, source.height);
}

const NOTHING_KNOWN = { file: null, verticalFovRad: undefined, up: null };

async function fromFile(file: Blob): Promise<Taken> {
  const bitmap = await createImageBitmap(file);
  const facts = cameraFacts(await file.arrayBuffer(), bitmap.width, bitmap.height);
  const name = typeof File !== "undefined" && file instanceof File ? file.name : null;
  return { ...fromBitmap(bitmap), file: name, ...facts };
}

function fromBitmap(bitmap: ImageBitmap): Taken {
  try {
    return still(bitmap, bitmap.width, bitmap.height);
  } finally {
    bitmap.close();
  }
}

function still(source: CanvasImageSource, width: number, height: number): Taken {
  measured(width, height);
  const canvas = drawStill(new OffscreenCanvas(1, 1), source, width, height);
  const frame =
    typeof VideoFrame === "undefined"
      ? canvas.transferToImageBitmap()
      : new VideoFrame(canvas, { timestamp: 0, alpha: "discard" });
  return { ...NOTHING_KNOWN, frame, width: canvas.width, height: canvas.height };
}

function measured(width: number, height: number): void {
  if (!(width > 0 && height > 0)) {
    throw new RangeError("expected a picture that has been loaded, got none of its pixels yet");
  }
}

/** Not every worker and browser has all of these classes. */
function isA<K extends "HTMLVideoElement" | "HTMLImageElement" | "VideoFrame">(
  source: unknown,
  name: K,
): source is InstanceType<(typeof globalThis)[K]> {
  const kind = (globalThis as Record<string, unknown>)[name];
  return typeof kind === "function" && source instanceof kind;
}

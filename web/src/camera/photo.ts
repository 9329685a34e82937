/** A photo from a file, upright, as large as browsers can hold. */
import { type CameraFacts, cameraFacts, drawStill, type Frame } from "deeplight/core";
import { Failure } from "../failure.ts";
import type { Picture } from "./picture.ts";

const MOST_BYTES = 100e6;
const MOST_PIXELS = 100e6;

export class Photo implements Picture {
  readonly kind = "photo";

  readonly verticalFovRad: number | undefined;
  readonly up: CameraFacts["up"];

  private constructor(
    readonly file: string | null,
    readonly source: HTMLCanvasElement,
    { verticalFovRad, up }: CameraFacts,
  ) {
    this.verticalFovRad = verticalFovRad;
    this.up = up;
  }

  /**
   * Reads a picture file.
   *
   * @throws Failure `photo-too-large`, `photo-too-small` or `photo-unreadable`.
   */
  static async open(file: Blob): Promise<Photo> {
    if (file.size > MOST_BYTES) throw new Failure("photo-too-large");
    const bitmap = await createImageBitmap(file).catch((error: unknown) => {
      throw new Failure("photo-unreadable", String(error));
    });
    try {
      const { width, height } = bitmap;
      if (width * height > MOST_PIXELS) throw new Failure("photo-too-large");
      if (Math.min(width, height) < 32) throw new Failure("photo-too-small");
      const facts = cameraFacts(await file.arrayBuffer(), width, height);
      const name = file instanceof File ? file.name : null;
      return new Photo(name, drawn(bitmap, width, height), facts);
    } finally {
      bitmap.close();
    }
  }

  /** The frame that a live camera shows now, kept. */
  static of(picture: Picture): Photo {
    const { source, width, height } = picture;
    return new Photo(picture.file, drawn(source, width, height), picture);
  }

  get width(): number {
    return this.source.width;
  }

  get height(): number {
    return this.source.height;
  }

  async grab(): Promise<Frame> {
    if (typeof VideoFrame === "undefined") return createImageBitmap(this.source);
    return new VideoFrame(this.source, { timestamp: 0, alpha: "discard" });
  }

  atFullSize<T>(act: () => Promise<T>): Promise<T> {
    return act();
  }

  close(): void {
    this.source.width = this.source.height = 0; // gives the memory back at once
  }
}

function drawn(source: CanvasImageSource, width: number, height: number): HTMLCanvasElement {
  try {
    return drawStill(document.createElement("canvas"), source, width, height);
  } catch (error) {
    throw new Failure("photo-too-large", String(error));
  }
}

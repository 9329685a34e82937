/** What is on screen: the light is estimated from it, and the object stands in it. */
import type { CameraFacts, Frame } from "deeplight/core";

export interface Picture extends CameraFacts {
  readonly kind: "live" | "photo";
  /** The name of its file; null for a camera's. */
  readonly file: string | null;
  /** Upright size in pixels. A live one changes when the phone is turned. */
  readonly width: number;
  readonly height: number;
  /** What can be drawn: always upright, never mirrored. */
  readonly source: HTMLVideoElement | HTMLCanvasElement;
  /** The pixels of now, at full size. */
  grab(): Promise<Frame>;
  /** Does something while the picture is as large as it can be. */
  atFullSize<T>(act: () => Promise<T>): Promise<T>;
  /** Lets go of the camera or the memory. */
  close(): void;
}

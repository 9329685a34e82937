/** Estimates the light of what is on screen: of a photo once, of a camera's newest frame for ever. */

import { type Estimator, type Lighting, type Matrix3x3, onEachFrame } from "deeplight/core";
import type { Picture } from "../camera/picture.ts";

/** The light of one frame, and how the camera was held when it was taken. */
export interface Seen {
  readonly lighting: Lighting;
  readonly worldFromCamera: Matrix3x3;
  readonly tookMs: number;
}

export interface Watcher {
  pose(): Matrix3x3;
  verticalFovRad(picture: Picture): number | undefined;
  seen(seen: Seen): void;
  failed(error: unknown): void;
}

export class Watch {
  private stopFrames = (): void => {};
  private picture: Picture | null = null;
  private busy = false;
  private again = false;

  constructor(
    readonly estimator: Estimator,
    private readonly watcher: Watcher,
  ) {}

  start(picture: Picture): void {
    this.stop();
    this.picture = picture;
    if (picture.source instanceof HTMLVideoElement) {
      this.stopFrames = onEachFrame(picture.source, () => this.look());
    } else {
      this.look();
    }
  }

  /** Estimates what is shown now; where one is under way, as soon as that is done. */
  look(): void {
    this.again = true;
    if (!this.busy) void this.estimate();
  }

  stop(): void {
    this.stopFrames();
    this.stopFrames = () => {};
    this.picture = null;
    this.again = false;
  }

  private async estimate(): Promise<void> {
    this.busy = true;
    while (this.again && this.picture) {
      this.again = false;
      await this.one(this.picture).catch((error: unknown) => {
        this.stop();
        this.watcher.failed(error);
      });
    }
    this.busy = false;
  }

  private async one(picture: Picture): Promise<void> {
    // While a model loads, a film goes on: its first frame would be old.
    if (picture.kind === "live") await this.estimator.loaded.catch(() => {});
    if (this.picture !== picture) return;
    const worldFromCamera = this.watcher.pose();
    const frame = await picture.grab();
    const estimate = await this.estimator.estimate(frame, this.watcher.verticalFovRad(picture));
    if (!estimate || this.picture !== picture) return; // of a picture that is gone
    const tookMs = estimate.preprocessMs + estimate.runMs;
    this.watcher.seen({ lighting: estimate.lighting, worldFromCamera, tookMs });
  }
}

/** Estimates the light of what is on screen: of a photo once, of a camera as long as it films. */

import {
  type Confidence,
  type Estimate,
  type Estimator,
  headsIn,
  Light,
  type Matrix3x3,
  onEachFrame,
} from "deeplight/core";
import type { Picture } from "../camera/picture.ts";

/** Rows of a photo's light, and of what a camera has seen. */
const PHOTO_ROWS = 256;
const LIVE_ROWS = 128;
/** Between two lights of all frames: the object's light follows no faster than this. */
const LIVE_MS = 200;
/** And no more than this part of the time is spent on it, however much has been seen: frames come first. */
const LIVE_SHARE = 1 / 6;
/** A tilt that two of three times is off by less is better than the usual one. */
const SURE_PITCH_RAD = 0.17;

/** The light of what is shown. */
export interface Seen {
  readonly light: Light;
  /** In whose frame it is: the camera's of a photo, the world's of a film. */
  readonly frame: "camera" | "world";
  /** Of a photo; null as long as it is not known. */
  readonly confidence: Confidence | null;
  /** More of the same photo's light is to come. */
  readonly isFirst: boolean;
  /** How the camera was tilted, as the photo says it; null where it does not. */
  readonly pitchRad: number | null;
  /** What the network says of a photo, for the light's file. */
  readonly heads?: Readonly<Record<string, number>> | null;
}

/** A frame of a film was looked at. */
export interface Looked {
  /** As the pictures say; null where the sensors do, and where it is not known any more. */
  readonly visualPose: Matrix3x3 | null;
  /** What was known was forgotten: another place, another light. */
  readonly isNew: boolean;
  readonly tookMs: number;
}

export interface Watcher {
  /** As the sensors say; null without them. */
  sensedPose(): Matrix3x3 | null;
  /** For the first frame without sensors. */
  startPose(): Matrix3x3;
  verticalFovRad(picture: Picture): number | undefined;
  seen(seen: Seen): void;
  looked(looked: Looked): void;
  failed(error: unknown): void;
}

export class Watch {
  private stopFrames = (): void => {};
  private picture: Picture | null = null;
  private busy = false;
  private isAsked = false;
  private litMs = Number.NEGATIVE_INFINITY;
  private restMs = LIVE_MS;

  constructor(
    readonly estimator: Estimator,
    private readonly watcher: Watcher,
  ) {}

  start(picture: Picture): void {
    this.stop();
    this.picture = picture;
    this.litMs = Number.NEGATIVE_INFINITY;
    if (picture.source instanceof HTMLVideoElement) {
      this.stopFrames = onEachFrame(picture.source, () => this.look());
    } else {
      this.look();
    }
  }

  /** Looks at what is shown now; where that is under way, as soon as it is done. */
  look(): void {
    this.isAsked = true;
    if (!this.busy) void this.estimate();
  }

  /** The light is wanted once more, even if it is the same. */
  again(): void {
    this.litMs = Number.NEGATIVE_INFINITY;
  }

  stop(): void {
    this.stopFrames();
    this.stopFrames = () => {};
    this.picture = null;
    this.isAsked = false;
  }

  private async estimate(): Promise<void> {
    this.busy = true;
    while (this.isAsked && this.picture) {
      this.isAsked = false;
      const { picture } = this;
      const one = picture.kind === "live" ? this.track(picture) : this.still(picture);
      await one.catch((error: unknown) => {
        this.stop();
        this.watcher.failed(error);
      });
    }
    this.busy = false;
  }

  private async still(picture: Picture): Promise<void> {
    const frame = await picture.grab();
    const facts = { verticalFovRad: this.watcher.verticalFovRad(picture), up: picture.up };
    const isGone = () => this.picture !== picture;
    const estimate = await this.estimator.estimate(frame, facts, PHOTO_ROWS, (first) => {
      if (isGone()) return;
      this.watcher.looked({
        visualPose: null,
        isNew: false,
        tookMs: first.preprocessMs + first.runMs,
      });
      const light = new Light(first.lighting, null);
      const pitchRad = this.pitchOf(first.others);
      this.watcher.seen({ light, frame: "camera", confidence: null, isFirst: true, pitchRad });
    });
    if (!estimate?.scene || isGone()) return;
    const { scene, confidence } = estimate;
    const light = Light.of(scene, null, scene.lamps);
    const heads = this.headsOf(estimate.others);
    const seen = { frame: "camera", isFirst: false, pitchRad: null } as const;
    this.watcher.seen({ ...seen, light, confidence, heads });
  }

  private async track(picture: Picture): Promise<void> {
    // While a model loads, a film goes on: its first frame would be old.
    await this.estimator.loaded.catch(() => {});
    if (this.picture !== picture) return;
    const now = performance.now();
    const rows = now - this.litMs >= this.restMs ? LIVE_ROWS : 0;
    const worldFromCamera = this.watcher.sensedPose();
    const evenIfSame = this.litMs === Number.NEGATIVE_INFINITY;
    const request = { worldFromCamera, start: this.watcher.startPose(), rows, evenIfSame };
    const frame = await picture.grab();
    const tracked = await this.estimator.track(
      frame,
      this.watcher.verticalFovRad(picture),
      request,
    );
    if (!tracked || this.picture !== picture) return; // of a picture that is gone
    const { preprocessMs, runMs, fuseMs, isNew } = tracked;
    const visualPose = worldFromCamera ? null : tracked.worldFromCamera;
    this.watcher.looked({ visualPose, isNew, tookMs: preprocessMs + runMs + fuseMs });
    if (!tracked.light) return;
    this.litMs = now;
    this.restMs = Math.max(LIVE_MS, fuseMs / LIVE_SHARE);
    const light = Light.of(tracked.light, null);
    const nothingMore = { confidence: null, isFirst: false, pitchRad: null };
    this.watcher.seen({ light, frame: "world", ...nothingMore });
  }

  /** Where the network says it and is sure enough. */
  private pitchOf(others: Estimate["others"]): number | null {
    const { pitch_rad: pitch, pitch_scale: scale } = this.headsOf(others) ?? {};
    return pitch !== undefined && scale !== undefined && scale < SURE_PITCH_RAD ? pitch : null;
  }

  private headsOf(others: Estimate["others"]): Readonly<Record<string, number>> | null {
    const { model } = this.estimator;
    return model && headsIn(others, model.contract);
  }
}

/** Where the object stands, how it is turned and how large it is. */
import { angleBetween, type Matrix3x3 } from "deeplight/core";
import { headingOf } from "../sensors/pose.ts";
import type { Movable } from "./gestures.ts";
import { groundPoint, sizeSpanning } from "./ground.ts";
import type { Stage } from "./stage.ts";

/** Where it stands first: a little below the middle, above the tools. */
const FIRST_PLACE = [0.5, 0.7] as const;
/** Of the view's shorter side, as in `deeplight compose`. */
const FIRST_SHARE = 0.34;
/** Of its own heading, so that it shows itself from the front and a side. */
const FIRST_TURN_RAD = Math.PI / 5;
/** From one frame to the next nobody turns so far. */
const JUMP_RAD = 0.2;
const SMALLEST_M = 0.02;
const LARGEST_M = 4;

export class Hand implements Movable {
  /** Called after every change. */
  onChange: () => void = () => {};

  constructor(private readonly stage: Stage) {}

  get sizeM(): number {
    return this.stage.anchor.scale.x;
  }

  set sizeM(size: number) {
    this.stage.anchor.scale.setScalar(Math.min(Math.max(size, SMALLEST_M), LARGEST_M));
    this.changed();
  }

  /** From facing the camera's first heading, anticlockwise, within half a turn. */
  get turnRad(): number {
    return this.stage.anchor.rotation.y;
  }

  set turnRad(angle: number) {
    this.stage.anchor.rotation.y = Math.atan2(Math.sin(angle), Math.cos(angle));
    this.stage.relight();
    this.changed();
  }

  standAt(x: number, y: number): void {
    this.stage.standAt(within(x), within(y));
    this.changed();
  }

  aim(place: readonly [number, number] | null): void {
    this.stage.aimAt(place);
  }

  place(): readonly [number, number] {
    return this.stage.place();
  }

  turnBy(angleRad: number): void {
    this.turnRad += angleRad;
  }

  scaleBy(factor: number): void {
    this.sizeM *= factor;
  }

  reset(): void {
    const view = this.stage.viewpoint;
    this.stage.standAt(...FIRST_PLACE);
    this.stage.anchor.scale.setScalar(
      sizeSpanning(view, groundPoint(view, ...FIRST_PLACE), FIRST_SHARE),
    );
    this.turnRad = headingOf(view.worldFromCamera) + FIRST_TURN_RAD;
  }

  /** Where the world's axes have changed under the camera, the object stays where it is seen, and as. */
  keepInSight(before: Matrix3x3, now: Matrix3x3): void {
    if (angleBetween(before, now) < JUMP_RAD) return;
    const place = this.stage.place();
    this.turnBy(headingOf(now) - headingOf(before));
    this.stage.setPose(now);
    this.standAt(...place);
  }

  private changed(): void {
    this.stage.invalidate();
    this.onChange();
  }
}

/** Not so far out of the view that it cannot be found again. */
function within(share: number): number {
  return Math.min(Math.max(share, 0.02), 0.98);
}

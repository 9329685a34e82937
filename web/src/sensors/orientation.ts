/** Where the camera looks, from the phone's orientation sensors. */

import { type Matrix3x3, product } from "deeplight/core";
import { Failure } from "../failure.ts";
import { rotation } from "./pose.ts";

/** Which way a phone's camera looks: away from the user, or at them. */
export type Facing = "environment" | "user";

/** Angles of a DeviceOrientationEvent, in degrees. */
export interface DeviceAngles {
  readonly alpha: number;
  readonly beta: number;
  readonly gamma: number;
}

/** The sensors' earth has +Z up; ours has +Y up. */
const WORLD_FROM_EARTH = rotation("x", -Math.PI / 2);
/** A selfie camera looks the other way; its picture is not mirrored here. */
const REAR_FROM_FRONT: Matrix3x3 = [-1, 0, 0, 0, 1, 0, 0, 0, -1];
const RADIANS = Math.PI / 180;

/**
 * The camera's pose in a world whose +Y is up; its heading is arbitrary.
 *
 * W3C's device axes (x to the right of the screen, y to its top, z out of it) are the rear camera's own
 * while the phone stands upright; `screenDeg` is how far the picture is turned from that.
 */
export function cameraPose(
  { alpha, beta, gamma }: DeviceAngles,
  screenDeg: number,
  facing: Facing,
): Matrix3x3 {
  const turns = [
    WORLD_FROM_EARTH,
    rotation("z", alpha * RADIANS),
    rotation("x", beta * RADIANS),
    rotation("y", gamma * RADIANS),
    rotation("z", -screenDeg * RADIANS),
  ];
  const rear = turns.reduce(product);
  return facing === "user" ? product(rear, REAR_FROM_FRONT) : rear;
}

interface AskingEvent {
  requestPermission?: () => Promise<PermissionState>;
}

/** Whether the sensors may be read without asking: so everywhere but on iPhones. */
export async function mayRead(): Promise<boolean> {
  if (!asking()?.requestPermission) return true;
  try {
    const name = "accelerometer" as PermissionName; // missing from the types
    return (await navigator.permissions.query({ name })).state === "granted";
  } catch {
    return false; // Safari knows no such permission
  }
}

export class OrientationSensor {
  private angles: DeviceAngles | undefined;
  private listening = false;
  /** Called at every new reading, and at the first since the start. */
  onReading: () => void = () => {};
  onFirstReading: () => void = () => {};

  /**
   * Starts listening, asking first where that is needed; then it must be called from a tap.
   *
   * @throws Failure `motion-denied`.
   */
  async ask(): Promise<void> {
    if (!(await mayAfterAsking())) throw new Failure("motion-denied");
    this.start();
  }

  /** Starts listening; without permission nothing comes. */
  start(): void {
    if (this.listening || !("DeviceOrientationEvent" in window)) return;
    this.listening = true;
    addEventListener("deviceorientation", this.read);
  }

  /** Whether readings come. */
  get isOn(): boolean {
    return this.angles !== undefined;
  }

  /** @throws Failure `no-motion` when none has come after `patienceMs`. */
  async firstReading(patienceMs: number): Promise<void> {
    for (let waited = 0; !this.isOn; waited += 50) {
      if (waited > patienceMs) throw new Failure("no-motion");
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }

  stop(): void {
    removeEventListener("deviceorientation", this.read);
    this.listening = false;
    this.angles = undefined;
  }

  /** The pose of now; undefined without sensors. */
  pose(facing: Facing): Matrix3x3 | undefined {
    return this.angles && cameraPose(this.angles, screenAngle(), facing);
  }

  private readonly read = ({ alpha, beta, gamma }: DeviceOrientationEvent): void => {
    if (beta === null || gamma === null) return; // a desktop answers with nothing
    const isFirst = !this.isOn;
    this.angles = { alpha: alpha ?? 0, beta, gamma };
    if (isFirst) this.onFirstReading();
    this.onReading();
  };
}

function screenAngle(): number {
  return screen.orientation?.angle ?? (window as { orientation?: number }).orientation ?? 0;
}

/** The question must come first in a tap's own task, or iPhones refuse it. */
async function mayAfterAsking(): Promise<boolean> {
  const event = asking();
  if (!event?.requestPermission) return true;
  return (await event.requestPermission().catch(() => "denied")) === "granted";
}

function asking(): AskingEvent | undefined {
  return (window as { DeviceOrientationEvent?: AskingEvent }).DeviceOrientationEvent;
}

/**
 * What keeps a light steady that is shown while one turns: steady.py, which says why.
 */
import { FUSE } from "../contract/generated.ts";
import { luminous } from "../light/lamp.ts";
import { type Matrix3x3, transposed, turned, type Vector3 } from "../light/matrix.ts";

const { CLEARLY, ENOUGH_SEEN, MOST_SHADE, ROOM } = FUSE;

/** What was shown last; null before anything was. */
export interface Kept {
  /** ln of its power, in the session's unit. */
  logPower: number | null;
  /** Where the lamp was put, in the world. */
  lamp: Vector3 | null;
}

/** How to show the next light. */
export class Steadily {
  /**
   * @param kept what was shown, and will have been.
   * @param unit ln of the gain relative to whose white the light is.
   * @param worldFromFrame the frame that it is in.
   */
  constructor(
    private readonly kept: Kept,
    private readonly unit: Vector3,
    private readonly worldFromFrame: Matrix3x3,
  ) {}

  /**
   * Where to put the lamp.
   *
   * @param brightest where nothing was shown yet.
   * @param brightness how bright the surroundings of a direction are; 0 where it was seen.
   */
  place(brightest: Vector3, brightness: (direction: Vector3) => number): Vector3 {
    const { lamp } = this.kept;
    const before = lamp && turned(transposed(this.worldFromFrame), lamp);
    const stays = before && brightness(brightest) < CLEARLY * brightness(before);
    const found = stays ? before : brightest;
    this.kept.lamp = turned(this.worldFromFrame, found);
    return found;
  }

  /**
   * By what factor to change the light that is only believed.
   *
   * @param known power of what is known, summed over all directions, RGB; `believed` likewise.
   * @param seen share of the sphere.
   */
  shade(known: Vector3, believed: Vector3, seen: number): number {
    const [sure, rest] = [known, believed].map((power) =>
      luminous(power.map((value, c) => value * Math.exp(-this.unit[c]!)) as unknown as Vector3),
    ) as [number, number];
    if (!(rest > 0)) return 1;
    const log = Math.log(sure + rest);
    const room = ROOM * Math.max(0, 1 - seen / ENOUGH_SEEN);
    const wanted = Math.min(Math.max(this.kept.logPower ?? log, log - room), log + room);
    const factor = Math.min(Math.max((Math.exp(wanted) - sure) / rest, 1 / MOST_SHADE), MOST_SHADE);
    this.kept.logPower = Math.log(sure + factor * rest);
    return factor;
  }
}

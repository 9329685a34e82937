/** The frames of one place, one after the other: an estimate where something moved, and the light of all. */

import { FUSE } from "../contract/generated.ts";
import { EstimateError } from "../errors.ts";
import { type Added, Session } from "../fuse/session.ts";
import { type SmallPicture, smallSize } from "../fuse/view.ts";
import { VisualRotation } from "../fuse/visual-rotation.ts";
import type { Environment } from "../light/environment.ts";
import { angleBetween, IDENTITY, type Matrix3x3 } from "../light/matrix.ts";
import type { Contract } from "../network/contract.ts";
import { type Network, requireFinite } from "../network/network.ts";
import { sessionFile, sessionOf } from "../save/session-file.ts";
import { CellMeans, wholePhoto } from "./cell-means.ts";
import { framePhoto, slidIntoPhoto } from "./framing.ts";
import { seenFromPhoto } from "./look.ts";
import { type Frame, type Picker, sizeOf } from "./picker.ts";
import type { FusedRequest, TrackRequest } from "./worker.ts";

/** Turned by less, and with pixels that differ by less on average, a frame says nothing new. */
const STILL_RAD = 0.004;
const STILL_LEVELS = 1.5;
/** This number of pictures in a row that show nothing known, and the place counts as left. */
const PATIENCE = 8;

/** What became of a frame. */
export interface Tracked {
  /** How the camera was held; null where that is not known any more. */
  readonly worldFromCamera: Matrix3x3 | null;
  /** Nothing had moved, so nothing was estimated. */
  readonly isStill: boolean;
  /** What is known was begun anew: the place or the light changed. */
  readonly isNew: boolean;
  /** Null where the frame was not taken in. */
  readonly added: Added | null;
  /** The light of all frames in the world's frame, relative to this frame's white; null where not asked for. */
  readonly light: Environment | null;
  readonly preprocessMs: number;
  readonly runMs: number;
  readonly fuseMs: number;
}

export class Tracker {
  #session = new Session();
  readonly #visual = new VisualRotation();
  #last: { picture: SmallPicture; pose: Matrix3x3 } | null = null;
  #logGain: Added["logGain"] = [0, 0, 0];
  #isVisual = false;
  /** The light of what is known has been given. */
  #isLit = false;
  #lost = 0;
  /** The last picture contradicted what was known: the next ones decide, however still they are. */
  #isDoubted = false;

  /** Takes in a frame, which is closed. */
  async next(
    loading: Promise<Network>,
    picker: Picker,
    frame: Frame,
    fov: number | undefined,
    request: TrackRequest,
  ): Promise<Tracked> {
    const network = await loading;
    const started = performance.now();
    const { picture, planes, framing } = await taken(network.contract, picker, frame, fov);
    const { pose, isNew } = this.#held(picture, request);
    const prepared = performance.now();
    const times = { preprocessMs: prepared - started, runMs: 0, fuseMs: 0 };
    if (!pose || (this.#isStill(picture, pose) && !this.#isDoubted)) {
      const nothing = { isStill: pose !== null, isNew: false, added: null };
      return { ...times, ...nothing, light: this.#light(request), worldFromCamera: pose };
    }
    const shown = network.estimate(planes());
    const { logRadiance } = seenFromPhoto([shown], network.contract, [framing]);
    requireFinite(logRadiance);
    const done = performance.now();
    const added = this.#add(picture, pose, logRadiance);
    const light = this.#light(request);
    return {
      light,
      worldFromCamera: pose,
      isStill: false,
      isNew: isNew || added.forgotten,
      added,
      preprocessMs: prepared - started,
      runMs: done - prepared,
      fuseMs: performance.now() - done,
    };
  }

  /** The light of all frames in a camera's frame, relative to the newest frame's white; null without any. */
  fused({ worldFromCamera, rows }: FusedRequest): Environment | null {
    if (this.#session.views.length === 0) return null;
    return this.#session.environment(rows, worldFromCamera, this.#logGain);
  }

  /** What was seen so far as a file; null where nothing was. */
  saved(): Uint8Array<ArrayBuffer> | null {
    return this.#session.views.length > 0 ? sessionFile(this.#session) : null;
  }

  /** Goes on from a file; gives how many views it has. @throws EstimateError */
  restore(file: Uint8Array): number {
    let session: Session;
    try {
      session = sessionOf(file);
    } catch (error) {
      throw new EstimateError("session-damaged", String(error));
    }
    this.leave();
    const { views, gains } = session;
    const newest = views.reduce(
      (best, { number }, k) => (number > views[best]!.number ? k : best),
      0,
    );
    const [red, green, blue] = gains.subarray(3 * newest, 3 * newest + 3);
    [this.#session, this.#logGain] = [session, [red!, green!, blue!]];
    this.#isLit = false;
    this.#visual.goOn(views);
    return views.length;
  }

  /** Forgets everything: the place has been left. */
  leave(): void {
    this.#session.reset();
    this.#visual.reset();
    this.#last = null;
    this.#lost = 0;
    this.#isDoubted = false;
  }

  /** How the camera is held: as was said, else as the pictures show. */
  #held(picture: SmallPicture, { worldFromCamera: said, start }: TrackRequest) {
    const isVisual = said === null;
    // The two have worlds of their own.
    const changed = this.#last !== null && isVisual !== this.#isVisual;
    if (changed) this.leave();
    this.#isVisual = isVisual;
    if (said) return { pose: said, isNew: changed };
    // A covered lens is no other place.
    if (this.#last && isDark(picture)) return { pose: null, isNew: changed };
    let pose = this.#visual.next(picture, start);
    this.#lost = pose ? 0 : this.#lost + 1;
    if (this.#lost < PATIENCE) return { pose, isNew: changed };
    pose = this.#visual.findAgain(picture);
    this.#lost = 0;
    if (pose) return { pose, isNew: changed };
    this.leave();
    return { pose: this.#visual.next(picture, start), isNew: true };
  }

  #add(picture: SmallPicture, pose: Matrix3x3, logRadiance: Float32Array): Added {
    const added = this.#session.add(picture, pose, logRadiance);
    this.#last = { picture, pose };
    this.#logGain = added.logGain;
    this.#isLit = false;
    this.#isDoubted = added.disagreement > FUSE.CHANGED && !added.forgotten;
    return added;
  }

  #isStill(picture: SmallPicture, pose: Matrix3x3): boolean {
    const { picture: before, pose: held } = this.#last ?? {};
    if (!before || !held || before.pixels.length !== picture.pixels.length) return false;
    if (angleBetween(held, pose) > STILL_RAD) return false;
    let sum = 0;
    for (let i = 0; i < picture.pixels.length; i++) {
      sum += Math.abs(picture.pixels[i]! - before.pixels[i]!);
    }
    return sum / picture.pixels.length < STILL_LEVELS;
  }

  #light({ rows, evenIfSame }: TrackRequest): Environment | null {
    const isNeeded = rows > 0 && this.#session.views.length > 0;
    if (!isNeeded || (this.#isLit && !evenIfSame)) return null;
    this.#isLit = true;
    return this.#session.environment(rows, IDENTITY, this.#logGain, true);
  }
}

/** Whether there is more noise and rounding than light, as where a hand covers the lens. */
function isDark({ pixels }: SmallPicture): boolean {
  return pixels.reduce((sum, value) => sum + value, 0) < FUSE.DARKEST * pixels.length;
}

/** The network's input and the small picture that is kept, of a frame, which is closed. */
async function taken(contract: Contract, picker: Picker, frame: Frame, fov: number | undefined) {
  const photo = sizeOf(frame);
  const framing = slidIntoPhoto(framePhoto(photo.height, photo.width, fov, contract));
  const { verticalFovRad } = framing;
  const small = smallSize(photo.height, photo.width, verticalFovRad);
  const [means, whole] = [new CellMeans(framing), new CellMeans(wholePhoto(photo, small))];
  const isReversed = await picker.pick(frame, means, whole);
  frame.close();
  const rounded = new Uint8ClampedArray(whole.rgb(isReversed, 255));
  const pixels = new Uint8Array(rounded.buffer);
  const planes = () => means.planes(contract.input_low, contract.input_high, isReversed);
  return { picture: { ...small, pixels, verticalFovRad }, planes, framing };
}

/**
 * Light that gathers while one looks around: a few dozen small views, solved again with each.
 * session.py, and its golden values. Memory is constant: at most `mostViews` pictures
 * of 192 rows, and of each what it shows of the light asked for last, a third of a megabyte.
 */
import { FUSE } from "../contract/generated.ts";
import type { Environment } from "../light/environment.ts";
import { angleBetween, IDENTITY, type Matrix3x3 } from "../light/matrix.ts";
import { overlapOf, placesOf, solveGains, trusted } from "./gains.ts";
import { environmentOf } from "./merge.ts";
import { type Kept as Shown, Steadily } from "./steady.ts";
import { type Cells, cellsOf, logPower, type SmallPicture, type View } from "./view.ts";

const {
  CHANGED,
  LEAST_OVERLAP_SR,
  LIKE_EXPOSURE,
  MOST_VIEWS,
  MUCH_OVERLAP_SR,
  NEAR_RAD,
  PATIENCE,
} = FUSE;

/** What became of a frame. */
export interface Added {
  /** How many are kept now. */
  readonly views: number;
  /** Everything before the last few frames was dropped: the light or the place changed. */
  readonly forgotten: boolean;
  /** Of this frame with what was known, ln; 0 where nothing overlaps. */
  readonly disagreement: number;
  /** ln of this frame's exposure and white balance over the first frame's, RGB. */
  readonly logGain: readonly [number, number, number];
}

/** All that a session needs to go on. */
export interface SessionState {
  readonly mostViews: number;
  readonly count: number;
  readonly strange: number;
  /** ln gain of the first view over the first frame ever. */
  readonly unit: readonly [number, number, number];
  readonly firstTurn: Matrix3x3;
  readonly views: readonly View[];
  /** Of the view that opened each one's place. */
  readonly places: readonly Matrix3x3[];
}

/** A kept view with what was computed from it once. */
interface Kept {
  readonly view: View;
  /** How the camera was turned that opened the place where the view is kept. */
  place: Matrix3x3;
  readonly cells: Cells;
  readonly places: Int32Array;
  readonly logPower: readonly number[];
  /** What it and others say of each other: this one's overlap with them. */
  readonly with: Map<Kept, Shared>;
}

/** ln by which the other is brighter, and how sure that is, RGB each. */
interface Shared {
  readonly difference: readonly number[];
  readonly weight: readonly number[];
}

type Rgb = readonly [number, number, number];

export class Session {
  #kept: readonly Kept[] = [];
  #logGain: Float64Array = new Float64Array(); // relative to the first kept view
  #unit: Rgb = [0, 0, 0]; // ln gain of the first kept view
  #firstTurn: Matrix3x3 = IDENTITY;
  #strange = 0;
  #count = 0;
  #trust: Float32Array[] | null = null;
  #shown: Shown = { logPower: null, lamp: null };

  constructor(readonly mostViews: number = MOST_VIEWS) {
    if (!(mostViews >= 2)) throw new RangeError(`expected 2 views or more, got ${mostViews}`);
  }

  /** Goes on where `state` was taken; gains are solved anew. @throws RangeError where it cannot be one. */
  static restored(state: SessionState): Session {
    const { mostViews, count, strange, unit, firstTurn, views, places } = state;
    const session = new Session(mostViews);
    views.forEach((view, k) => {
      session.#put(view, places[k]);
    });
    requireRotation(firstTurn);
    session.#solve();
    [session.#firstTurn, session.#unit] = [firstTurn, unit];
    [session.#count, session.#strange] = [count, strange];
    return session;
  }

  get state(): SessionState {
    const [count, strange, mostViews] = [this.#count, this.#strange, this.mostViews];
    const [unit, firstTurn, views] = [this.#unit, this.#firstTurn, this.views];
    const places = this.#kept.map(({ place }) => place);
    return { mostViews, count, strange, unit, firstTurn, views, places };
  }

  /** What is kept; the first one defines the unit. */
  get views(): readonly View[] {
    return this.#kept.map(({ view }) => view);
  }

  /** ln of each view's gain, RGB: 0 is the first frame's exposure and white balance. */
  get gains(): Float64Array {
    return this.#logGain.map((value, i) => value + this.#unit[(i % 3) as 0 | 1 | 2]);
  }

  /**
   * Takes in a frame.
   *
   * @param worldFromCamera how the camera was turned, in any world whose axes stand still.
   * @param logEstimate what the network gives for it: ln radiance on the ball.
   */
  add(picture: SmallPicture, worldFromCamera: Matrix3x3, logEstimate: Float32Array): Added {
    if (this.#kept.length === 0) this.#firstTurn = worldFromCamera;
    const number = this.#count++;
    const disagreement = this.#put({ ...picture, worldFromCamera, logEstimate, number });
    this.#solve();
    const at = 3 * (this.#kept.length - 1);
    const [red, green, blue] = this.gains.subarray(at, at + 3);
    this.#strange = disagreement > CHANGED ? this.#strange + 1 : 0;
    const forgotten = this.#strange >= PATIENCE;
    if (forgotten) this.#forget();
    else this.#thin();
    return {
      views: this.#kept.length,
      forgotten,
      disagreement,
      logGain: [red!, green!, blue!],
    };
  }

  /**
   * The light so far.
   *
   * @param height rows of the panorama.
   * @param worldFromCamera the camera in whose frame; left out, the first frame's.
   * @param logGain of the frame relative to whose white; left out, the first frame's.
   * @param steady for a light shown while one turns. Its power then stays what the last steady one
   *   had until that is contradicted by more than its uncertainty, which is gone once half of the
   *   sphere was seen, and the lamp where nothing was seen stays until another place is clearly
   *   brighter; what was seen stays itself.
   * @throws RangeError where nothing has been added.
   */
  environment(
    height: number = FUSE.HEIGHT,
    worldFromCamera: Matrix3x3 = this.#firstTurn,
    logGain: Rgb = [0, 0, 0],
    steady = false,
  ): Environment {
    if (this.#kept.length === 0) throw new RangeError("expected a frame, got none: add one first");
    const gains = this.gains.map((value, i) => value - logGain[(i % 3) as 0 | 1 | 2]);
    const cells = this.#kept.map((kept) => kept.cells);
    this.#trust ??= trusted(cells, gains);
    const gathered = { views: this.views, cells, logGain: gains, trust: this.#trust };
    const steadily = steady ? new Steadily(this.#shown, logGain, worldFromCamera) : null;
    return environmentOf(gathered, worldFromCamera, height, steadily);
  }

  /** Forgets everything: the place has been left. */
  reset(): void {
    this.#kept = [];
    this.#logGain = new Float64Array(0);
    this.#unit = [0, 0, 0];
    this.#strange = this.#count = 0;
    this.#trust = null;
    this.#shown = { logPower: null, lamp: null };
  }

  /** Keeps one more view; how far it disagrees with the others. */
  #put(view: View, place: Matrix3x3 = view.worldFromCamera): number {
    requireRotation(view.worldFromCamera);
    requireRotation(place);
    const cells = cellsOf(view);
    const power = logPower(view.logEstimate);
    const places = placesOf(cells);
    const newest: Kept = { view, place, cells, places, logPower: power, with: new Map() };
    const disagreement = this.#compare(newest);
    this.#kept = [...this.#kept, newest];
    return disagreement;
  }

  /** Notes what the newest and all before it share; how far they disagree. */
  #compare(newest: Kept): number {
    const before = newest.view.number - this.#strange; // later ones may be of the new place
    let [sum, whole] = [0, 0];
    for (const other of this.#kept) {
      const { difference, weight, shared, disagreement } = overlapOf(
        newest.cells,
        newest.places,
        other.cells,
      );
      newest.with.set(other, { difference, weight });
      other.with.set(newest, { difference: difference.map((value) => -value), weight });
      const sure = weight.reduce((a, b) => a + b, 0);
      const isAsked = sure > LEAST_OVERLAP_SR || shared > MUCH_OVERLAP_SR;
      if (!isAsked || other.view.number >= before) continue;
      sum += sure * disagreement;
      whole += sure;
    }
    return whole > 0 ? sum / whole : 0;
  }

  #solve(): void {
    this.#trust = null;
    const n = this.#kept.length;
    const [differences, weights] = [new Float64Array(3 * n * n), new Float64Array(3 * n * n)];
    this.#kept.forEach((one, i) => {
      this.#kept.forEach((other, j) => {
        const shared = one.with.get(other);
        if (!shared) return;
        differences.set(shared.difference, 3 * (i * n + j));
        weights.set(shared.weight, 3 * (i * n + j));
      });
    });
    const powers = this.#kept.map((kept) => kept.logPower);
    this.#logGain = solveGains(n, differences, weights, powers);
  }

  #forget(): void {
    const newest = [...this.#kept.keys()].sort((a, b) => this.#number(a) - this.#number(b));
    this.#keep(newest.slice(-PATIENCE));
    this.#strange = 0;
    this.#shown = { logPower: null, lamp: null };
  }

  #number(k: number): number {
    return this.#kept[k]!.view.number;
  }

  /** Drops the view whose place the newest takes, or the most redundant one. */
  #thin(): void {
    const newest = this.#kept.length - 1;
    const all = [...this.#kept.keys()];
    // The first view defines the unit, so it stays.
    const angles = all.slice(1, newest).map((k) => this.#angle(k, newest));
    const least = Math.min(...angles);
    const nearest = 1 + angles.indexOf(least);
    if (least < NEAR_RAD) {
      this.#kept[newest]!.place = this.#kept[nearest]!.place;
      this.#keep(all.slice(0, newest).map((k) => (k === nearest ? newest : k)));
    } else if (this.#kept.length > this.mostViews) {
      const alone = all.map((k) =>
        k === 0
          ? Number.POSITIVE_INFINITY
          : Math.min(...all.filter((j) => j !== k).map((j) => this.#angle(k, j))),
      );
      const worst = alone.indexOf(Math.min(...alone));
      this.#keep(all.filter((k) => k !== worst));
    }
  }

  /** Between the places of two views; of unlike exposure they are as far apart as can be. */
  #angle(i: number, j: number): number {
    const gain = (k: number) =>
      this.#logGain.subarray(3 * k, 3 * k + 3).reduce((a, b) => a + b) / 3;
    if (Math.abs(gain(i) - gain(j)) >= LIKE_EXPOSURE) return Math.PI;
    return angleBetween(this.#kept[i]!.place, this.#kept[j]!.place);
  }

  #keep(kept: readonly number[]): void {
    const shift = this.#logGain.slice(3 * kept[0]!, 3 * kept[0]! + 3);
    this.#unit = this.#unit.map((value, c) => value + shift[c]!) as unknown as Rgb;
    this.#logGain = Float64Array.from({ length: 3 * kept.length }, (_, i) => {
      return this.#logGain[3 * kept[Math.floor(i / 3)]! + (i % 3)]! - shift[i % 3]!;
    });
    const staying = new Set(kept.map((k) => this.#kept[k]!));
    const gone = this.#kept.filter((one) => !staying.has(one));
    this.#kept = kept.map((k) => this.#kept[k]!);
    for (const one of this.#kept) for (const other of gone) one.with.delete(other);
    this.#trust = null;
  }
}

/** @throws RangeError unless it is a rotation. */
function requireRotation(m: Matrix3x3): void {
  const dot = (i: number, j: number) =>
    [0, 1, 2].reduce((sum, k) => sum + m[(3 * i + k) as 0] * m[(3 * j + k) as 0], 0);
  const off = [0, 1, 2].flatMap((i) =>
    [0, 1, 2].map((j) => Math.abs(dot(i, j) - (i === j ? 1 : 0))),
  );
  if (!(Math.max(...off) < 1e-4)) throw new RangeError(`expected a rotation, got ${m}`);
}

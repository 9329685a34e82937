/** What a picture of a box on a plain floor says of the light that throws its shadow. */
import { transposed, turned, type Vector3 } from "deeplight/core";
import { groundPoint, ray, type Viewpoint } from "../src/view/ground.ts";
import type { Shown } from "./pages/sun.ts";

const GAMMA = 2.2;
const DEGREES = 180 / Math.PI;
/** How far inside its edge a shadow is looked at, in azimuth and elevation. */
const MARGINS: readonly Angles[] = [
  [4, 0],
  [-4, 0],
  [0, 4],
  [0, -4],
];
/** The page lets shadows fade from three quarters of its floor on; in sizes of the object. */
const UNFADED = 2.6;

/** Azimuth from straight ahead to the right, elevation; degrees. */
export type Angles = readonly [azimuth: number, elevation: number];

export function towards([azimuth, elevation]: Angles): Vector3 {
  const [a, e] = [azimuth / DEGREES, elevation / DEGREES];
  return [Math.sin(a) * Math.cos(e), Math.sin(e), -Math.cos(a) * Math.cos(e)];
}

export function degreesBetween(a: Angles, b: Angles): number {
  const [p, q] = [towards(a), towards(b)];
  const cosine = p.reduce((sum, value, axis) => sum + value * q[axis]!, 0);
  return Math.acos(Math.min(cosine, 1)) * DEGREES;
}

export class BoxShadow {
  private readonly green: Uint8Array;

  constructor(private readonly shown: Shown) {
    this.green = Uint8Array.from(Buffer.from(shown.green, "base64"));
  }

  /** Points of the floor that nothing hides, and which part of the light is missing there. */
  floor(step: number): { point: Vector3; missing: number }[] {
    const { view, width, height } = this.shown;
    const result = [];
    for (let row = 0; row < height; row += step) {
      for (let column = 0; column < width; column += step) {
        const place = [(column + 0.5) / width, (row + 0.5) / height] as const;
        if (this.hits([0, view.heightM, 0], ray(view, ...place))) continue;
        const pixel = this.green[row * width + column]! / this.shown.plain;
        result.push({ point: groundPoint(view, ...place), missing: 1 - pixel ** GAMMA });
      }
    }
    return result;
  }

  /** Whether a ray meets the box. */
  hits(from: Vector3, along: Vector3): boolean {
    const { foot, sizeM } = this.shown;
    let [near, far] = [1e-9, Number.POSITIVE_INFINITY];
    for (const axis of [0, 1, 2] as const) {
      const low = axis === 1 ? 0 : foot[axis]! - sizeM / 2;
      const [a, b] = [low, low + sizeM].map((side) => (side - from[axis]) / along[axis]);
      near = Math.max(near, Math.min(a!, b!));
      far = Math.min(far, Math.max(a!, b!));
    }
    return near < far;
  }

  /** Part of an even sky's light that the box takes from a point. */
  skyBehindBox(point: Vector3): number {
    const steps = 48;
    let blocked = 0;
    for (let i = 0; i < steps * steps; i++) {
      const [flat, turn] = [(Math.floor(i / steps) + 0.5) / steps, (i % steps) / steps];
      const [r, a] = [Math.sqrt(flat), 2 * Math.PI * turn];
      const along = [r * Math.cos(a), Math.sqrt(1 - flat), r * Math.sin(a)] as const;
      blocked += Number(this.hits(point, along));
    }
    return blocked / steps ** 2;
  }

  /**
   * Means over the shadow up to where the page lets it fade: which part of the light is missing, and
   * which part of an even sky the box hides.
   */
  inUmbra([azimuth, elevation]: Angles): { missing: number; sky: number } {
    const { foot, sizeM } = this.shown;
    const suns = MARGINS.map(([a, e]) => towards([azimuth + a, elevation + e]));
    const umbra = this.floor(12).filter(({ point: [x, , z], point }) => {
      const isNear = Math.hypot(x - foot[0]!, z - foot[2]!) < UNFADED * sizeM;
      return isNear && suns.every((sun) => this.hits(point, sun));
    });
    const mean = (values: number[]) => values.reduce((a, b) => a + b, 0) / values.length;
    return {
      missing: mean(umbra.map(({ missing }) => missing)),
      sky: mean(umbra.map(({ point }) => this.skyBehindBox(point))),
    };
  }

  /** Where the sun must stand for a shadow like this. */
  foundSun(): Angles {
    const points = this.floor(12).map(({ point, missing }) => ({ point, is: missing > 0.5 }));
    const wrong = (sun: Angles): number => {
      const direction = towards(sun);
      return points.reduce((n, { point, is }) => n + Number(this.hits(point, direction) !== is), 0);
    };
    const best = (around: readonly Angles[]): Angles =>
      around.map((sun) => [wrong(sun), sun] as const).reduce((a, b) => (b[0] < a[0] ? b : a))[1];
    const coarse = best(grid([0, 45], [180, 40], 5));
    return best(grid(coarse, [6, 6], 0.5));
  }

  /**
   * How wide the far edge of the shadow is between 10 and 90 % of its step, straight away from a lamp:
   * metres on the floor, pixels, and the metres that the lamp's size makes of it.
   */
  edge(lamp: Angles, radiusRad: number): { metres: number; pixels: number; penumbra: number } {
    const { foot, sizeM, view, width, height } = this.shown;
    const [x, , z] = towards(lamp);
    const flat = Math.hypot(x, z);
    const side = sizeM / 2 / Math.max(Math.abs(x / flat), Math.abs(z / flat));
    const tip = (up: number): number => side + sizeM / Math.tan(up);
    const up = lamp[1] / DEGREES;
    const [near, far] = [tip(up + radiusRad) - 0.04, tip(up - radiusRad) + 0.04];
    const at = (from: number): Vector3 => {
      return [foot[0]! - (x / flat) * from, 0, foot[2]! - (z / flat) * from];
    };
    const steps = Array.from({ length: 500 }, (_, i) => near + ((far - near) * i) / 500);
    const levels = steps.map((from) => this.missing(at(from)));
    const [most, least] = [levels[0]!, levels.at(-1)!];
    const below = (share: number): number =>
      steps[levels.findIndex((level) => level < least + share * (most - least))]!;
    const [from, to] = [below(0.9), below(0.1)];
    const [a, b] = [onScreen(view, at(from)), onScreen(view, at(to))];
    const pixels = Math.hypot((a[0] - b[0]) * width, (a[1] - b[1]) * height);
    return { metres: to - from, pixels, penumbra: far - near - 0.08 };
  }

  private missing(point: Vector3): number {
    const { view, width, height, plain } = this.shown;
    const [x, y] = onScreen(view, point);
    const [column, row] = [x * width - 0.5, y * height - 0.5];
    const [left, top] = [Math.floor(column), Math.floor(row)];
    let sum = 0;
    for (const [i, j] of [
      [0, 0],
      [0, 1],
      [1, 0],
      [1, 1],
    ] as const) {
      const weight = Math.abs(1 - j - (column - left)) * Math.abs(1 - i - (row - top));
      sum += weight * (this.green[(top + i) * width + left + j]! / plain) ** GAMMA;
    }
    return 1 - sum;
  }
}

/** Azimuths and elevations within `reach` of a middle, in even steps. */
function grid([azimuth, elevation]: Angles, reach: Angles, step: number): Angles[] {
  const along = (middle: number, far: number): number[] =>
    Array.from({ length: 2 * Math.floor(far / step) + 1 }, (_, i) => middle - far + i * step);
  return along(azimuth, reach[0]).flatMap((a) =>
    along(elevation, reach[1]).map((e): Angles => [a, e]),
  );
}

/** Shares of the width and height at which a point of the world is seen. */
function onScreen(view: Viewpoint, [x, y, z]: Vector3): readonly [number, number] {
  const [right, up, back] = turned(transposed(view.worldFromCamera), [x, y - view.heightM, z]);
  const tangent = Math.tan(view.verticalFovRad / 2);
  return [0.5 + right / -back / tangent / view.aspect / 2, 0.5 - up / -back / tangent / 2];
}

/** Directions that stand for all light that reaches the floor, drawn in proportion to what they give it. */
import {
  addLamps,
  type Environment,
  type Lamp,
  type Light,
  LUMINANCE,
  type Matrix3x3,
  resized,
  rowSolidAngles,
  subpixels,
  texelDirections,
  type Vector3,
} from "deeplight/core";

export interface FloorRays {
  /** x, y, z of each, y up; lower than this they would throw shadows without end. */
  readonly toLight: Float32Array;
  /** RGB share of the floor's irradiance that each stands for; they sum to 1. */
  readonly power: Float32Array;
}

/** Places in a light, in the order in which they lie next to each other. */
interface Places {
  readonly direction: Float64Array | Float32Array; // x, y, z of each
  readonly solidAngle: (place: number) => number;
  /** RGB of a place starts here. */
  readonly at: (place: number) => number;
  readonly radiance: Float32Array;
}

const LOWEST = 0.08;
const BALL_SIZE = 32;
/** Of the panorama that rays are drawn from; a texel is 1.4 degrees wide. */
const ROWS = 128;
/** A known lamp is drawn from by itself: a sun that lies across two texels would throw two shadows. */
const PLACES_OF_LAMP = 96;
const GOLDEN_ANGLE = Math.PI * (3 - Math.sqrt(5));

export function floorRays(light: Light, floorFromCamera: Matrix3x3, count: number): FloorRays {
  const places = light.panorama ? ofPanorama(light.panorama, light.lamps) : ofBall(light);
  const { direction, radiance } = places;
  const m = floorFromCamera;
  const given = new Float64Array(direction.length / 3); // luminous irradiance of each place
  const all = [0, 0, 0];
  for (let i = 0; i < given.length; i++) {
    const y =
      m[3] * direction[3 * i]! + m[4] * direction[3 * i + 1]! + m[5] * direction[3 * i + 2]!;
    if (y < LOWEST) continue;
    for (let c = 0; c < 3; c++) {
      const irradiance = radiance[places.at(i) + c]! * places.solidAngle(i) * y;
      given[i]! += LUMINANCE[c as 0 | 1 | 2] * irradiance;
      all[c]! += irradiance;
    }
  }
  return drawn(places, given, all, count, m);
}

function ofBall({ lighting }: Light): Places {
  const { direction, pixel, solidAngle } = subpixels(BALL_SIZE);
  return {
    direction,
    solidAngle: (place) => solidAngle[place]!,
    at: (place) => 3 * pixel[place]!,
    radiance: lighting.radiance(),
  };
}

/** Made once for a light: an object that is turned asks again and again. */
const kept = new WeakMap<Environment, Places>();

function ofPanorama(panorama: Environment, lamps: readonly Lamp[]): Places {
  let places = kept.get(panorama);
  if (!places) {
    places = placesOf(panorama, lamps);
    kept.set(panorama, places);
  }
  return places;
}

function placesOf({ radiance, height }: Environment, lamps: readonly Lamp[]): Places {
  const rows = Math.min(ROWS, height);
  const sr = rowSolidAngles(rows);
  const rest = radiance.slice();
  const taken = lamps.map((lamp) => ({ ...lamp, flux: scaled(lamp.flux, -1) }));
  addLamps(rest, taken, height);
  const texels = resized(rest, height, rows).map((value) => Math.max(value, 0));
  const discs = lamps.map(discOf);
  const ofLamps = discs.flatMap(({ solidAngle }) => Array(PLACES_OF_LAMP).fill(solidAngle));
  const count = texels.length / 3;
  return {
    direction: joined(texelDirections(rows), ...discs.map(({ direction }) => direction)),
    solidAngle: (place) =>
      place < count ? sr[Math.floor(place / (2 * rows))]! : ofLamps[place - count],
    at: (place) => 3 * place,
    radiance: joined(texels, ...discs.map(({ radiance }) => radiance)),
  };
}

/** Places spread evenly over a lamp, from its middle to its rim. */
function discOf({ direction, flux, angularRadiusRad }: Lamp) {
  const solidAngle = (4 * Math.PI * Math.sin(angularRadiusRad / 2) ** 2) / PLACES_OF_LAMP;
  const [across, along] = perpendicular(direction);
  const result = new Float32Array(3 * PLACES_OF_LAMP);
  for (let i = 0; i < PLACES_OF_LAMP; i++) {
    const half = Math.sin(angularRadiusRad / 2) * Math.sqrt((i + 0.5) / PLACES_OF_LAMP);
    const [off, turn] = [2 * Math.asin(half), i * GOLDEN_ANGLE];
    const [a, b] = [Math.cos(turn) * Math.sin(off), Math.sin(turn) * Math.sin(off)];
    for (const c of [0, 1, 2] as const) {
      result[3 * i + c] = Math.cos(off) * direction[c] + a * across[c] + b * along[c];
    }
  }
  const each = scaled(flux, 1 / (solidAngle * PLACES_OF_LAMP));
  const radiance = Float32Array.from(result, (_, i) => each[(i % 3) as 0 | 1 | 2]);
  return { direction: result, solidAngle, radiance };
}

/** Two unit vectors at right angles to one and to each other. */
function perpendicular([x, y, z]: Vector3): readonly [Vector3, Vector3] {
  const flat = Math.hypot(x, z);
  const across: Vector3 = flat > 1e-6 ? [-z / flat, 0, x / flat] : [1, 0, 0];
  const [a, , c] = across;
  return [across, [y * c, z * a - x * c, -y * a]];
}

function scaled([x, y, z]: Vector3, by: number): Vector3 {
  return [x * by, y * by, z * by];
}

function joined(...parts: readonly Float32Array[]): Float32Array {
  const whole = new Float32Array(parts.reduce((sum, { length }) => sum + length, 0));
  let from = 0;
  for (const part of parts) {
    whole.set(part, from);
    from += part.length;
  }
  return whole;
}

/** `count` places at even steps of the summed light, so strong light gets many. */
function drawn(
  { direction, at, radiance }: Places,
  given: Float64Array,
  all: readonly number[],
  count: number,
  m: Matrix3x3,
): FloorRays {
  const toLight = new Float32Array(3 * count);
  const power = new Float32Array(3 * count);
  const step = given.reduce((a, b) => a + b, 0) / count;
  let [place, passed] = [0, given[0]!];
  for (let ray = 0; ray < count; ray++) {
    while (passed < (ray + 0.5) * step && place < given.length - 1) passed += given[++place]!;
    const [x, y, z] = [0, 1, 2].map((k) => direction[3 * place + k]!) as [number, number, number];
    toLight[3 * ray] = m[0] * x + m[1] * y + m[2] * z;
    toLight[3 * ray + 1] = Math.max(m[3] * x + m[4] * y + m[5] * z, LOWEST);
    toLight[3 * ray + 2] = m[6] * x + m[7] * y + m[8] * z;
    const rgb = [0, 1, 2].map((c) => radiance[at(place) + c]!);
    const luminance = rgb.reduce((sum, value, c) => sum + value * LUMINANCE[c as 0 | 1 | 2], 0);
    for (let c = 0; c < 3; c++) {
      // Each stands for one step of luminous irradiance in its own colour.
      power[3 * ray + c] = (rgb[c]! / Math.max(luminance, 1e-9)) * (step / Math.max(all[c]!, 1e-9));
    }
  }
  return { toLight, power };
}

/** Directions that stand for all light that reaches the floor, drawn in proportion to what they give it. */
import {
  type Environment,
  type Light,
  LUMINANCE,
  type Matrix3x3,
  resized,
  rowSolidAngles,
  subpixels,
  texelDirections,
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
/** Of the panorama that rays are drawn from: a texel is 1.4 degrees wide, so a sun's shadow is crisp. */
const ROWS = 128;

export function floorRays(light: Light, floorFromCamera: Matrix3x3, count: number): FloorRays {
  const places = light.panorama ? ofPanorama(light.panorama) : ofBall(light);
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

function ofPanorama(panorama: Environment): Places {
  let places = kept.get(panorama);
  if (!places) {
    places = placesOf(panorama);
    kept.set(panorama, places);
  }
  return places;
}

function placesOf({ radiance, height }: Environment): Places {
  const rows = Math.min(ROWS, height);
  const sr = rowSolidAngles(rows);
  return {
    direction: texelDirections(rows),
    solidAngle: (place) => sr[Math.floor(place / (2 * rows))]!,
    at: (place) => 3 * place,
    radiance: resized(radiance, height, rows),
  };
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

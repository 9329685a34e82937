/** Directions that stand for all light that reaches the floor, drawn in proportion to what they give it. */
import { type Lighting, LUMINANCE, type Matrix3x3, subpixels } from "deeplight/core";

export interface FloorRays {
  /** x, y, z of each, y up; lower than this they would throw shadows without end. */
  readonly toLight: Float32Array;
  /** RGB share of the floor's irradiance that each stands for; they sum to 1. */
  readonly power: Float32Array;
}

const LOWEST = 0.08;
const BALL_SIZE = 32;

export function floorRays(
  lighting: Lighting,
  floorFromCamera: Matrix3x3,
  count: number,
): FloorRays {
  const { direction, pixel, solidAngle } = subpixels(BALL_SIZE);
  const radiance = lighting.radiance();
  const m = floorFromCamera;
  const given = new Float64Array(pixel.length); // luminous irradiance of each place on the ball
  const all = [0, 0, 0];
  for (let i = 0; i < pixel.length; i++) {
    const y =
      m[3] * direction[3 * i]! + m[4] * direction[3 * i + 1]! + m[5] * direction[3 * i + 2]!;
    if (y < LOWEST) continue;
    for (let c = 0; c < 3; c++) {
      const irradiance = radiance[3 * pixel[i]! + c]! * solidAngle[i]! * y;
      given[i]! += LUMINANCE[c as 0 | 1 | 2] * irradiance;
      all[c]! += irradiance;
    }
  }
  return drawn(given, all, count, radiance, m);
}

/** `count` places at even steps of the summed light, so strong light gets many. */
function drawn(
  given: Float64Array,
  all: readonly number[],
  count: number,
  radiance: Float32Array,
  m: Matrix3x3,
): FloorRays {
  const { direction, pixel } = subpixels(BALL_SIZE);
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
    const rgb = [0, 1, 2].map((c) => radiance[3 * pixel[place]! + c]!);
    const luminance = rgb.reduce((sum, value, c) => sum + value * LUMINANCE[c as 0 | 1 | 2], 0);
    for (let c = 0; c < 3; c++) {
      // Each stands for one step of luminous irradiance in its own colour.
      power[3 * ray + c] = (rgb[c]! / Math.max(luminance, 1e-9)) * (step / Math.max(all[c]!, 1e-9));
    }
  }
  return { toLight, power };
}

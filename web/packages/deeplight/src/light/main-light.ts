/** The one light that stands out of its surroundings, as harmonics.dominant_light finds it. */
import { LUMINANCE, MAIN_LIGHT_CONE_RAD } from "../contract/generated.ts";
import type { Environment } from "./environment.ts";
import { addLamps, irradianceOf, type Lamp, lobeOnBall, luminous } from "./lamp.ts";
import type { Vector3 } from "./matrix.ts";
import { pixelDirection, powerOfBall, solidAngles } from "./mirror-ball.ts";
import { ballFromPanorama } from "./panorama.ts";
import { remembered } from "./remembered.ts";

export interface MainLight {
  /** Unit vector towards the light, camera frame. */
  readonly direction: Vector3;
  /** RGB on a surface that faces it, in radiance relative to the camera's white times sr. */
  readonly irradiance: Vector3;
  /** Its irradiance with the largest channel at 1; white where there is no light. */
  readonly colour: Vector3;
  /** Part of the scene's power that it holds, 0 to 1, by luminance. */
  readonly share: number;
  /** Of the even disc that holds the same power as brightly. */
  readonly angularRadiusRad: number;
  /** Radiance of the ball without it. */
  readonly remainder: Float32Array;
}

export function findMainLight(radiance: Float32Array, size: number): MainLight {
  const whole = solidAngles(size);
  const inCone = brightestCone(radiance, size);
  const ambient = meanOutside(radiance, whole, inCone);
  const excess = new Float64Array(radiance.length);
  for (const pixel of inCone) {
    for (let i = 3 * pixel; i < 3 * pixel + 3; i++) {
      excess[i] = Math.max(radiance[i]! - ambient[(i % 3) as 0 | 1 | 2], 0);
    }
  }
  const power = Float64Array.from(whole, (sr, pixel) => sr * luminance(excess, pixel));
  const allPower = whole.reduce((sum, sr, pixel) => sum + sr * luminance(radiance, pixel), 0);
  const total = power.reduce((a, b) => a + b, 0);
  const direction = total > 0 ? meanDirection(power, size) : pixelDirection(0, size);
  const irradiance = facing(excess, whole, direction, size);
  const squared = power.reduce((sum, p, pixel) => sum + p * luminance(excess, pixel), 0);
  const disc = total > 0 ? total ** 2 / squared : 0;
  const largest = Math.max(...irradiance);
  return {
    direction,
    irradiance,
    colour: largest > 0 ? scaled(irradiance, 1 / largest) : [1, 1, 1],
    share: total / Math.max(allPower, 1e-30),
    angularRadiusRad: Math.acos(Math.min(Math.max(1 - disc / (2 * Math.PI), -1), 1)),
    remainder: radiance.map((value, i) => value - excess[i]!),
  };
}

/**
 * The first of a light's lamps, as environment.Environment.main_light has it.
 *
 * @param ball of the light, which holds the lamp: as a disc if it is made of a panorama, else as a lobe.
 */
export function mainLightOf(
  lamp: Lamp,
  ball: Float32Array,
  size: number,
  panorama: Environment | null,
): MainLight {
  const irradiance = irradianceOf(lamp);
  const whole = powerOfBall(ball, size);
  return {
    direction: lamp.direction,
    irradiance,
    colour: scaled(irradiance, 1 / Math.max(...irradiance)),
    share: luminous(lamp.flux) / luminous(whole),
    angularRadiusRad: lamp.angularRadiusRad,
    remainder: without(lamp, ball, size, panorama),
  };
}

/** What a disc that was drawn a little otherwise clips is made good: the lamp's flux is what goes. */
function without(lamp: Lamp, ball: Float32Array, size: number, panorama: Environment | null) {
  const drawn = panorama ? discOnBall(lamp, size, panorama.height) : lobeOnBall(lamp, size);
  const rest = ball.map((value, i) => Math.max(value - drawn[i]!, 0));
  const [whole, left] = [powerOfBall(ball, size), powerOfBall(rest, size)];
  return rest.map((value, i) => {
    const c = (i % 3) as 0 | 1 | 2;
    return (value * Math.max(whole[c] - lamp.flux[c], 0)) / Math.max(left[c], 1e-30);
  });
}

function discOnBall(lamp: Lamp, size: number, height: number): Float32Array {
  const disc = new Float32Array(6 * height ** 2);
  addLamps(disc, [lamp], height);
  return ballFromPanorama(disc, height, size);
}

/** Pixels of the cone that catches the most luminous power. */
function brightestCone(radiance: Float32Array, size: number): readonly number[] {
  const whole = solidAngles(size);
  const power = Float64Array.from(whole, (sr, pixel) => sr * luminance(radiance, pixel));
  let [best, most] = [0, -1];
  cones(size).forEach((near, pixel) => {
    const caught = near.reduce((sum, other) => sum + power[other]!, 0);
    if (caught > most) [best, most] = [pixel, caught];
  });
  return cones(size)[best]!;
}

function meanOutside(
  radiance: Float32Array,
  whole: Float64Array,
  inCone: readonly number[],
): Vector3 {
  const outside = whole.slice();
  for (const pixel of inCone) outside[pixel] = 0;
  const sum: [number, number, number] = [0, 0, 0];
  radiance.forEach((value, i) => {
    sum[(i % 3) as 0 | 1 | 2] += value * outside[Math.floor(i / 3)]!;
  });
  return scaled(sum, 1 / outside.reduce((a, b) => a + b, 0));
}

function meanDirection(power: Float64Array, size: number): Vector3 {
  const sum: [number, number, number] = [0, 0, 0];
  power.forEach((p, pixel) => {
    if (p === 0) return;
    const [x, y, z] = pixelDirection(pixel, size);
    sum[0] += p * x;
    sum[1] += p * y;
    sum[2] += p * z;
  });
  return scaled(sum, 1 / Math.hypot(...sum));
}

/** Irradiance of `excess` on a surface that faces `direction`. */
function facing(
  excess: Float64Array,
  whole: Float64Array,
  [x, y, z]: Vector3,
  size: number,
): Vector3 {
  const sum: [number, number, number] = [0, 0, 0];
  excess.forEach((value, i) => {
    if (value === 0) return;
    const pixel = Math.floor(i / 3);
    const [dx, dy, dz] = pixelDirection(pixel, size);
    sum[(i % 3) as 0 | 1 | 2] += value * whole[pixel]! * Math.max(x * dx + y * dy + z * dz, 0);
  });
  return sum;
}

/** For each pixel those within the cone around it. */
const cones = remembered((size: number): readonly (readonly number[])[] => {
  const directions = Array.from({ length: size * size }, (_, pixel) => pixelDirection(pixel, size));
  const nearest = Math.cos(MAIN_LIGHT_CONE_RAD);
  return directions.map(([x, y, z]) =>
    directions.flatMap(([a, b, c], pixel) => (x * a + y * b + z * c > nearest ? [pixel] : [])),
  );
});

export function luminance(values: Float32Array | Float64Array, pixel: number): number {
  const [r, g, b] = LUMINANCE;
  return r * values[3 * pixel]! + g * values[3 * pixel + 1]! + b * values[3 * pixel + 2]!;
}

function scaled([x, y, z]: Vector3, by: number): Vector3 {
  return [x * by, y * by, z * by];
}

/** The arithmetic of transfer outside the graphics card: what a light does to tables and matrices. */
import { basis, cosineKernel } from "deeplight/core";
import type { GlossyTransfer, GroundTransfer, Transfer } from "./format.ts";

/** Irradiance over pi on an open plane facing +Y in light of each harmonic. */
export function openPlane(order: number): Float32Array {
  return Float32Array.from(basis([0, 1, 0], order), (value, i) => {
    return (value * cosineKernel(Math.floor(Math.sqrt(i)))) / Math.PI;
  });
}

/** Light cut, or filled up with 0, to `coefficients` x RGB. */
export function fitting(harmonics: Float32Array, coefficients: number): Float32Array {
  const light = new Float32Array(3 * coefficients);
  light.set(harmonics.subarray(0, light.length));
  return light;
}

/** What leaves one row of a table in `light`, not below 0. */
export function sentBy(
  table: Float32Array,
  row: number,
  light: Float32Array,
): [number, number, number] {
  const coefficients = light.length / 3;
  const sum: [number, number, number] = [0, 0, 0];
  for (let i = 0; i < coefficients; i++) {
    const share = table[row * coefficients + i]!;
    for (const channel of [0, 1, 2] as const) sum[channel] += share * light[3 * i + channel]!;
  }
  return [Math.max(sum[0], 0), Math.max(sum[1], 0), Math.max(sum[2], 0)];
}

/** RGB that leaves each vertex per unit of reflectivity in a light of any order. */
export function sentByAll({ diffuse, order }: Transfer, harmonics: Float32Array): Float32Array {
  const coefficients = (order + 1) ** 2;
  const light = fitting(harmonics, coefficients);
  const sent = new Float32Array((3 * diffuse.length) / coefficients);
  for (let vertex = 0; vertex < sent.length / 3; vertex++) {
    sent.set(sentBy(diffuse, vertex, light), 3 * vertex);
  }
  return sent;
}

/** Light at each ground point with the object there over that without; RGB of each point. */
export function shadowRatios(
  ground: GroundTransfer,
  order: number,
  harmonics: Float32Array,
): Float32Array {
  const light = fitting(harmonics, (order + 1) ** 2);
  const whole = sentBy(openPlane(order), 0, light);
  const ratios = new Float32Array(3 * ground.size ** 2);
  for (let point = 0; point < ground.size ** 2; point++) {
    const lit = sentBy(ground.transfer, point, light);
    ratios.set(
      lit.map((value, channel) => (whole[channel]! > 0 ? value / whole[channel]! : 1)),
      3 * point,
    );
  }
  return ratios;
}

/** Every matrix of the glossy finish applied to a light: cluster, part, leaving, RGBA (A is 0). */
export function meet(glossy: GlossyTransfer, light: Float32Array, into: Float32Array): void {
  const coefficients = light.length / 3;
  for (let row = 0; row < into.length / 4; row++) {
    let [red, green, blue] = [0, 0, 0];
    for (let i = 0; i < coefficients; i++) {
      const share = glossy.matrices[row * coefficients + i]!;
      red += share * light[3 * i]!;
      green += share * light[3 * i + 1]!;
      blue += share * light[3 * i + 2]!;
    }
    into[4 * row] = red;
    into[4 * row + 1] = green;
    into[4 * row + 2] = blue;
  }
}

/** Numbers that `meet` fills. */
export function metLength(transfer: Transfer): number {
  const { glossy, order } = transfer;
  return glossy ? 4 * glossy.clusters * (glossy.components + 1) * (order + 1) ** 2 : 0;
}

/**
 * Real spherical harmonics of radiance, as in harmonics.py: harmonic l, m stands at l (l + 1) + m,
 * all signs positive (three.js, Ramamoorthi and Hanrahan 2001).
 */
import type { Vector3 } from "./matrix.ts";
import { directionAt, subpixels } from "./mirror-ball.ts";
import { remembered } from "./remembered.ts";

/** The (order + 1)^2 harmonics in a unit direction. */
export function basis([x, y, z]: Vector3, order: number): Float64Array {
  const result = new Float64Array((order + 1) ** 2);
  let [cosine, sine, odd] = [1, 0, 1]; // of m phi, times sin(theta)^m; 1 x 3 x 5 ... (2 m - 1)
  for (let m = 0; m <= order; m++) {
    let [below, here] = [0, odd]; // Legendre functions divided by sin^m
    for (let degree = m; degree <= order; degree++) {
      const scaled = here * norm(degree, m);
      result[degree * (degree + 1) + m] = scaled * cosine;
      if (m > 0) result[degree * (degree + 1) - m] = scaled * sine;
      const above = ((2 * degree + 1) * z * here - (degree + m) * below) / (degree + 1 - m);
      [below, here] = [here, above];
    }
    [cosine, sine] = [cosine * x - sine * y, cosine * y + sine * x];
    odd *= 2 * m + 1;
  }
  return result;
}

/** Coefficients of a ball's radiance, RGB interleaved: its integral against each harmonic. */
export function project(radiance: Float32Array, size: number, order: number): Float32Array {
  const weights = projection(size, order);
  const count = (order + 1) ** 2;
  const sums = new Float64Array(3 * count);
  for (let pixel = 0; pixel < size * size; pixel++) {
    for (let i = 0; i < count; i++) {
      const weight = weights[pixel * count + i]!;
      for (let c = 0; c < 3; c++) sums[3 * i + c]! += weight * radiance[3 * pixel + c]!;
    }
  }
  return Float32Array.from(sums);
}

/** What a clamped cosine multiplies the coefficients of a degree by: pi, 2 pi / 3, pi / 4, 0 ... */
export function cosineKernel(degree: number): number {
  if (degree === 0) return Math.PI;
  if (degree === 1) return (2 * Math.PI) / 3;
  if (degree % 2 === 1) return 0;
  const half = degree / 2;
  const ratio = factorial(degree) / (2 ** degree * factorial(half) ** 2);
  return ((half % 2 === 0 ? -1 : 1) * 2 * Math.PI * ratio) / ((degree + 2) * (degree - 1));
}

/** Coefficients of irradiance from those of radiance. */
export function irradianceCoefficients(radiance: Float32Array): Float32Array {
  return radiance.map((value, i) => value * cosineKernel(Math.floor(Math.sqrt(Math.floor(i / 3)))));
}

/** Irradiance on a surface that faces `normal`; white light of 1 gives pi. */
export function irradiance(radiance: Float32Array, normal: Vector3): Vector3 {
  const coefficients = irradianceCoefficients(radiance);
  const harmonics = basis(normal, Math.sqrt(radiance.length / 3) - 1);
  const sum: [number, number, number] = [0, 0, 0];
  coefficients.forEach((value, i) => {
    sum[(i % 3) as 0 | 1 | 2] += value * harmonics[Math.floor(i / 3)]!;
  });
  return sum;
}

/** Integral of each harmonic over each pixel of the ball. */
const projection = remembered((size: number, order: number): Float64Array => {
  const count = (order + 1) ** 2;
  const weights = new Float64Array(size * size * count);
  const places = subpixels(size);
  places.pixel.forEach((pixel, i) => {
    basis(directionAt(places, i), order).forEach((value, k) => {
      weights[pixel * count + k]! += value * places.solidAngle[i]!;
    });
  });
  return weights;
});

/** What brings a harmonic of this degree and m, or -m, to unit power. */
export const norm = remembered((degree: number, m: number): number => {
  const ratio = factorial(degree - m) / factorial(degree + m);
  return Math.sqrt(((2 * degree + 1) / (4 * Math.PI)) * ratio * (m > 0 ? 2 : 1));
});

function factorial(n: number): number {
  return n < 2 ? 1 : n * factorial(n - 1);
}

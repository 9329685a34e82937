/**
 * The rig's three spheres in any light: mirror, matte silver, diffuse, where the paper's rig holds
 * them (reflectance.analytic_basis). The solid angle of each pixel of light is inside its weight.
 */
import {
  CROP_SIZE,
  LIGHTING_SIZE,
  MATTE_SILVER_ROUGHNESS,
  PAPER_RIG,
  REFLECTIVITY,
} from "../contract/generated.ts";
import { dot, type Matrix3x3, normalised, transposed, turned, type Vector3 } from "./matrix.ts";
import { coverage, pixelOfDirection, type Subpixels, subpixels } from "./mirror-ball.ts";

export type SphereName = keyof typeof REFLECTIVITY;
export const SPHERES = Object.keys(REFLECTIVITY) as SphereName[];

/** Side of a sphere's crop in pixels. */
export const SPHERE_SIZE: number = CROP_SIZE;

/** The weights of each pixel of the crop, those that are zero left out. */
export interface Basis {
  readonly start: Uint32Array; // of each pixel's weights; one more at the end
  readonly light: Uint32Array; // pixel of light, times 3
  readonly weight: Float32Array;
}

const bases = new Map<string, Basis>(); // by name and size of the light

/** Linear radiance of a sphere, RGB; zero off the sphere (equation 1). */
export function relit(name: SphereName, radiance: Float32Array): Float32Array {
  const { start, light, weight } = basisOf(name, Math.sqrt(radiance.length / 3));
  const result = new Float32Array(3 * SPHERE_SIZE ** 2);
  for (let pixel = 0; pixel < SPHERE_SIZE ** 2; pixel++) {
    let red = 0;
    let green = 0;
    let blue = 0;
    for (let i = start[pixel]!; i < start[pixel + 1]!; i++) {
      const at = light[i]!;
      red += weight[i]! * radiance[at]!;
      green += weight[i]! * radiance[at + 1]!;
      blue += weight[i]! * radiance[at + 2]!;
    }
    result[3 * pixel] = red;
    result[3 * pixel + 1] = green;
    result[3 * pixel + 2] = blue;
  }
  return result;
}

/** A sphere's basis; made when first asked for, which takes a while: see `keepBasis`. */
function basisOf(name: SphereName, lightSize: number): Basis {
  const key = `${name} ${lightSize}`;
  let basis = bases.get(key);
  if (basis === undefined) {
    basis = makeBasis(name, lightSize);
    bases.set(key, basis);
  }
  return basis;
}

/** Takes a basis that was made elsewhere, such as in a worker, so that `relit` never has to. */
export function keepBasis(name: SphereName, lightSize: number, basis: Basis): void {
  bases.set(`${name} ${lightSize}`, basis);
}

export function makeBasis(name: SphereName, lightSize: number): Basis {
  const weights = { mirror, matte_silver: matteSilver, diffuse }[name](lightSize);
  const lights = lightSize ** 2;
  const reflectivity = REFLECTIVITY[name];
  for (let pixel = 0; pixel < SPHERE_SIZE ** 2; pixel++) {
    const row = weights.subarray(pixel * lights, (pixel + 1) * lights);
    // A perfect diffuser's weights need no scale; the others are brought to what was measured.
    const sum = name === "diffuse" ? 1 : Math.max(total(row), 1e-9);
    for (let light = 0; light < lights; light++) row[light]! *= reflectivity / sum;
  }
  return withoutZeros(weights, lights);
}

function withoutZeros(weights: Float32Array, lights: number): Basis {
  const count = weights.reduce((sum, weight) => sum + (weight > 0 ? 1 : 0), 0);
  const basis = {
    start: new Uint32Array(SPHERE_SIZE ** 2 + 1),
    light: new Uint32Array(count),
    weight: new Float32Array(count),
  };
  let to = 0;
  weights.forEach((weight, i) => {
    if (weight > 0) {
      basis.light[to] = 3 * (i % lights);
      basis.weight[to++] = weight;
    }
    if (i % lights === lights - 1) basis.start[(i + 1) / lights] = to;
  });
  return basis;
}

function total(values: Float32Array): number {
  return values.reduce((a, b) => a + b, 0);
}

/** Counts which pixel of light each of 8 x 8 places in a pixel shows. */
function mirror(lightSize: number): Float32Array {
  const weights = new Float32Array((lightSize * SPHERE_SIZE) ** 2);
  eachPlace(8, (pixel, u, v) => {
    if (Math.hypot(u, v) > 1) return;
    const { normal, view } = surface("mirror", u, v);
    const along = 2 * dot(normal, view);
    const shown: Vector3 = [
      along * normal[0] - view[0],
      along * normal[1] - view[1],
      along * normal[2] - view[2],
    ];
    weights[pixel * lightSize ** 2 + pixelOfDirection(shown, lightSize)]! += 1;
  });
  return weights;
}

/** Lambert's cosine at 2 x 2 places in each pixel. */
function diffuse(lightSize: number): Float32Array {
  const weights = new Float32Array((lightSize * SPHERE_SIZE) ** 2);
  const { pixel: light, direction, solidAngle } = lightPlaces(lightSize);
  eachPlace(2, (pixel, u, v) => {
    const [x, y, z] = surface("diffuse", u, v).normal;
    const row = weights.subarray(pixel * lightSize ** 2, (pixel + 1) * lightSize ** 2);
    for (let i = 0; i < light.length; i++) {
      const cosine = x * direction[3 * i]! + y * direction[3 * i + 1]! + z * direction[3 * i + 2]!;
      if (cosine > 0) row[light[i]!]! += (cosine * solidAngle[i]!) / (4 * Math.PI);
    }
  });
  return weights;
}

/** GGX microfacets at the middle of each pixel (brdf.rough_specular). */
function matteSilver(lightSize: number): Float32Array {
  const weights = new Float32Array((lightSize * SPHERE_SIZE) ** 2);
  const { pixel: light, direction, solidAngle } = lightPlaces(lightSize);
  const a2 = MATTE_SILVER_ROUGHNESS ** 2;
  eachPlace(1, (pixel, u, v) => {
    const { normal, view } = surface("matte_silver", u, v);
    const nv = dot(normal, view);
    const seen = smith(nv, a2) / (4 * Math.max(nv, 1e-4));
    const row = weights.subarray(pixel * lightSize ** 2, (pixel + 1) * lightSize ** 2);
    for (let i = 0; i < light.length; i++) {
      const [x, y, z] = [direction[3 * i]!, direction[3 * i + 1]!, direction[3 * i + 2]!];
      const nl = normal[0] * x + normal[1] * y + normal[2] * z;
      if (nl <= 0 || nv <= -1e-6) continue;
      const lv = view[0] * x + view[1] * y + view[2] * z;
      const nhSquared = (nl + nv) ** 2 / Math.max(2 + 2 * lv, 1e-9);
      const density = a2 / (Math.PI * (nhSquared * (a2 - 1) + 1) ** 2);
      row[light[i]!]! += density * smith(nl, a2) * seen * solidAngle[i]!;
    }
  });
  return weights;
}

/** As finely spread over small balls as the paper's 4 x 4 over each pixel of 32. */
function lightPlaces(lightSize: number): Subpixels {
  return subpixels(lightSize, Math.max(1, Math.ceil((4 * LIGHTING_SIZE) / lightSize)));
}

/** Share of microfacets that a direction sees. */
function smith(cosine: number, a2: number): number {
  const clipped = Math.min(Math.max(cosine, 1e-4), 1);
  return 2 / (1 + Math.sqrt(1 + a2 * (1 / (clipped * clipped) - 1)));
}

/** Walks `along`^2 places in each pixel that shows the sphere. */
function eachPlace(along: number, use: (pixel: number, u: number, v: number) => void): void {
  const n = SPHERE_SIZE * along;
  for (let row = 0; row < n; row++) {
    for (let column = 0; column < n; column++) {
      const pixel = Math.floor(row / along) * SPHERE_SIZE + Math.floor(column / along);
      if (coverage(SPHERE_SIZE)[pixel]! > 0)
        use(pixel, (2 * (column + 0.5)) / n - 1, 1 - (2 * (row + 0.5)) / n);
    }
  }
}

/** Surface normal, and direction back to the camera, at a position in the crop; camera frame. */
function surface(name: SphereName, u: number, v: number): { normal: Vector3; view: Vector3 } {
  const radius = Math.max(Math.hypot(u, v), 1);
  const { ballFromCamera, angularRadiusRad } = PAPER_RIG[name];
  const cameraFromBall = transposed(ballFromCamera as Matrix3x3);
  const tangent = Math.tan(angularRadiusRad);
  const ray = normalised([(u / radius) * tangent, (v / radius) * tangent, -1]);
  const distance = 1 / Math.sin(angularRadiusRad); // to the centre of a sphere of radius 1
  const along = -ray[2] * distance;
  const depth = along - Math.sqrt(Math.max(along ** 2 - (distance ** 2 - 1), 0));
  const normal = normalised([ray[0] * depth, ray[1] * depth, ray[2] * depth + distance]);
  const back: Vector3 = [-ray[0], -ray[1], -ray[2]];
  return { normal: turned(cameraFromBall, normal), view: turned(cameraFromBall, back) };
}

/** Compact lights: a lamp or the sun as a disc with a direction, a size, a power and a colour. lamp.py. */
import { LUMINANCE } from "../contract/generated.ts";
import { normalised, type Vector3 } from "./matrix.ts";
import { solidAngles, subpixels } from "./mirror-ball.ts";
import { rowSolidAngles, texelOf } from "./panorama.ts";
import { remembered } from "./remembered.ts";

/** An even disc far away. */
export interface Lamp {
  /** Unit vector towards it, camera frame. */
  readonly direction: Vector3;
  /** RGB radiance integrated over the disc: radiance unit times sr. */
  readonly flux: Vector3;
  readonly angularRadiusRad: number;
}

export function luminous([red, green, blue]: Vector3): number {
  return LUMINANCE[0] * red + LUMINANCE[1] * green + LUMINANCE[2] * blue;
}

/** On a surface that faces it: pi sin^2(r) of its radiance, its flux over 4 pi sin^2(r / 2). */
export function irradianceOf({ flux, angularRadiusRad }: Lamp): Vector3 {
  const share = Math.cos(angularRadiusRad / 2) ** 2;
  return [flux[0] * share, flux[1] * share, flux[2] * share];
}

/** A network's output of (1, lamps, 7): direction, ln flux, angular radius. */
interface LampNumbers {
  readonly shape: readonly number[];
  readonly data: ArrayLike<number>;
}

/** Of each lamp in a network's output. */
export const NUMBERS = 7;

/** From the network's output. @throws RangeError where it is none. */
export function lampsOf({ shape, data }: LampNumbers): readonly Lamp[] {
  if (shape.length !== 3 || shape[2] !== NUMBERS) {
    throw new RangeError(`expected lamps of ${NUMBERS} numbers, got the shape ${shape}`);
  }
  return Array.from({ length: shape[1]! }, (_, i) => {
    const at = (k: number): number => data[NUMBERS * i + k]!;
    return {
      direction: normalised([at(0), at(1), at(2)]),
      flux: [Math.exp(at(3)), Math.exp(at(4)), Math.exp(at(5))],
      angularRadiusRad: at(6),
    };
  });
}

/** Texels that a lamp's disc touches, and how much of each it covers. */
export interface Cover {
  readonly texel: readonly number[];
  readonly share: readonly number[];
}

const SAMPLES = 8; // along each side of a texel that a disc's edge crosses

/** Adds lamps to a panorama: each texel gets the part of a disc that it covers; the flux is exact. */
export function addLamps(radiance: Float32Array, lamps: readonly Lamp[], height: number): void {
  const sr = rowSolidAngles(height);
  for (const lamp of lamps) {
    const { texel, share } = coverOf(lamp, height);
    const area = texel.reduce((sum, at, i) => {
      return sum + share[i]! * sr[Math.floor(at / (2 * height))]!;
    }, 0);
    texel.forEach((at, i) => {
      for (const c of [0, 1, 2] as const) {
        radiance[3 * at + c]! += (share[i]! * lamp.flux[c]) / area;
      }
    });
  }
}

/** A disc smaller than a texel becomes that texel. */
export function coverOf({ direction, angularRadiusRad }: Lamp, height: number): Cover {
  const [x, y, z] = direction;
  const step = Math.PI / height;
  const [reach, edge] = [
    Math.cos(Math.min(angularRadiusRad + 1.5 * step, Math.PI)),
    Math.cos(angularRadiusRad),
  ];
  const cover: { texel: number[]; share: number[] } = { texel: [], share: [] };
  for (let row = 0; row < height; row++) {
    const theta = (row + 0.5) * step;
    // Of the row the best place lies right above or below the lamp: most rows end here.
    if (Math.sin(theta) * Math.hypot(x, z) + Math.cos(theta) * y <= reach) continue;
    for (let column = 0; column < 2 * height; column++) {
      const phi = (column + 0.5) * step - Math.PI;
      const cosine =
        Math.sin(theta) * (x * Math.sin(phi) - z * Math.cos(phi)) + Math.cos(theta) * y;
      if (cosine <= reach) continue;
      const share = covered(direction, edge, row, column, step);
      if (share === 0) continue;
      cover.texel.push(row * 2 * height + column);
      cover.share.push(share);
    }
  }
  return cover.texel.length ? cover : { texel: [texelOf(x, y, z, height)], share: [1] };
}

function covered([x, y, z]: Vector3, edge: number, row: number, column: number, step: number) {
  let count = 0;
  for (let i = 0; i < SAMPLES * SAMPLES; i++) {
    const theta = (row + (Math.floor(i / SAMPLES) + 0.5) / SAMPLES) * step;
    const phi = (column + ((i % SAMPLES) + 0.5) / SAMPLES) * step - Math.PI;
    const cosine = Math.sin(theta) * (x * Math.sin(phi) - z * Math.cos(phi)) + Math.cos(theta) * y;
    if (cosine > edge) count++;
  }
  return count / SAMPLES ** 2;
}

/** Radiance of a lamp on a mirror ball as the network draws it: a smooth lobe. lobe.py. */
export function lobeOnBall(
  { direction, flux, angularRadiusRad }: Lamp,
  size: number,
): Float32Array {
  const towards = meanDirections(size);
  const sr = solidAngles(size);
  const concentration = 1 / Math.sin(angularRadiusRad / 2) ** 2;
  const exponent = Float64Array.from(sr, (_, i) => {
    const [x, y, z] = [towards[3 * i]!, towards[3 * i + 1]!, towards[3 * i + 2]!];
    return concentration * (x * direction[0] + y * direction[1] + z * direction[2]);
  });
  const most = exponent.reduce((a, b) => Math.max(a, b), Number.NEGATIVE_INFINITY);
  const lobe = exponent.map((value) => Math.exp(value - most));
  const whole = lobe.reduce((sum, value, i) => sum + value * sr[i]!, 0);
  return Float32Array.from({ length: 3 * lobe.length }, (_, i) => {
    return (lobe[Math.floor(i / 3)]! / whole) * flux[(i % 3) as 0 | 1 | 2];
  });
}

/** Mean direction of each pixel of a ball; shorter than 1 where it spans many, 0 off the ball. */
const meanDirections = remembered((size: number): Float64Array => {
  const { pixel, direction } = subpixels(size);
  const sums = new Float64Array(3 * size * size);
  const count = new Float64Array(size * size);
  pixel.forEach((own, i) => {
    count[own]!++;
    for (let c = 0; c < 3; c++) sums[3 * own + c]! += direction[3 * i + c]!;
  });
  return sums.map((sum, i) => sum / Math.max(count[Math.floor(i / 3)]!, 1));
});

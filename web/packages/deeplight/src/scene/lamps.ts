/**
 * The compact lights of an estimate: those the network means, and those the photo shows clipped.
 * lamps.py says why they are placed so.
 */
import { PHOTO_LIGHT } from "../contract/generated.ts";
import { type Lamp, lobeOnBall, luminous } from "../light/lamp.ts";
import { findMainLight } from "../light/main-light.ts";
import { dot, normalised, type Vector3 } from "../light/matrix.ts";
import { pixelDirection, powerOfBall, solidAngles } from "../light/mirror-ball.ts";
import { shrunk, texelDirections, texelOf } from "../light/panorama.ts";
import { addRaised, type ClippedArea, clippedAreas, lampOf } from "./clipped-areas.ts";
import { type ProjectedPhoto, smoothstep } from "./image-plane.ts";

const { CATCH_RAD, CONE_EDGE_RAD, CONE_RAD, LAMP_RADIUS_RAD, LARGEST_OWN_RAD } = PHOTO_LIGHT;
const { LEAST_LEFT, LEAST_SHARE, LOBE_END, MOST_LAMPS, OWN_COLOUR, OWN_RADIUS_RAD } = PHOTO_LIGHT;
const { TOGETHER_RAD, UNSEEN } = PHOTO_LIGHT;
const SEEN_ROWS = 64;

/** Where an estimate's excess went; lamps, areas and rest together hold the estimate's power. */
export interface FoundLamps {
  /** The strongest first. */
  readonly lamps: readonly Lamp[];
  /** Radiance of clipped areas beyond the map, that are no lamps: a panorama. */
  readonly areas: Float32Array;
  /** The estimate without these, on the ball. */
  readonly rest: Float32Array;
}

/** Light that stands out of an estimate, pixel by pixel of the ball. */
interface Excess {
  readonly pixels: readonly number[];
  readonly directions: readonly Vector3[];
  /** Of each, radiance times sr. */
  readonly flux: readonly Vector3[];
  /** Of the lamp that it becomes where nothing shows a size. */
  readonly radiusRad: number;
}

/**
 * Places what stands out of an estimate: on what the photo shows clipped near it, and elsewhere.
 *
 * @param ball the estimate's radiance.
 * @param own the network's lamps, which the estimate holds.
 */
export function findLamps(
  ball: Float32Array,
  size: number,
  photo: ProjectedPhoto,
  own: readonly Lamp[],
): FoundLamps {
  const rest = ball.slice();
  const parts = partsOf(rest, size, own);
  const least = LEAST_SHARE * luminous(powerOfBall(ball, size));
  const shown = clippedAreas(photo);
  const fluxes = shown.map((): [number, number, number] => [0, 0, 0]);
  const apart: Lamp[] = [];
  const seen = shrunk(photo.seen, photo.height, SEEN_ROWS, 1);
  for (const part of parts) {
    const nearest = nearestAreas(part, shown, photo.height);
    part.flux.forEach((flux, i) => {
      const area = fluxes[nearest[i]!];
      if (area) for (const c of [0, 1, 2] as const) area[c] += flux[c];
    });
    const free = part.flux.map((flux, i): Vector3 => (nearest[i]! < 0 ? flux : [0, 0, 0]));
    const sum = summed(free);
    if (luminous(sum) > least) {
      const direction = unseenDirection(part, free, seen);
      apart.push({ direction, flux: sum, angularRadiusRad: part.radiusRad });
    } else putBack(rest, size, part, free);
  }
  const lamps = together(apart, seen);
  const areas = new Float32Array(photo.radiance.length);
  const order = [...shown.keys()].sort((a, b) => luminous(fluxes[b]!) - luminous(fluxes[a]!));
  for (const k of order) {
    const strong = luminous(fluxes[k]!) > least && lamps.length < MOST_LAMPS;
    const lamp = strong ? lampOf(shown[k]!, fluxes[k]!, photo.height) : null;
    if (lamp) lamps.push(lamp);
    else addRaised(areas, shown[k]!, fluxes[k]!, photo);
  }
  lamps.sort((a, b) => luminous(b.flux) - luminous(a.flux));
  return { lamps, areas, rest };
}

/** Lamps near each other as one in their middle, the nearest two first; none in the photo. */
function together(lamps: Lamp[], seen: Float32Array): Lamp[] {
  const pairs = lamps.flatMap((one, i) => lamps.slice(i + 1).map((other) => [one, other] as const));
  const cosine = ([one, other]: readonly [Lamp, Lamp]) => dot(one.direction, other.direction);
  pairs.sort((a, b) => cosine(b) - cosine(a));
  for (const [one, other] of pairs) {
    if (cosine([one, other]) < Math.cos(TOGETHER_RAD)) break;
    const [a, b] = [luminous(one.flux), luminous(other.flux)];
    const middle = normalised(
      one.direction.map((value, c) => a * value + b * other.direction[c]!) as unknown as Vector3,
    );
    if (seen[texelOf(...middle, SEEN_ROWS)]! >= UNSEEN) continue;
    const angularRadiusRad = Math.max(one.angularRadiusRad, other.angularRadiusRad);
    const both = { direction: middle, flux: summed([one.flux, other.flux]), angularRadiusRad };
    return together([...lamps.filter((lamp) => lamp !== one && lamp !== other), both], seen);
  }
  return lamps;
}

/** What stands out, one after the other; each is taken out of `rest`. */
function partsOf(rest: Float32Array, size: number, own: readonly Lamp[]): Excess[] {
  if (own.length === 0) return [takenOut(rest, size, mainExcess(rest, size), LAMP_RADIUS_RAD)];
  const compact = own.filter(({ angularRadiusRad }) => angularRadiusRad <= LARGEST_OWN_RAD);
  const power = powerOfBall(rest, size);
  const parts = compact.slice(0, MOST_LAMPS).map((lamp) => {
    const lobe = lobeOnBall(lamp, size).map((value, i) => Math.min(value, rest[i]!));
    const end = LOBE_END * lobe.reduce((a, b) => Math.max(a, b), 0);
    for (let i = 0; i < lobe.length; i += 3) {
      if (Math.max(lobe[i]!, lobe[i + 1]!, lobe[i + 2]!) < end) lobe.fill(0, i, i + 3);
    }
    return takenOut(rest, size, lobe, Math.min(lamp.angularRadiusRad, OWN_RADIUS_RAD));
  });
  return recoloured(parts, rest, power);
}

/** Lamps of one colour, near the whole estimate's; what a channel loses the rest gains. */
function recoloured(parts: Excess[], rest: Float32Array, power: Vector3): Excess[] {
  const flux = summed(parts.map((part) => summed(part.flux)));
  const light = luminous(flux);
  const left = power.map((value, c) => value - flux[c]!);
  if (light <= 0 || left.some((value, c) => value < LEAST_LEFT * power[c]!)) return parts;
  const whole = luminous(power);
  const colour = power.map((value, c) => {
    return (OWN_COLOUR * flux[c]!) / light + ((1 - OWN_COLOUR) * value) / whole;
  }) as unknown as Vector3;
  const factor = power.map((value, c) => (value - light * colour[c]!) / left[c]!);
  for (let i = 0; i < rest.length; i++) rest[i]! *= factor[i % 3]!;
  return parts.map((part) => ({
    ...part,
    flux: part.flux.map((own) => colour.map((c) => c * luminous(own)) as unknown as Vector3),
  }));
}

/** What exceeds an estimate's own median around its main direction: for networks without lamps. */
function mainExcess(ball: Float32Array, size: number): Float32Array {
  const [x, y, z] = findMainLight(ball, size).direction;
  const lit = solidAngles(size);
  const away = Array.from({ length: size * size }, (_, i) => {
    const [a, b, c] = pixelDirection(i, size);
    return Math.acos(Math.min(Math.max(a * x + b * y + c * z, -1), 1));
  });
  const isNear = away.map((angle, i) => angle < CONE_RAD && lit[i]! > 0);
  const medians = [0, 1, 2].map((c) => {
    const near = ball.filter((_, i) => i % 3 === c && isNear[Math.floor(i / 3)]).sort();
    return (near[(near.length - 1) >> 1]! + near[near.length >> 1]!) / 2;
  });
  return ball.map((value, i) => {
    const pixel = Math.floor(i / 3);
    if (!isNear[pixel]) return 0;
    return (
      Math.max(value - medians[i % 3]!, 0) * smoothstep((CONE_RAD - away[pixel]!) / CONE_EDGE_RAD)
    );
  });
}

function takenOut(
  rest: Float32Array,
  size: number,
  radiance: Float32Array,
  radiusRad: number,
): Excess {
  const sr = solidAngles(size);
  const pixels: number[] = [];
  for (let i = 0; i < size * size; i++) {
    if (Math.max(radiance[3 * i]!, radiance[3 * i + 1]!, radiance[3 * i + 2]!) > 0) pixels.push(i);
  }
  for (let i = 0; i < rest.length; i++) rest[i]! -= radiance[i]!;
  return {
    pixels,
    directions: pixels.map((i) => pixelDirection(i, size)),
    flux: pixels.map((i): Vector3 => {
      return [0, 1, 2].map((c) => radiance[3 * i + c]! * sr[i]!) as unknown as Vector3;
    }),
    radiusRad,
  };
}

function putBack(
  rest: Float32Array,
  size: number,
  { pixels }: Excess,
  flux: readonly Vector3[],
): void {
  const sr = solidAngles(size);
  pixels.forEach((pixel, i) => {
    if (sr[pixel] === 0) return;
    for (const c of [0, 1, 2] as const) rest[3 * pixel + c]! += flux[i]![c] / sr[pixel]!;
  });
}

/** Which area each pixel of the excess is nearest to; -1 where none is near. */
function nearestAreas(excess: Excess, areas: readonly ClippedArea[], height: number): number[] {
  const directions = texelDirections(height);
  const shapes = areas.map(({ texels }) => {
    const step = Math.max(1, Math.floor(texels.length / 64)); // a few dozen show it well enough
    return texels.filter((_, i) => i % step === 0);
  });
  return excess.directions.map(([x, y, z]) => {
    let [nearest, best] = [-1, Math.cos(CATCH_RAD)];
    shapes.forEach((texels, number) => {
      for (const t of texels) {
        const cosine =
          x * directions[3 * t]! + y * directions[3 * t + 1]! + z * directions[3 * t + 2]!;
        if (cosine > best) [nearest, best] = [number, cosine];
      }
    });
    return nearest;
  });
}

/** Mean direction of the excess where the photo does not look, or the nearest one there. */
function unseenDirection(
  { directions }: Excess,
  flux: readonly Vector3[],
  seen: Float32Array,
): Vector3 {
  const at = ([x, y, z]: Vector3) => seen[texelOf(x, y, z, SEEN_ROWS)]!;
  const light = flux.map(luminous);
  const outside = light.map((value, i) => value * (1 - at(directions[i]!)));
  const weight = outside.some((value) => value > 0) ? outside : light;
  const sum: [number, number, number] = [0, 0, 0];
  directions.forEach((direction, i) => {
    for (const c of [0, 1, 2] as const) sum[c] += weight[i]! * direction[c];
  });
  const direction = normalised(sum);
  if (at(direction) < UNSEEN || !seen.some((share) => share < UNSEEN)) return direction;
  const texels = texelDirections(SEEN_ROWS);
  let [best, most] = [0, -2];
  seen.forEach((share, i) => {
    if (share >= UNSEEN) return;
    const cosine =
      texels[3 * i]! * direction[0] +
      texels[3 * i + 1]! * direction[1] +
      texels[3 * i + 2]! * direction[2];
    if (cosine > most) [best, most] = [i, cosine];
  });
  return normalised([texels[3 * best]!, texels[3 * best + 1]!, texels[3 * best + 2]!]);
}

function summed(vectors: readonly Vector3[]): Vector3 {
  return vectors.reduce<Vector3>((a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]], [0, 0, 0]);
}

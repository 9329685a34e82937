/** The connected clipped parts of a photo: lamps, windows, the sky. lamps.py. */
import { PHOTO_LIGHT } from "../contract/generated.ts";
import { addLamps, type Lamp } from "../light/lamp.ts";
import { normalised, type Vector3 } from "../light/matrix.ts";
import { rowSolidAngles, texelDirections } from "../light/panorama.ts";
import { evenly, type ProjectedPhoto, smoothstep } from "./image-plane.ts";

const { BRIGHT, LARGEST_LAMP_RAD, ROUND } = PHOTO_LIGHT;
const MOST = 8;

export interface ClippedArea {
  /** Its middle. */
  readonly direction: Vector3;
  readonly solidAngle: number;
  /** In the order of a panorama's texels. */
  readonly texels: readonly number[];
}

/** The largest first; 8 neighbours connect, but not around the back. */
export function clippedAreas({ clipped, seen, height }: ProjectedPhoto): ClippedArea[] {
  const on = seen.map((share, i) => {
    const most = Math.max(clipped[3 * i]!, clipped[3 * i + 1]!, clipped[3 * i + 2]!);
    return most > 0.5 && share > 0.5 ? 1 : 0;
  });
  const areas: ClippedArea[] = [];
  for (let start = 0; start < on.length; start++) {
    if (on[start]) areas.push(areaOf(taken(on, start, height), height));
  }
  return areas.sort((a, b) => b.solidAngle - a.solidAngle).slice(0, MOST);
}

/** Everything connected with a texel, which is cleared. */
function taken(on: Float32Array, start: number, height: number): number[] {
  const width = 2 * height;
  const found = [start];
  on[start] = 0;
  for (let k = 0; k < found.length; k++) {
    const [row, column] = [Math.floor(found[k]! / width), found[k]! % width];
    for (let r = Math.max(row - 1, 0); r <= Math.min(row + 1, height - 1); r++) {
      for (let c = Math.max(column - 1, 0); c <= Math.min(column + 1, width - 1); c++) {
        if (!on[r * width + c]) continue;
        on[r * width + c] = 0;
        found.push(r * width + c);
      }
    }
  }
  return found.sort((a, b) => a - b);
}

function areaOf(texels: readonly number[], height: number): ClippedArea {
  const sr = rowSolidAngles(height);
  const directions = texelDirections(height);
  const middle: [number, number, number] = [0, 0, 0];
  let solidAngle = 0;
  for (const texel of texels) {
    const own = sr[Math.floor(texel / (2 * height))]!;
    solidAngle += own;
    for (const c of [0, 1, 2] as const) middle[c] += own * directions[3 * texel + c]!;
  }
  return { direction: normalised(middle), solidAngle, texels };
}

/** The lamp that an area is, with that flux; null where it is no small round spot. */
export function lampOf(area: ClippedArea, flux: Vector3, height: number): Lamp | null {
  const { direction, solidAngle } = area;
  const radius = 2 * Math.asin(Math.sqrt(Math.min(solidAngle / (4 * Math.PI), 1)));
  if (radius > LARGEST_LAMP_RAD) return null;
  const lamp = { direction, flux, angularRadiusRad: Math.max(radius, Math.PI / height / 2) };
  const disc = new Float32Array(6 * height * height);
  addLamps(disc, [lamp], height);
  const whole = disc.reduce((a, b) => a + b, 0);
  const within = area.texels.reduce((sum, t) => {
    return sum + disc[3 * t]! + disc[3 * t + 1]! + disc[3 * t + 2]!;
  }, 0);
  return within > ROUND * whole ? lamp : null;
}

/** Adds a flux spread over a clipped area, fading into what is bright around it: no hard outline. */
export function addRaised(
  onto: Float32Array,
  area: ClippedArea,
  flux: Vector3,
  photo: ProjectedPhoto,
): void {
  const { height, radiance, seen } = photo;
  const sr = rowSolidAngles(height);
  let near = new Float32Array(seen.length);
  for (const texel of area.texels) near[texel] = 1;
  for (const shift of [1, 2, 4]) {
    const step = Math.max(1, evenly((shift * height) / 256));
    near = widened(near, height, step * 2 * height, seen.length);
    near = widened(near, height, step, 2 * height);
  }
  const [low, high] = BRIGHT;
  let total = 0;
  const weight = near.map((value, i) => {
    const most = Math.max(radiance[3 * i]!, radiance[3 * i + 1]!, radiance[3 * i + 2]!);
    const own = value * smoothstep((most - low) / (high - low)) * seen[i]!;
    total += own * sr[Math.floor(i / (2 * height))]!;
    return own;
  });
  if (total <= 0) {
    weight.fill(0);
    for (const texel of area.texels) weight[texel] = 1;
    total = area.solidAngle;
  }
  for (let i = 0; i < onto.length; i++) {
    onto[i]! += (weight[Math.floor(i / 3)]! * flux[(i % 3) as 0 | 1 | 2]) / total;
  }
}

/** Half of each value and a quarter of those `step` away on both sides, around lines of `length`. */
function widened(
  values: Float32Array,
  height: number,
  step: number,
  length: number,
): Float32Array<ArrayBuffer> {
  const result = new Float32Array(2 * height * height);
  for (let i = 0; i < result.length; i++) {
    const line = i - (i % length);
    const [before, after] = [(i - line - step + length) % length, (i - line + step) % length];
    result[i] = 0.25 * (values[line + before]! + values[line + after]!) + 0.5 * values[i]!;
  }
  return result;
}

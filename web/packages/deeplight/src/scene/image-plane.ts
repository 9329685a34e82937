/** The photo's own pixels on the sphere: what the camera saw is known, not estimated. projection.py. */
import { PHOTO_LIGHT } from "../contract/generated.ts";
import { radianceFromPixel } from "../light/camera-response.ts";
import type { Size } from "../light/means.ts";

const { CLIPPED, FEATHER, MOST_SHOWN, PIXELS_PER_TEXEL, SAMPLES } = PHOTO_LIGHT;

/** A whole photo on the plane at distance 1 before the camera, which looks along its middle. */
export interface ImagePlane {
  readonly halfWidth: number;
  readonly halfHeight: number;
}

/** A photo on a panorama of `height`: linear radiance where the camera looked, 0 elsewhere. */
export interface ProjectedPhoto {
  readonly height: number;
  /** RGB, relative to the camera's white; clipped pixels have at most `MOST_SHOWN`. */
  readonly radiance: Float32Array;
  /** 1 where the photo shows the texel, falling to 0 at the photo's edge and outside. */
  readonly seen: Float32Array;
  /** Part of the texel, 0 to 1, where each channel may be clipped. */
  readonly clipped: Float32Array;
}

/** A photo in [0, 1], RGB, and where it lies. */
export interface PlacedPhoto extends Size {
  readonly pixels: Float32Array;
  readonly plane: ImagePlane;
}

export function planeOf({ width, height }: Size, verticalFovRad: number): ImagePlane {
  const halfHeight = Math.tan(verticalFovRad / 2);
  return { halfWidth: (halfHeight * width) / height, halfHeight };
}

/** Size to which a photo is averaged, still gamma-encoded, if it is much finer than a texel. */
export function reducedSize(photo: Size, plane: ImagePlane, height: number): Size {
  const focal = photo.height / (2 * plane.halfHeight);
  const factor = (focal * Math.PI) / height / PIXELS_PER_TEXEL;
  if (factor < 1.5) return photo;
  const [rows, columns] = [photo.height, photo.width].map((n) => Math.max(2, evenly(n / factor)));
  return { height: rows!, width: columns! };
}

/** Each texel gets the mean of what it covers. */
export function projected(photo: PlacedPhoto, height: number): ProjectedPhoto {
  const { plane } = photo;
  const values = shownValues(photo);
  const shorter = 2 * Math.min(plane.halfWidth, plane.halfHeight);
  const edge = Math.max((FEATHER * shorter) / 2, (1.5 * Math.PI) / height);
  const texels = 2 * height * height;
  const result = {
    height,
    radiance: new Float32Array(3 * texels),
    seen: new Float32Array(texels),
    clipped: new Float32Array(3 * texels),
  };
  const sums = new Float64Array(6);
  for (let texel = 0; texel < texels; texel++) {
    let [inside, soft] = [0, 0];
    sums.fill(0);
    for (let k = 0; k < SAMPLES * SAMPLES; k++) {
      const place = placeOf(texel, k, height);
      if (!place) continue;
      const toSide = plane.halfWidth - Math.abs(place[0]);
      const toEnd = plane.halfHeight - Math.abs(place[1]);
      if (toSide < 0 || toEnd < 0) continue;
      inside++;
      soft += smoothstep(toSide / edge) * smoothstep(toEnd / edge);
      addLookedUp(sums, values, photo, place);
    }
    if (inside === 0) continue;
    result.seen[texel] = soft / SAMPLES ** 2;
    for (let c = 0; c < 3; c++) {
      result.radiance[3 * texel + c] = sums[c]! / inside;
      result.clipped[3 * texel + c] = sums[3 + c]! / inside;
    }
  }
  return result;
}

export function smoothstep(t: number): number {
  const s = Math.min(Math.max(t, 0), 1);
  return s * s * (3 - 2 * s);
}

/** Linear radiance and whether it clips, six numbers a pixel. */
function shownValues({ pixels }: PlacedPhoto): Float32Array {
  const values = new Float32Array(2 * pixels.length);
  pixels.forEach((encoded, i) => {
    const to = 6 * Math.floor(i / 3) + (i % 3);
    values[to] = Math.min(radianceFromPixel(encoded), MOST_SHOWN);
    values[to + 3] = encoded >= Math.fround(CLIPPED) ? 1 : 0;
  });
  return values;
}

/** Right and up on the image plane of a sample within a texel; null behind the camera. */
function placeOf(texel: number, sample: number, height: number): [number, number] | null {
  const step = Math.PI / height;
  const column = (texel % (2 * height)) + ((sample % SAMPLES) + 0.5) / SAMPLES;
  const phi = column * step - Math.PI;
  if (Math.abs(phi) >= Math.PI / 2) return null;
  const front = Math.cos(phi);
  if (front <= 1e-6) return null;
  const row = Math.floor(texel / (2 * height)) + (Math.floor(sample / SAMPLES) + 0.5) / SAMPLES;
  return [Math.sin(phi) / front, 1 / Math.tan(row * step) / front];
}

/** Adds the bilinear values at a place of the plane; at the edge, the edge goes on. */
function addLookedUp(
  sums: Float64Array,
  values: Float32Array,
  { width, height, plane }: PlacedPhoto,
  [x, y]: readonly [number, number],
): void {
  const across = (x / plane.halfWidth + 1) * (width / 2) - 0.5;
  const along = (1 - y / plane.halfHeight) * (height / 2) - 0.5;
  const column = Math.min(Math.max(across, 0), width - 1);
  const row = Math.min(Math.max(along, 0), height - 1);
  const [left, top] = [Math.floor(column), Math.floor(row)];
  const [right, down] = [column - left, row - top];
  for (let k = 0; k < 4; k++) {
    const at = Math.min(top + (k >> 1), height - 1) * width + Math.min(left + (k & 1), width - 1);
    const part = (k >> 1 ? down : 1 - down) * (k & 1 ? right : 1 - right);
    for (let c = 0; c < 6; c++) sums[c]! += part * values[6 * at + c]!;
  }
}

/** Python's round: half to even. */
export function evenly(value: number): number {
  const low = Math.floor(value);
  const half = value - low;
  return half < 0.5 || (half === 0.5 && low % 2 === 0) ? low : low + 1;
}

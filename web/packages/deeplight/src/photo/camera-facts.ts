/** What a JPEG's EXIF data say of its camera, as io/exif.py and io/tilt.py read them. */
import type { Vector3 } from "../light/matrix.ts";
import { type Entries, type Exif, entriesAt, exifOf, numberOf, SIGNED_RATIONAL } from "./exif.ts";

export interface CameraFacts {
  /** Of the whole upright picture; undefined where nothing plausible is known. */
  readonly verticalFovRad: number | undefined;
  /** Against gravity, of length 1, in the camera frame of the upright picture; null where that is not known. */
  readonly up: Vector3 | null;
}

const DIAGONAL_35MM_MM = Math.hypot(36, 24);
const PLAUSIBLE_RAD = [Math.PI / 60, (150 * Math.PI) / 180] as const;
const STEEPEST_DEG = 89;
const [ORIENTATION, MAKER_NOTE, ELEVATION] = [0x0112, 0x927c, 0x9405];
const [FOCAL_LENGTH_35MM, FOCAL_LENGTH, ORIGINAL_WIDTH] = [0xa405, 0x920a, 0xa002];
/** Of the sensor, along the stored rows. */
const [PIXELS_PER_UNIT, UNIT] = [0xa20e, 0xa210];
const MM_PER_UNIT: Readonly<Record<number, number>> = { 2: 25.4, 3: 10, 4: 1, 5: 0.001 };
const APPLE = "Apple iOS\0";
const [APPLE_ENTRIES, ACCELERATION] = [14, 8];

/** @param width of the upright picture, as is `height`. */
export function cameraFacts(file: ArrayBuffer, width: number, height: number): CameraFacts {
  const exif = exifOf(file);
  if (!exif) return { verticalFovRad: undefined, up: null };
  return { verticalFovRad: verticalFovRad(exif, width, height), up: upOf(exif) };
}

function verticalFovRad(exif: Exif, width: number, height: number) {
  const fov = 2 * Math.atan(height / 2 / focalPx(exif, width, height));
  return fov >= PLAUSIBLE_RAD[0] && fov <= PLAUSIBLE_RAD[1] ? fov : undefined;
}

/** NaN where nothing says it. */
function focalPx({ main, camera, isLittle }: Exif, width: number, height: number): number {
  const said = (tag: number): number => numberOf(camera.get(tag), isLittle) ?? 0;
  const like35mm = said(FOCAL_LENGTH_35MM);
  if (like35mm > 0) return (like35mm / DIAGONAL_35MM_MM) * Math.hypot(width, height);
  const pixelsPerMm = said(PIXELS_PER_UNIT) / (MM_PER_UNIT[said(UNIT) || 2] ?? Number.NaN);
  const focal = said(FOCAL_LENGTH) * pixelsPerMm;
  if (!(focal > 0)) return Number.NaN;
  // A picture made smaller later keeps the resolution of the original.
  const isOnItsSide = (numberOf(main.get(ORIENTATION), isLittle) ?? 1) >= 5;
  const original = said(ORIGINAL_WIDTH);
  return original > 0 ? (focal * (isOnItsSide ? height : width)) / original : focal;
}

/** By an iPhone's acceleration, else by the elevation of the view. */
function upOf({ main, camera, isLittle }: Exif): Vector3 | null {
  const orientation = numberOf(main.get(ORIENTATION), isLittle) || 1;
  const found = upright(acceleration(camera), orientation);
  if (found) return found;
  const degrees = numberOf(camera.get(ELEVATION), isLittle);
  if (degrees === undefined || Math.abs(degrees) >= STEEPEST_DEG) return null;
  const pitch = (degrees * Math.PI) / 180;
  return [0, Math.cos(pitch), -Math.sin(pitch)];
}

/** Apple's AccelerationVector, in g, in the phone's axes; its offsets count from the note's beginning. */
function acceleration(camera: Entries): readonly number[] {
  const note = camera.get(MAKER_NOTE)?.values;
  if (!note || note.byteLength < APPLE_ENTRIES) return [];
  const maker = new Uint8Array(note.buffer, note.byteOffset, APPLE.length);
  if (String.fromCharCode(...maker) !== APPLE) return [];
  const isLittle = note.getUint16(12) === 0x4949;
  const entry = entriesAt(note, APPLE_ENTRIES, isLittle).get(ACCELERATION);
  if (entry?.type !== SIGNED_RATIONAL || entry.values.byteLength !== 24) return [];
  const part = (at: number): number => entry.values.getInt32(at, isLittle);
  return [0, 8, 16].map((at) => part(at) / part(at + 4));
}

/** Up in the upright picture; null of a phone that was shaken or lay flat, and of a mirrored picture. */
function upright(acceleration: readonly number[], orientation: number): Vector3 | null {
  const [x = 0, y = 0, z = 0] = acceleration.map((value) => -value); // a phone at rest feels 1 g upwards
  const length = Math.hypot(x, y, z);
  const turned = { 1: [-y, x], 3: [y, -x], 6: [x, y], 8: [-x, -y] }[orientation];
  if (!turned || !(length > 0.7 && length < 1.3)) return null;
  const [right, up] = turned as [number, number];
  return up < 0.2 * length ? null : [right / length, up / length, z / length];
}

/** Where the trained camera's view lies in a photo or a frame: preprocess.frame_photo. */
import { ASSUMED_LONG_SIDE_FOV_RAD, SLIDE } from "../contract/generated.ts";
import type { Matrix3x3 } from "../light/matrix.ts";
import type { Contract } from "../network/contract.ts";

/** Edges in pixels of the upright photo from its upper left corner; they may lie outside it. */
export interface Framing {
  readonly photoHeight: number;
  readonly photoWidth: number;
  readonly top: number;
  readonly bottom: number;
  readonly left: number;
  readonly right: number;
  readonly verticalFovRad: number; // of the whole photo, as used
  readonly fovSource: "given" | "assumed";
  readonly inputHeight: number;
  readonly inputWidth: number;
  readonly down: number; // pixels by which the view was slid below the photo's centre
  readonly aside: number; // and to the right of it
}

/** @throws RangeError where the field of view is not inside (0, pi). */
export function framePhoto(
  height: number,
  width: number,
  verticalFovRad: number | undefined,
  contract: Contract,
): Framing {
  const assumed = verticalFovRad === undefined;
  if (!assumed && !(verticalFovRad > 0 && verticalFovRad < Math.PI)) {
    throw new RangeError(`expected a field of view between 0 and pi, got ${verticalFovRad}`);
  }
  const focal = assumed
    ? Math.max(height, width) / 2 / Math.tan(ASSUMED_LONG_SIDE_FOV_RAD / 2)
    : height / 2 / Math.tan(verticalFovRad / 2); // in pixels
  const half = Math.tan((contract.vertical_fov_deg * Math.PI) / 360);
  return {
    photoHeight: height,
    photoWidth: width,
    top: height / 2 - focal * half * (1 - 2 * contract.background_top),
    bottom: height / 2 - focal * half * (1 - 2 * contract.background_fraction),
    left: width / 2 - focal * half * contract.frame_aspect,
    right: width / 2 + focal * half * contract.frame_aspect,
    verticalFovRad: verticalFovRad ?? 2 * Math.atan(height / 2 / focal),
    fovSource: assumed ? "assumed" : "given",
    inputHeight: contract.height,
    inputWidth: contract.width,
    down: 0,
    aside: 0,
  };
}

/** Slides the view down into a photo that is tall enough for it; other photos keep theirs. */
export function slidIntoPhoto(framing: Framing): Framing {
  const { top, bottom, photoHeight } = framing;
  const down = Math.min(-top, photoHeight - bottom);
  const fits = bottom - top <= SLIDE.FITS * photoHeight;
  return fits && down >= SLIDE.LEAST * photoHeight ? slid(framing, down, 0) : framing;
}

function slid(framing: Framing, down: number, aside: number): Framing {
  return {
    ...framing,
    top: framing.top + down,
    bottom: framing.bottom + down,
    left: framing.left + aside,
    right: framing.right + aside,
    down: framing.down + down,
    aside: framing.aside + aside,
  };
}

/** The views of a photo that the network is shown; two where the photo has room for another. */
export function looks(framing: Framing): readonly Framing[] {
  const { top, bottom, left, right, photoHeight } = framing;
  const farthest = SLIDE.FARTHEST * focalOf(framing);
  const below = photoHeight - bottom;
  if (below >= SLIDE.ROOM * (bottom - top)) {
    return [framing, slid(framing, Math.min(below, farthest), 0)];
  }
  if (left < SLIDE.ROOM * (right - left)) return [framing];
  const aside = Math.min(left, farthest);
  return [slid(framing, 0, -aside), slid(framing, 0, aside)];
}

/** What the views of `looks` show together, as one. */
export function hull(views: readonly Framing[]): Framing {
  const { bottom, right } = views.at(-1)!;
  return { ...views[0]!, bottom, right };
}

/** Pixels at which the photo's plane stands before the camera. */
function focalOf({ photoHeight, verticalFovRad }: Framing): number {
  return photoHeight / 2 / Math.tan(verticalFovRad / 2);
}

/** How far up the view looks from the photo's optical axis; negative where it was slid. */
export function pitchOf(framing: Framing): number {
  return -Math.atan(framing.down / Math.hypot(focalOf(framing), framing.aside));
}

/** Whether the view looks along the photo's optical axis. */
export function isCentred({ down, aside }: Framing): boolean {
  return down === 0 && aside === 0;
}

/** Turns directions from the frame of what the view shows to the photo's. */
export function photoFromView(framing: Framing): Matrix3x3 {
  const focal = focalOf(framing);
  const [pitch, yaw] = [pitchOf(framing), -Math.atan(framing.aside / focal)];
  const [cp, sp, cy, sy] = [Math.cos(pitch), Math.sin(pitch), Math.cos(yaw), Math.sin(yaw)];
  return [cy, sy * sp, sy * cp, 0, cp, -sp, -sy, cy * sp, cy * cp];
}

/** Part of the trained view that the photo shows, by image area; 1 is all of it. */
export function visibleFraction(framing: Framing): number {
  const rows = Math.min(framing.bottom, framing.photoHeight) - Math.max(framing.top, 0);
  const columns = Math.min(framing.right, framing.photoWidth) - Math.max(framing.left, 0);
  return Math.min((rows * columns) / area(framing), 1);
}

/** Part of the photo that the network sees, by area; the rest was cropped away. */
export function usedFraction(framing: Framing): number {
  const photo = framing.photoHeight * framing.photoWidth;
  return Math.min((visibleFraction(framing) * area(framing)) / photo, 1);
}

function area(framing: Framing): number {
  return (framing.bottom - framing.top) * (framing.right - framing.left);
}

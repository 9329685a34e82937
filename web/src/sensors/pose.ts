/** How a hand holds the camera, in a world whose +Y is up; as in frames.py. */
import { type Matrix3x3, product } from "deeplight/core";

/** Right-handed rotation about a coordinate axis. */
export function rotation(axis: "x" | "y" | "z", angleRad: number): Matrix3x3 {
  const c = Math.cos(angleRad);
  const s = Math.sin(angleRad);
  if (axis === "x") return [1, 0, 0, 0, c, -s, 0, s, c];
  if (axis === "y") return [c, 0, s, 0, 1, 0, -s, 0, c];
  return [c, -s, 0, s, c, 0, 0, 0, 1];
}

/**
 * Positive yaw turns the view to the left, positive pitch raises it, positive roll turns the camera
 * counter-clockwise as its holder sees it.
 */
export function worldFromCamera(yawRad: number, pitchRad: number, rollRad = 0): Matrix3x3 {
  return product(rotation("y", yawRad), product(rotation("x", pitchRad), rotation("z", rollRad)));
}

/** How far the view points above the horizon. */
export function pitchOf(worldFromCamera: Matrix3x3): number {
  return Math.asin(Math.max(-1, Math.min(1, -worldFromCamera[5])));
}

/** How far the view is turned to the left of -Z; of one straight up or down anything. */
export function headingOf([, , backX, , , , , , backZ]: Matrix3x3): number {
  return Math.atan2(backX, backZ);
}

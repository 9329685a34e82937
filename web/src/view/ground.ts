/**
 * The horizontal plane that stands for the real floor or table, seen from the camera.
 *
 * World frame: +Y is up, the plane is y = 0, the camera stands at (0, height, 0). Metres.
 */
import { type Matrix3x3, turned, type Vector3 } from "deeplight/core";

/** A camera above the plane: its pose and what it sees. */
export interface Viewpoint {
  readonly worldFromCamera: Matrix3x3;
  readonly heightM: number;
  readonly verticalFovRad: number;
  /** Width over height of what is shown. */
  readonly aspect: number;
}

/** Farther away than this many camera heights is as good as the horizon. */
const FARTHEST_HEIGHTS = 12;

/** Direction in the world through a place of the view; (0, 0) is its upper left, (1, 1) its lower right corner. */
export function ray(view: Viewpoint, x: number, y: number): Vector3 {
  const up = Math.tan(view.verticalFovRad / 2);
  return turned(view.worldFromCamera, [(2 * x - 1) * up * view.aspect, (1 - 2 * y) * up, -1]);
}

/** The point of the plane seen at a place of the view; at and above the horizon one far away below it. */
export function groundPoint(view: Viewpoint, x: number, y: number): Vector3 {
  const [right, up, back] = ray(view, x, y);
  const farthest = view.heightM * FARTHEST_HEIGHTS;
  const flat = Math.hypot(right, back) || 1e-9;
  const distance = up < 0 ? Math.min((view.heightM * flat) / -up, farthest) : farthest;
  return [(right / flat) * distance, 0, (back / flat) * distance];
}

/** Whether the plane is seen at a place of the view, and not so far away that it is the horizon. */
export function showsGround(view: Viewpoint, x: number, y: number): boolean {
  const [right, up, back] = ray(view, x, y);
  return up < 0 && Math.hypot(right, back) < -up * FARTHEST_HEIGHTS;
}

/** Size of an object at `point` that spans `share` of the view's shorter side. */
export function sizeSpanning(view: Viewpoint, point: Vector3, share: number): number {
  const distance = Math.hypot(point[0], view.heightM, point[2]);
  const tangent = Math.tan(view.verticalFovRad / 2) * Math.min(1, view.aspect);
  return 2 * tangent * distance * share;
}

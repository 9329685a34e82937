/** One photo's environment: the photo where the camera looked, the network elsewhere, and lamps. environment.py. */
import type { Environment } from "../light/environment.ts";
import { addLamps, type Lamp } from "../light/lamp.ts";
import { enlarged } from "../light/panorama.ts";
import { continued, type Tilt } from "./continuation.ts";
import { type PlacedPhoto, projected } from "./image-plane.ts";
import { findLamps } from "./lamps.ts";
import { adapted, mapRows, smoothMap } from "./surroundings.ts";

/** A scene's light with its lamps drawn in it, each at its place and size. */
export interface SceneLight extends Environment {
  /** Compact lights, the strongest first; in `radiance` already. */
  readonly lamps: readonly Lamp[];
}

/**
 * Puts a photo into the light that was estimated from it.
 *
 * @param ball radiance of the estimate.
 * @param photo averaged to `reducedSize` of its own.
 * @param height rows of the panorama, even, 64 to 2048.
 * @param own the network's lamps, which the estimate holds.
 * @param tilt the camera's; without it the photo does not go on.
 */
export function sceneLight(
  ball: Float32Array,
  photo: PlacedPhoto,
  height: number,
  own: readonly Lamp[],
  tilt: Tilt | null,
): SceneLight {
  const size = Math.sqrt(ball.length / 3);
  const shown = projected(photo, height);
  const found = findLamps(ball, size, shown, own);
  const rows = mapRows(height);
  const smooth = smoothMap(found.rest, size, rows);
  const map = tilt ? continued(smooth, rows, shown, tilt) : smooth;
  const least = enlarged(smooth, rows, height);
  const radiance = enlarged(adapted(map, rows, photo), rows, height).slice();
  for (let i = 0; i < radiance.length; i++) {
    const around = radiance[i]!;
    const seen = shown.seen[Math.floor(i / 3)]!;
    if (seen === 0) continue;
    const known = shown.radiance[i]!;
    const bound = known + shown.clipped[i]! * Math.max(least[i]! - known, 0) + found.areas[i]!;
    radiance[i] = around + (bound - around) * seen;
  }
  addLamps(radiance, found.lamps, height);
  return { radiance, height, seen: shown.seen, lamps: found.lamps };
}

/** One photo's environment: the photo where the camera looked, the network elsewhere, and lamps. environment.py. */
import { SCENE_FILE } from "../contract/generated.ts";
import type { Environment } from "../light/environment.ts";
import { addLamps, type Lamp } from "../light/lamp.ts";
import type { Vector3 } from "../light/matrix.ts";
import { enlarged, shrunk } from "../light/panorama.ts";
import { continued, type Tilt } from "./continuation.ts";
import { type PlacedPhoto, type ProjectedPhoto, projected } from "./image-plane.ts";
import { findLamps } from "./lamps.ts";
import { adapted, mapRows, smoothMap } from "./surroundings.ts";

const UP: Vector3 = [0, 1, 0];

/** A scene's light with its lamps drawn in it, each at its place and size. */
export interface SceneLight extends Environment {
  /** Compact lights, the strongest first; in `radiance` already. */
  readonly lamps: readonly Lamp[];
  readonly detailOf: string | null;
}

/** Lays detail over a smooth panorama of `rows`, camera frame, and names the place that has it. */
export type Detail = (
  map: Float32Array,
  rows: number,
  shown: ProjectedPhoto,
  up: Vector3,
) => { readonly radiance: Float32Array; readonly rows: number; readonly name: string };

/**
 * Puts a photo into the light that was estimated from it.
 *
 * @param ball radiance of the estimate.
 * @param photo averaged to `reducedSize` of its own.
 * @param height rows of the panorama, even, 64 to 2048.
 * @param own the network's lamps, which the estimate holds.
 * @param tilt the camera's; without it the photo does not go on.
 * @param detail over what the photo does not show; left out, that stays smooth.
 */
export function sceneLight(
  ball: Float32Array,
  photo: PlacedPhoto,
  height: number,
  own: readonly Lamp[],
  tilt: Tilt | null,
  detail?: Detail,
): SceneLight {
  const size = Math.sqrt(ball.length / 3);
  const shown = projected(photo, height);
  const found = findLamps(ball, size, shown, own);
  const rows = mapRows(height);
  const smooth = smoothMap(found.rest, size, rows);
  const map = tilt ? continued(smooth, rows, shown, tilt) : smooth;
  const least = enlarged(smooth, rows, height);
  const plain = adapted(map, rows, photo);
  const rich = detail?.(plain, rows, shown, tilt?.up ?? UP);
  const around = rich ?? { radiance: plain, rows };
  const bring = around.rows > height ? shrunk : enlarged;
  const radiance = bring(around.radiance, around.rows, height).slice();
  for (let i = 0; i < radiance.length; i++) {
    const around = radiance[i]!;
    const seen = shown.seen[Math.floor(i / 3)]!;
    if (seen === 0) continue;
    const known = shown.radiance[i]!;
    const bound = known + shown.clipped[i]! * Math.max(least[i]! - known, 0) + found.areas[i]!;
    radiance[i] = around + (bound - around) * seen;
  }
  addLamps(radiance, found.lamps, height);
  const detailOf = rich?.name ?? (tilt ? SCENE_FILE.itself : null);
  return { radiance, height, seen: shown.seen, lamps: found.lamps, detailOf };
}

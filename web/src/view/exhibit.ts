/** What can stand in the picture: one of the built-in objects or the user's own. */

import type { Light, Matrix3x3 } from "deeplight/core";
import type { Object3D } from "three";
import type { MaterialName } from "./material.ts";

export interface Exhibit {
  /** Stands on y = 0 around the origin; its longest side is 1. */
  readonly object: Object3D;
  readonly materials: readonly MaterialName[];
  readonly material: MaterialName;
  setMaterial(name: MaterialName): void;
  /** New light, in the frame of a camera held like `worldFromCamera`. */
  setLight(light: Light, worldFromCamera: Matrix3x3, objectFromWorld: Matrix3x3): void;
  dispose(): void;
}

/** What can stand in the picture: one of the built-in objects or the user's own. */

import type { Light, Matrix3x3 } from "deeplight/core";
import type { BufferGeometry, Matrix4, MeshStandardMaterial, Object3D } from "three";
import type { MaterialName } from "./material.ts";

/** A piece of an object as other programs take it: positions and normals, one material. */
export interface Part {
  readonly geometry: BufferGeometry;
  /** Into the object's own frame. */
  readonly matrix: Matrix4;
  readonly material: MeshStandardMaterial;
  /** RGB radiance that leaves each vertex per unit of albedo, in the light of now. */
  readonly sent: Float32Array;
}

export interface Exhibit {
  /** Stands on y = 0 around the origin; its longest side is 1. */
  readonly object: Object3D;
  readonly materials: readonly MaterialName[];
  readonly material: MaterialName;
  setMaterial(name: MaterialName): void;
  /** New light, in the frame of a camera held like `worldFromCamera`. */
  setLight(light: Light, worldFromCamera: Matrix3x3, objectFromWorld: Matrix3x3): void;
  /** What it consists of, in its material and light of now. */
  parts(): readonly Part[];
  dispose(): void;
}

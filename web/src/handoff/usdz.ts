/** The object as a USDZ file for Quick Look, its even light painted on it. */
import { CanvasTexture, Group, Mesh, MeshStandardMaterial, SRGBColorSpace } from "three";
import { USDZExporter } from "three/addons/exporters/USDZExporter.js";
import type { Part } from "../view/exhibit.ts";
import { type Painted, paint } from "./bake.ts";
import { surfaceOf } from "./surface.ts";

const LARGEST_TEXTURE = 2048;
export const USDZ_TYPE = "model/vnd.usdz+zip";

export interface Stand {
  /** About the vertical, from facing whoever looks at the object: where the camera was. */
  readonly turnRad: number;
  /** Its longest side. */
  readonly sizeM: number;
}

/** The parts, as they stand, in one file. */
export async function usdzOf(
  parts: readonly Part[],
  stand: Stand,
): Promise<Uint8Array<ArrayBuffer>> {
  const root = new Group();
  root.rotation.y = stand.turnRad;
  root.scale.setScalar(stand.sizeM);
  for (const part of parts) {
    const mesh = meshOf(part);
    mesh.matrixAutoUpdate = false;
    mesh.matrix.copy(part.matrix);
    root.add(mesh);
  }
  root.updateMatrixWorld(true);
  const options = { quickLookCompatible: true, maxTextureSize: LARGEST_TEXTURE };
  return new USDZExporter().parseAsync(root, options);
}

function meshOf(part: Part): Mesh {
  const { geometry, material } = part;
  const made = paint(part, surfaceOf(geometry, material));
  if (made) return new Mesh(made.geometry, emitting(made, material.roughness));
  return new Mesh(geometry, material);
}

/** Black but for what it emits; what gloss it has is the viewer's to light. */
function emitting({ atlas, pixels }: Painted, roughness: number): MeshStandardMaterial {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = atlas.size;
  canvas.getContext("2d")?.putImageData(new ImageData(pixels, atlas.size), 0, 0);
  const emissiveMap = new CanvasTexture(canvas);
  emissiveMap.flipY = false;
  emissiveMap.colorSpace = SRGBColorSpace;
  return new MeshStandardMaterial({ color: 0, emissive: 0xffffff, emissiveMap, roughness });
}

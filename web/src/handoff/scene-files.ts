/**
 * The built-in objects as glTF files, one for each finish, for Scene Viewer to fetch: it takes no file that the page
 * makes. They hold no light, since Scene Viewer takes none. Written when the page is built.
 */

import type { Transfer } from "../transfer/index.ts";
import { type MaterialName, standardMaterial } from "../view/material.ts";

const FINISHES = ["diffuse", "silver", "mirror", "glossy"] as const satisfies MaterialName[];
/** Metres along the longest side: what stands well on a table. */
const SIZE_M = 0.3;
const [FLOAT, UNSIGNED_SHORT, UNSIGNED_INT] = [5126, 5123, 5125] as const;

/** The files of one object by their names: the shape, and what each finish says of it. */
export function sceneFiles(name: string, transfer: Transfer): Map<string, Uint8Array> {
  const shape = `${name}.bin`;
  const { positions, normals, triangles } = transfer;
  const parts = [positions, normals, triangles].map(bytesOf);
  const files = new Map([[shape, joined(parts)]]);
  for (const finish of FINISHES) {
    const gltf = { ...described(transfer, shape), materials: [materialOf(finish)] };
    files.set(`${name}-${finish}.gltf`, new TextEncoder().encode(JSON.stringify(gltf)));
  }
  return files;
}

function materialOf(finish: (typeof FINISHES)[number]): object {
  const { color, metalness, roughness } = standardMaterial(finish);
  return {
    name: finish,
    pbrMetallicRoughness: {
      baseColorFactor: [...color.toArray(), 1],
      metallicFactor: metalness,
      roughnessFactor: roughness,
    },
  };
}

function described({ positions, normals, triangles }: Transfer, uri: string): object {
  const lengths = [positions, normals, triangles].map(({ byteLength }) => byteLength);
  const views = lengths.map((byteLength, i) => ({
    buffer: 0,
    byteOffset: lengths.slice(0, i).reduce((sum, length) => sum + padded(length), 0),
    byteLength,
  }));
  const byteLength = lengths.reduce((sum, length) => sum + padded(length), 0);
  const along = (axis: number) => positions.filter((_, i) => i % 3 === axis);
  const bounds = [0, 1, 2].map(along);
  const vectors = { componentType: FLOAT, count: positions.length / 3, type: "VEC3" };
  const wide = triangles instanceof Uint16Array ? UNSIGNED_SHORT : UNSIGNED_INT;
  return {
    asset: { version: "2.0", generator: "DeepLight" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, scale: [SIZE_M, SIZE_M, SIZE_M] }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 1 }, indices: 2, material: 0 }] }],
    accessors: [
      {
        bufferView: 0,
        ...vectors,
        min: bounds.map((values) => values.reduce((a, b) => Math.min(a, b))),
        max: bounds.map((values) => values.reduce((a, b) => Math.max(a, b))),
      },
      { bufferView: 1, ...vectors },
      { bufferView: 2, componentType: wide, count: triangles.length, type: "SCALAR" },
    ],
    bufferViews: views,
    buffers: [{ uri, byteLength }],
  };
}

const padded = (length: number): number => Math.ceil(length / 4) * 4;

function bytesOf({ buffer, byteOffset, byteLength }: Float32Array | Uint16Array | Uint32Array) {
  return new Uint8Array(buffer as ArrayBuffer, byteOffset, byteLength);
}

function joined(parts: readonly Uint8Array[]): Uint8Array {
  const whole = new Uint8Array(parts.reduce((sum, { length }) => sum + padded(length), 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += padded(part.length);
  }
  return whole;
}

/**
 * Our light painted on an object, for viewers that take none: Quick Look ignores a file's lamps, domes and vertex
 * colours, but shows what a texture emits. Only light that looks the same from everywhere can be painted.
 */
import { pixelFromRadiance } from "deeplight/core";
import { BufferAttribute, BufferGeometry, type MeshStandardMaterial } from "three";
import type { Part } from "../view/exhibit.ts";
import { type Atlas, atlasFor, coordinates, painted } from "./atlas.ts";
import type { Surface } from "./surface.ts";

/** Pixels along a square of two triangles: light is linear on each, so few are enough; a picture needs more. */
const SQUARE = 8;
const SQUARE_WITH_PICTURE = 128;

export interface Painted {
  readonly atlas: Atlas;
  /** The part's triangles with corners of their own. */
  readonly geometry: BufferGeometry;
  /** RGBA, encoded as the camera's pixels. */
  readonly pixels: Uint8ClampedArray<ArrayBuffer>;
}

/** Null where a part's look depends on the eye or on what is behind it: metal, glass. */
export function paint({ geometry, material, sent }: Part, surface: Surface): Painted | null {
  const corners = geometry.index?.count ?? geometry.attributes.position!.count;
  const hasPicture = material.map !== null || material.emissiveMap !== null;
  const atlas = atlasFor(Math.floor(corners / 3), hasPicture ? SQUARE_WITH_PICTURE : SQUARE);
  if (!atlas || !isPaintable(material)) return null;
  const vertex = (corner: number): number => geometry.index?.getX(corner) ?? corner;
  const pixels = painted(atlas, (triangle, second, third) => {
    const [a, b, c] = [0, 1, 2].map((i) => vertex(3 * triangle + i)) as [number, number, number];
    const { albedo, emission } = surface(a, b, c, second, third);
    return [0, 1, 2].map((channel) => {
      const at = (corner: number): number => sent[3 * corner + channel]!;
      const light = at(a) + second * (at(b) - at(a)) + third * (at(c) - at(a));
      return pixelFromRadiance(albedo[channel]! * Math.max(light, 0) + emission[channel]!);
    });
  });
  return { atlas, geometry: apart(geometry, atlas), pixels };
}

function isPaintable({ metalness, metalnessMap, transparent, alphaTest }: MeshStandardMaterial) {
  return metalness < 0.5 && metalnessMap === null && !transparent && alphaTest === 0;
}

/** The same triangles, none of which shares a corner with another. */
function apart(geometry: BufferGeometry, atlas: Atlas): BufferGeometry {
  const { position, normal } = geometry.index
    ? geometry.toNonIndexed().attributes
    : geometry.attributes;
  const made = new BufferGeometry();
  made.setAttribute("position", position!);
  made.setAttribute("normal", normal!);
  made.setAttribute("uv", new BufferAttribute(coordinates(atlas), 2));
  return made;
}

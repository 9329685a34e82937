/** What an object is made of: the paper's three spheres, a glossy coat, or the file's own. */

import { REFLECTIVITY } from "deeplight/core";
import { Color, type MeshPhysicalMaterial as Material, MeshPhysicalMaterial } from "three";

export const MATERIALS = ["diffuse", "silver", "mirror", "glossy", "file"] as const;
export type MaterialName = (typeof MATERIALS)[number];

/** GGX alpha of the matte silver sphere is 0.3, of the coat 0.08; three.js squares its roughness. */
const SILVER_ROUGHNESS = Math.sqrt(0.3);
const COAT_ROUGHNESS = Math.sqrt(0.08);
const COAT_COLOUR = 0.55;

/** A material of three.js, for `BallLight` or another program to light. */
export function standardMaterial(name: Exclude<MaterialName, "file">): Material {
  switch (name) {
    case "mirror":
      return made(REFLECTIVITY.mirror, { roughness: 0, metalness: 1 });
    case "diffuse":
      // Without this three.js would add 4 % of gloss.
      return made(REFLECTIVITY.diffuse, { roughness: 1, metalness: 0, specularIntensity: 0 });
    case "silver":
      return made(REFLECTIVITY.matte_silver, { roughness: SILVER_ROUGHNESS, metalness: 1 });
    case "glossy":
      return made(COAT_COLOUR, { roughness: COAT_ROUGHNESS, metalness: 0 });
  }
}

function made(
  grey: number,
  finish: { roughness: number; metalness: number; specularIntensity?: number },
): Material {
  return new MeshPhysicalMaterial({ color: new Color(grey, grey, grey), ...finish });
}

/** What a material sends back at a point of a triangle, its pictures included. */
import {
  type BufferGeometry,
  Color,
  type MeshStandardMaterial,
  SRGBColorSpace,
  type Texture,
  Vector2,
} from "three";

type RGB = readonly [number, number, number];

/** At the weights of a triangle's second and third vertex. */
export type Surface = (
  a: number,
  b: number,
  c: number,
  second: number,
  third: number,
) => { readonly albedo: readonly number[]; readonly emission: readonly number[] };

/** Of a picture more than this is not painted. */
const LONGEST_PX = 1024;

export function surfaceOf(geometry: BufferGeometry, material: MeshStandardMaterial): Surface {
  const { uv, color: tints } = geometry.attributes;
  const [map, glow] = [looked(material.map), looked(material.emissiveMap)];
  const emissive = new Color(material.emissive).multiplyScalar(material.emissiveIntensity);
  return (a, b, c, second, third) => {
    // A pixel beyond the triangle must not reach into another part of the picture.
    const [y, z] = [Math.min(second, 1), Math.min(third, Math.max(1 - second, 0))];
    const between = (at: (vertex: number) => number): number =>
      (1 - y - z) * at(a) + y * at(b) + z * at(c);
    const place: readonly [number, number] = uv
      ? [between((i) => uv.getX(i)), between((i) => uv.getY(i))]
      : [0, 0];
    const tint: RGB =
      tints && material.vertexColors
        ? [
            between((i) => tints.getX(i)),
            between((i) => tints.getY(i)),
            between((i) => tints.getZ(i)),
          ]
        : [1, 1, 1];
    const [picture, shine] = [map(...place), glow(...place)];
    return {
      albedo: material.color.toArray().map((value, i) => value * picture[i]! * tint[i]!),
      emission: emissive.toArray().map((value, i) => value * shine[i]!),
    };
  };
}

/** Linear RGB of a texture at u, v; white without one. */
function looked(texture: Texture | null): (u: number, v: number) => RGB {
  if (!texture) return () => [1, 1, 1];
  const image = texture.image as ImageBitmap;
  const scale = Math.min(1, LONGEST_PX / Math.max(image.width, image.height));
  const canvas = new OffscreenCanvas(
    Math.max(1, Math.round(image.width * scale)),
    Math.max(1, Math.round(image.height * scale)),
  );
  const { width, height } = canvas;
  const context = canvas.getContext("2d", { willReadFrequently: true })!;
  context.drawImage(image, 0, 0, width, height);
  const { data } = context.getImageData(0, 0, width, height);
  const isEncoded = texture.colorSpace === SRGBColorSpace;
  texture.updateMatrix();
  const [place, colour] = [new Vector2(), new Color()];
  return (u, v) => {
    texture.transformUv(place.set(u, v)); // wraps, and turns rows as the texture wants them
    const column = Math.min(Math.floor(place.x * width), width - 1);
    const row = Math.min(Math.floor(place.y * height), height - 1);
    const at = 4 * (row * width + column);
    colour.setRGB(data[at]! / 255, data[at + 1]! / 255, data[at + 2]! / 255);
    const { r, g, b } = isEncoded ? colour.convertSRGBToLinear() : colour;
    return [r, g, b];
  };
}

/**
 * Triangles side by side in one texture, two to a square: something can be painted on a surface that has no
 * texture coordinates. Between the two runs a diagonal that belongs to each of them, and every corner lies in
 * the middle of a pixel, so what is linear on a triangle stays so when a viewer interpolates.
 */

export interface Atlas {
  /** Pixels along a side of the texture, and of each square. */
  readonly size: number;
  readonly square: number;
  readonly triangles: number;
}

/** iPhones of every age take such a texture. */
const LARGEST = 2048;
const SMALLEST_SQUARE = 4;

/** @param square wanted; smaller where there are many triangles. Null where there are too many. */
export function atlasFor(triangles: number, square: number): Atlas | null {
  const perRow = Math.ceil(Math.sqrt(Math.ceil(triangles / 2)));
  const fitting = Math.min(square, Math.floor(LARGEST / perRow));
  return fitting < SMALLEST_SQUARE ? null : { size: perRow * fitting, square: fitting, triangles };
}

type Pixel = readonly [column: number, row: number];

/** The pixels that the corners of a triangle lie on. */
export function cornersOf({ size, square }: Atlas, triangle: number): readonly Pixel[] {
  const [left, top] = squareOf({ size, square }, triangle);
  const last = square - 1;
  if (triangle % 2 === 0) {
    return [
      [left, top],
      [left + last - 2, top],
      [left, top + last - 2],
    ];
  }
  return [
    [left + last, top + last],
    [left + 1, top + last],
    [left + last, top + 1],
  ];
}

/** u and v of every corner, from the upper left as in glTF. */
export function coordinates(atlas: Atlas): Float32Array {
  const uv = new Float32Array(6 * atlas.triangles);
  for (let triangle = 0; triangle < atlas.triangles; triangle++) {
    cornersOf(atlas, triangle).forEach(([column, row], corner) => {
      const at = 6 * triangle + 2 * corner;
      uv[at] = (column + 0.5) / atlas.size;
      uv[at + 1] = (row + 0.5) / atlas.size;
    });
  }
  return uv;
}

/** RGB, 0 to 1, at a point of a triangle: its weights of the second and third corner. */
export type Colour = (triangle: number, second: number, third: number) => readonly number[];

/** RGBA bytes of the whole texture; weights reach a pixel beyond the triangle. */
export function painted(atlas: Atlas, colour: Colour): Uint8ClampedArray<ArrayBuffer> {
  const { size, square, triangles } = atlas;
  const pixels = new Uint8ClampedArray(4 * size * size);
  const last = square - 1;
  for (let triangle = 0; triangle < triangles; triangle++) {
    const [left, top] = squareOf(atlas, triangle);
    const isFirst = triangle % 2 === 0;
    for (let row = 0; row < square; row++) {
      for (let column = 0; column < square; column++) {
        if (row + column < last !== isFirst) continue;
        const [along, down] = isFirst ? [column, row] : [last - column, last - row];
        const legs = isFirst ? square - 3 : square - 2;
        const rgb = colour(triangle, along / legs, down / legs);
        const at = 4 * ((top + row) * size + left + column);
        for (let c = 0; c < 3; c++) pixels[at + c] = 255 * rgb[c]!;
        pixels[at + 3] = 255;
      }
    }
  }
  return pixels;
}

function squareOf({ size, square }: Pick<Atlas, "size" | "square">, triangle: number): Pixel {
  const [at, perRow] = [Math.floor(triangle / 2), size / square];
  return [(at % perRow) * square, Math.floor(at / perRow) * square];
}

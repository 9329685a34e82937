/** A rotation, row by row; it reads as a map: `worldFromCamera` turns camera directions. */
export type Matrix3x3 = readonly [
  number,
  number,
  number,
  number,
  number,
  number,
  number,
  number,
  number,
];

export type Vector3 = readonly [number, number, number];

export const IDENTITY: Matrix3x3 = [1, 0, 0, 0, 1, 0, 0, 0, 1];

export function turned(m: Matrix3x3, [x, y, z]: Vector3): Vector3 {
  return [
    m[0] * x + m[1] * y + m[2] * z,
    m[3] * x + m[4] * y + m[5] * z,
    m[6] * x + m[7] * y + m[8] * z,
  ];
}

export function transposed(m: Matrix3x3): Matrix3x3 {
  return [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
}

/** `a` after `b`: the map a b. */
export function product(a: Matrix3x3, b: Matrix3x3): Matrix3x3 {
  const columns = transposed(b);
  const column = (i: 0 | 3 | 6): Vector3 => [columns[i], columns[i + 1]!, columns[i + 2]!];
  const [x, y, z] = [turned(a, column(0)), turned(a, column(3)), turned(a, column(6))];
  return [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]];
}

export function dot(a: Vector3, b: Vector3): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function cross(a: Vector3, b: Vector3): Vector3 {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

/** The angle of the rotation that takes one to the other. */
export function angleBetween(a: Matrix3x3, b: Matrix3x3): number {
  const trace = a.reduce((sum, value, i) => sum + value * b[i as 0], 0);
  return Math.acos(Math.min(Math.max((trace - 1) / 2, -1), 1));
}

/** The same direction at length 1; what has none stays. */
export function normalised([x, y, z]: Vector3): Vector3 {
  const length = Math.hypot(x, y, z) || 1;
  return [x / length, y / length, z / length];
}

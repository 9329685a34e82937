/**
 * Reads a transfer file: an object with its precomputed radiance transfer.
 *
 * The format is `docs/transfer.md`; `deeplight transfer` writes it. Frame of the object: +Y is up, it stands on
 * y = 0, its longest side is 1. Harmonics have the order and signs of `Lighting.harmonics`.
 */
import { crc32, TRANSFER } from "deeplight/core";

/** A file that is no transfer, or a damaged one; the message is for people. */
export class TransferError extends Error {}

export interface GlossyTransfer {
  readonly reflectivity: number;
  /** GGX alpha. */
  readonly roughness: number;
  readonly clusters: number;
  /** Matrices of a cluster besides its mean. */
  readonly components: number;
  /** Of each vertex. */
  readonly cluster: Uint8Array;
  /** vertex, component */
  readonly weights: Float32Array;
  /** cluster, part (the mean, then the components), leaving, arriving */
  readonly matrices: Float32Array;
}

export interface GroundTransfer {
  /** Points along a side. */
  readonly size: number;
  /** From the middle to the edge. */
  readonly half: number;
  readonly reflectivity: number;
  /** point, coefficient: irradiance over pi with the object there */
  readonly transfer: Float32Array;
}

export interface Transfer {
  readonly order: number;
  readonly bounces: number;
  /** x, y, z of each vertex. */
  readonly positions: Float32Array;
  readonly normals: Float32Array;
  readonly triangles: Uint16Array | Uint32Array;
  /** Of the diffuse finish, linear RGB; unused where there are colours. */
  readonly reflectivity: readonly [number, number, number];
  /** Of the diffuse finish at each vertex, gamma-encoded. */
  readonly colours: Uint8Array | null;
  /** vertex, coefficient: what leaves each vertex per unit of reflectivity */
  readonly diffuse: Float32Array;
  readonly glossy: GlossyTransfer | null;
  readonly ground: GroundTransfer | null;
}

const FLAGS = TRANSFER.flags;
const MOST = TRANSFER.most;
const WIDE = TRANSFER.wide_columns; // those of a table that have 16 bits
const HEADER_BYTES = TRANSFER.header_bytes;

/** @throws TransferError */
export function parseTransfer(buffer: ArrayBuffer): Transfer {
  const header = readHeader(buffer);
  const { order, vertices, triangles, coefficients, flags } = header;
  const cursor = new Cursor(buffer);
  const positions = unpackPositions(new Uint16Array(cursor.take(6 * vertices)), header);
  const normals = unpackNormals(new Int16Array(cursor.take(4 * vertices)));
  const index = cursor.take(3 * triangles * (vertices <= 65_536 ? 2 : 4));
  const corners = vertices <= 65_536 ? new Uint16Array(index) : new Uint32Array(index);
  if (corners.some((corner) => corner >= vertices))
    throw damaged("names vertices that it does not have");
  const colours = flags & FLAGS.colours ? new Uint8Array(cursor.take(3 * vertices)) : null;
  const diffuse = takeTable(cursor, vertices, coefficients);
  const glossy = flags & FLAGS.glossy ? takeGlossy(cursor, header) : null;
  const ground = flags & FLAGS.ground ? takeGround(cursor, header) : null;
  const { bounces, reflectivity } = header;
  return {
    order,
    bounces,
    positions,
    normals,
    triangles: corners,
    reflectivity,
    colours,
    diffuse,
    glossy,
    ground,
  };
}

interface Header {
  readonly flags: number;
  readonly order: number;
  readonly coefficients: number;
  readonly bounces: number;
  readonly clusters: number;
  readonly components: number;
  readonly vertices: number;
  readonly triangles: number;
  readonly groundSize: number;
  readonly low: readonly number[];
  readonly high: readonly number[];
  readonly reflectivity: [number, number, number];
  readonly aboutGlossy: readonly [number, number];
  readonly aboutGround: readonly [number, number];
}

function readHeader(buffer: ArrayBuffer): Header {
  const view = new DataView(buffer);
  if (buffer.byteLength < HEADER_BYTES || view.getUint32(0, true) !== TRANSFER.magic) {
    throw new TransferError(
      "This file is no object with transfer. Make one with: deeplight transfer",
    );
  }
  const version = view.getUint16(4, true);
  if (version !== TRANSFER.version) {
    throw new TransferError(
      `This object is of version ${version}; this page reads version ${TRANSFER.version}.`,
    );
  }
  const floats = Array.from({ length: 13 }, (_, i) => view.getFloat32(32 + 4 * i, true));
  const at = (i: number) => floats[i]!;
  const order = view.getUint8(16);
  const header: Header = {
    flags: view.getUint16(6, true),
    order,
    coefficients: (order + 1) ** 2,
    bounces: view.getUint8(17),
    clusters: view.getUint8(18),
    components: view.getUint8(19),
    vertices: view.getUint32(20, true),
    triangles: view.getUint32(24, true),
    groundSize: view.getUint16(28, true),
    low: floats.slice(0, 3),
    high: floats.slice(3, 6),
    reflectivity: [at(6), at(7), at(8)],
    aboutGlossy: [at(9), at(10)],
    aboutGround: [at(11), at(12)],
  };
  if (!inRange(header) || !floats.every(isSane)) throw damaged("has numbers out of range");
  const size = expectedBytes(header);
  if (buffer.byteLength !== size || view.getUint32(8, true) !== size) {
    throw damaged(`has ${buffer.byteLength} bytes where its header says ${size}`);
  }
  if (crc32(new Uint8Array(buffer, TRANSFER.checked_from)) !== view.getUint32(12, true)) {
    throw damaged("has another checksum than its own");
  }
  return header;
}

function inRange(header: Header): boolean {
  const { flags, order, vertices, triangles, groundSize, clusters, components } = header;
  return (
    flags < 8 &&
    Math.min(order, vertices, triangles) >= 1 &&
    order <= MOST.order &&
    vertices <= MOST.vertices &&
    triangles <= MOST.triangles &&
    groundSize <= MOST.ground &&
    clusters <= MOST.clusters &&
    (!(flags & FLAGS.glossy) || Math.min(clusters, components) >= 1) &&
    (!(flags & FLAGS.ground) || groundSize >= 2)
  );
}

function expectedBytes(header: Header): number {
  const { flags, coefficients, vertices, triangles, groundSize, clusters, components } = header;
  const matrices = clusters * (components + 1);
  const parts = [6 * vertices, 4 * vertices, 3 * triangles * (vertices <= 65_536 ? 2 : 4)];
  if (flags & FLAGS.colours) parts.push(3 * vertices);
  parts.push(tableBytes(vertices, coefficients));
  if (flags & FLAGS.glossy) {
    parts.push(vertices, tableBytes(vertices, components), matrices * (4 + coefficients ** 2));
  }
  if (flags & FLAGS.ground) parts.push(tableBytes(groundSize ** 2, coefficients));
  return parts.reduce((sum, bytes) => sum + filled(bytes), HEADER_BYTES);
}

/** NaN is not. */
const isSane = (value: number) => Math.abs(value) <= MOST.number;

const filled = (bytes: number) => Math.ceil(bytes / 4) * 4;

function tableBytes(rows: number, columns: number): number {
  const wide = Math.min(WIDE, columns);
  return 8 * columns + rows * (columns + wide);
}

/** Gives the file's sections one after the other. */
class Cursor {
  private at = HEADER_BYTES;
  constructor(private readonly buffer: ArrayBuffer) {}

  take(bytes: number): ArrayBuffer {
    const part = this.buffer.slice(this.at, this.at + bytes);
    this.at += filled(bytes);
    return part;
  }
}

function unpackPositions(steps: Uint16Array, { low, high }: Header): Float32Array {
  return Float32Array.from(steps, (step, i) => {
    const first = low[i % 3]!;
    return first + (step * (high[i % 3]! - first)) / 65_535;
  });
}

/** Two numbers each: an octahedron unfolded onto a square. */
function unpackNormals(square: Int16Array): Float32Array {
  const normals = new Float32Array((square.length / 2) * 3);
  for (let i = 0; i < square.length / 2; i++) {
    let x = Math.max(square[2 * i]! / 32_767, -1);
    let y = Math.max(square[2 * i + 1]! / 32_767, -1);
    const z = 1 - Math.abs(x) - Math.abs(y);
    if (z < 0) {
      const unfolded = (1 - Math.abs(y)) * (x >= 0 ? 1 : -1);
      y = (1 - Math.abs(x)) * (y >= 0 ? 1 : -1);
      x = unfolded;
    }
    const length = Math.hypot(x, y, z);
    normals.set([x / length, y / length, z / length], 3 * i);
  }
  return normals;
}

/** Numbers in even steps from each column's least: row after row, as they are used. */
function takeTable(cursor: Cursor, rows: number, columns: number): Float32Array {
  const wide = Math.min(WIDE, columns);
  const part = cursor.take(tableBytes(rows, columns));
  const scales = new Float32Array(part, 0, 2 * columns);
  if (!scales.every(isSane)) throw damaged("has numbers out of range");
  const first = new Uint16Array(part, 8 * columns, rows * wide);
  const rest = new Uint8Array(part, 8 * columns + 2 * rows * wide);
  const table = new Float32Array(rows * columns);
  for (let column = 0; column < columns; column++) {
    const [low, step] = [scales[2 * column]!, scales[2 * column + 1]!];
    const numbers = column < wide ? first : rest;
    const begin = rows * (column < wide ? column : column - wide);
    for (let row = 0; row < rows; row++)
      table[row * columns + column] = low + numbers[begin + row]! * step;
  }
  return table;
}

function takeGlossy(cursor: Cursor, header: Header): GlossyTransfer {
  const { vertices, coefficients, clusters, components } = header;
  const cluster = new Uint8Array(cursor.take(vertices));
  if (cluster.some((number) => number >= clusters))
    throw damaged("names a cluster that it does not have");
  const weights = takeTable(cursor, vertices, components);
  const count = clusters * (components + 1);
  const each = coefficients ** 2;
  const part = cursor.take(count * (4 + each));
  const scales = new Float32Array(part, 0, count);
  if (!scales.every(isSane)) throw damaged("has numbers out of range");
  const matrices = Float32Array.from(new Int8Array(part, 4 * count), (step, i) => {
    return step * scales[Math.floor(i / each)]!;
  });
  const [reflectivity, roughness] = header.aboutGlossy;
  return { reflectivity, roughness, clusters, components, cluster, weights, matrices };
}

function takeGround(cursor: Cursor, header: Header): GroundTransfer {
  const [half, reflectivity] = header.aboutGround;
  const size = header.groundSize;
  return { size, half, reflectivity, transfer: takeTable(cursor, size ** 2, header.coefficients) };
}

function damaged(how: string): TransferError {
  return new TransferError(`This object's file is damaged: it ${how}. Load it again.`);
}

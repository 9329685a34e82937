/** One mesh of a Draco-compressed .glb, by Google's decoder. */

/** What is used of the decoder's module. */
export interface Draco {
  readonly Decoder: new () => DracoDecoder;
  readonly Mesh: new () => DracoMesh;
  readonly TRIANGULAR_MESH: number;
  readonly HEAPF32: Float32Array;
  _malloc(bytes: number): number;
  _free(pointer: number): void;
  destroy(it: object): void;
}

/** Starts Google's decoder; its module waits like a promise, which a promise would wait for in vain. */
export function startedDraco(
  create: (options: object) => unknown,
  wasmBinary: ArrayBufferLike | Uint8Array,
): Promise<Draco> {
  return new Promise((done, failed) => {
    const onModuleLoaded = (module: Draco & { then?: unknown }): void => {
      delete module.then;
      done(module);
    };
    create({ wasmBinary, onModuleLoaded, onAbort: failed });
  });
}

interface DracoDecoder {
  GetEncodedGeometryType(bytes: Int8Array): number;
  DecodeArrayToMesh(bytes: Int8Array, length: number, into: DracoMesh): DracoStatus;
  GetAttributeByUniqueId(mesh: DracoMesh, id: number): DracoAttribute;
  GetAttributeDataArrayForAllPoints(
    mesh: DracoMesh,
    attribute: DracoAttribute,
    type: number,
    bytes: number,
    pointer: number,
  ): boolean;
  GetTrianglesUInt32Array(mesh: DracoMesh, bytes: number, pointer: number): boolean;
}

interface DracoMesh {
  readonly ptr: number;
  num_faces(): number;
  num_points(): number;
}

interface DracoStatus {
  ok(): boolean;
  error_msg(): string;
}

interface DracoAttribute {
  readonly ptr: number;
  num_components(): number;
}

/** Draco's names of the types that glTF allows. */
const TYPES = {
  Float32Array: [Float32Array, "DT_FLOAT32"],
  Int8Array: [Int8Array, "DT_INT8"],
  Int16Array: [Int16Array, "DT_INT16"],
  Uint8Array: [Uint8Array, "DT_UINT8"],
  Uint16Array: [Uint16Array, "DT_UINT16"],
  Uint32Array: [Uint32Array, "DT_UINT32"],
} as const;

export type NumberType = keyof typeof TYPES;
type Numbers = Float32Array | Int8Array | Int16Array | Uint8Array | Uint16Array | Uint32Array;

/** Which attributes a mesh has: Draco's number and glTF's type of each. */
export type Wanted = Readonly<Record<string, { readonly id: number; readonly type: NumberType }>>;

export interface Decoded {
  readonly index: Uint32Array;
  readonly attributes: Readonly<Record<string, { array: Numbers; itemSize: number }>>;
}

/** @throws Error where the bytes are no mesh with these attributes. */
export function decodeMesh(draco: Draco, bytes: Int8Array, wanted: Wanted): Decoded {
  const [decoder, mesh] = [new draco.Decoder(), new draco.Mesh()];
  try {
    if (decoder.GetEncodedGeometryType(bytes) !== draco.TRIANGULAR_MESH) {
      throw new Error("expected triangles in Draco's data");
    }
    const status = decoder.DecodeArrayToMesh(bytes, bytes.byteLength, mesh);
    if (!status.ok() || mesh.ptr === 0) throw new Error(`Draco: ${status.error_msg()}`);
    const attributes = Object.entries(wanted).map(([name, { id, type }]) => {
      const attribute = decoder.GetAttributeByUniqueId(mesh, id);
      if (!attribute.ptr) throw new Error(`expected the attribute ${name} in Draco's data`);
      const [Type, kind] = TYPES[type];
      const itemSize = attribute.num_components();
      const count = mesh.num_points() * itemSize;
      const array = filled<Numbers>(
        draco,
        Type as unknown as TypeOf<Numbers>,
        count,
        (size, pointer) => {
          const number = (draco as unknown as Record<string, number>)[kind]!;
          decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, number, size, pointer);
        },
      );
      return [name, { array, itemSize }] as const;
    });
    const index = filled(draco, Uint32Array, 3 * mesh.num_faces(), (size, pointer) => {
      decoder.GetTrianglesUInt32Array(mesh, size, pointer);
    });
    return { index, attributes: Object.fromEntries(attributes) };
  } finally {
    draco.destroy(mesh);
    draco.destroy(decoder);
  }
}

type TypeOf<T> = {
  new (buffer: ArrayBufferLike, offset: number, length: number): T;
  readonly BYTES_PER_ELEMENT: number;
};

/** A copy of what the decoder writes into its own memory. */
function filled<T extends Numbers>(
  draco: Draco,
  Type: TypeOf<T>,
  count: number,
  write: (bytes: number, pointer: number) => void,
): T {
  const bytes = count * Type.BYTES_PER_ELEMENT;
  const pointer = draco._malloc(bytes);
  try {
    write(bytes, pointer);
    // The memory may have moved when it grew, so it is looked up only now.
    return new Type(draco.HEAPF32.buffer, pointer, count).slice() as T;
  } finally {
    draco._free(pointer);
  }
}

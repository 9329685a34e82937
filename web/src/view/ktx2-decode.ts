/** One KTX2 texture of a .glb, by Basis Universal's transcoder: always to plain pixels, which every graphics card takes. */

/** What is used of the transcoder's module. */
export interface Basis {
  readonly KTX2File: new (bytes: Uint8Array) => Ktx2File;
  readonly initializeBasis: () => void;
}

interface Ktx2File {
  isValid(): boolean;
  isUASTC(): boolean;
  isETC1S(): boolean;
  getWidth(): number;
  getHeight(): number;
  startTranscoding(): boolean;
  getImageTranscodedSizeInBytes(level: number, layer: number, face: number, to: number): number;
  transcodeImage(
    into: Uint8Array,
    level: number,
    layer: number,
    face: number,
    to: number,
    ...flags: readonly [number, number, number]
  ): number;
  close(): void;
  delete(): void;
}

export interface DecodedImage {
  /** RGBA, row after row from the top. */
  readonly pixels: Uint8ClampedArray<ArrayBuffer>;
  readonly width: number;
  readonly height: number;
}

/** The transcoder's number of RGBA with 8 bits each. */
const RGBA32 = 13;
/** No graphics card of a phone takes more. */
const LARGEST = 8192;

type Create = (options: object) => Promise<Basis>;

export async function startedBasis(
  create: Create,
  wasmBinary: ArrayBuffer | Uint8Array,
): Promise<Basis> {
  const basis = await create({ wasmBinary });
  basis.initializeBasis();
  return basis;
}

/** The largest level of a texture. @throws RangeError where it is none that glTF allows. */
export function decodeTexture({ KTX2File }: Basis, bytes: Uint8Array): DecodedImage {
  const file = new KTX2File(bytes);
  try {
    if (!file.isValid() || !(file.isUASTC() || file.isETC1S())) {
      throw new RangeError("expected a KTX2 texture of ETC1S or UASTC");
    }
    const [width, height] = [file.getWidth(), file.getHeight()];
    if (Math.max(width, height) > LARGEST) throw new RangeError(`${width} x ${height} pixels`);
    if (!file.startTranscoding()) throw new RangeError("a damaged KTX2 texture");
    const size = file.getImageTranscodedSizeInBytes(0, 0, 0, RGBA32);
    const pixels = new Uint8Array(size);
    const is =
      size === 4 * width * height && file.transcodeImage(pixels, 0, 0, 0, RGBA32, 0, -1, -1);
    if (!is) throw new RangeError("a damaged KTX2 texture");
    return { pixels: new Uint8ClampedArray(pixels.buffer), width, height };
  } finally {
    file.close();
    file.delete();
  }
}

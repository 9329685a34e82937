import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { beforeAll, describe, expect, test } from "vitest";
import { type Draco, decodeMesh, startedDraco } from "./draco-decode.ts";
import { extensionsOf } from "./packed.ts";

const require = createRequire(import.meta.url);

// A bent strip of triangles, numbers that no other mesh has.
const POSITIONS = Float32Array.from({ length: 30 }, (_, i) => Math.sin(7 * i) + (i % 3));
const FACES = Uint32Array.from({ length: 24 }, (_, i) => Math.floor(i / 3) + (i % 3));

/** The strip, packed by Draco's own encoder; the number of its positions. */
async function packed(): Promise<{ bytes: Int8Array; id: number }> {
  const encoding = await require("draco3dgltf").createEncoderModule({});
  const [builder, mesh, encoder] = [
    new encoding.MeshBuilder(),
    new encoding.Mesh(),
    new encoding.Encoder(),
  ];
  builder.AddFacesToMesh(mesh, FACES.length / 3, FACES);
  const id = builder.AddFloatAttributeToMesh(mesh, encoding.POSITION, 10, 3, POSITIONS);
  encoder.SetEncodingMethod(encoding.MESH_SEQUENTIAL_ENCODING); // keeps the order
  encoder.SetAttributeQuantization(encoding.POSITION, 16);
  const into = new encoding.DracoInt8Array();
  const length = encoder.EncodeMeshToDracoBuffer(mesh, into);
  const bytes = Int8Array.from({ length }, (_, i) => into.GetValue(i));
  return { bytes, id };
}

describe("a .glb packed by Draco", () => {
  let draco: Draco;
  let strip: Awaited<ReturnType<typeof packed>>;

  beforeAll(async () => {
    const wasmBinary = await readFile(require.resolve("draco3dgltf/draco_decoder_gltf.wasm"));
    draco = await startedDraco(require("draco3dgltf/draco_decoder_gltf_nodejs.js"), wasmBinary);
    strip = await packed();
  });

  test("comes back with its triangles and its positions", () => {
    const wanted = { position: { id: strip.id, type: "Float32Array" } } as const;
    const { index, attributes } = decodeMesh(draco, strip.bytes, wanted);
    expect(index).toEqual(FACES);
    const { array, itemSize } = attributes.position!;
    expect(itemSize).toBe(3);
    const off = array.map((value, i) => Math.abs(value - POSITIONS[i]!));
    expect(Math.max(...off)).toBeLessThan(1e-4);
  });

  test("that is cut, or has no such attribute, is refused", () => {
    const wanted = { position: { id: strip.id, type: "Float32Array" } } as const;
    expect(() => decodeMesh(draco, strip.bytes.slice(0, 30), wanted)).toThrow(/Draco/);
    const other = { normal: { id: 77, type: "Float32Array" } } as const;
    expect(() => decodeMesh(draco, strip.bytes, other)).toThrow(/normal/);
  });
});

describe("what a .glb says of its packing", () => {
  const glb = (text: string): ArrayBuffer => {
    const json = new TextEncoder().encode(text);
    const file = new Uint8Array(20 + json.length);
    new DataView(file.buffer).setUint32(12, json.length, true);
    file.set(new TextEncoder().encode("JSON"), 16);
    file.set(json, 20);
    return file.buffer;
  };

  test("is read from its header, whatever else it holds", () => {
    expect(extensionsOf(glb('{"extensionsUsed":["A",3,"B"]}'))).toEqual(["A", "B"]);
    expect(extensionsOf(glb("{}"))).toEqual([]);
  });

  test.each([["{"], ["null"], ['{"extensionsUsed":3}']])("%s names nothing", (text) => {
    expect(extensionsOf(glb(text))).toEqual([]);
    expect(extensionsOf(new ArrayBuffer(3))).toEqual([]);
  });
});

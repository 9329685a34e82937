import { pixelFromRadiance, REFLECTIVITY } from "deeplight/core";
import { BufferAttribute, BufferGeometry, Matrix4, MeshStandardMaterial } from "three";
import { beforeAll, describe, expect, test } from "vitest";
import { bytes, floats, golden } from "../../tests/golden.ts";
import { parseTransfer, sentByAll, type Transfer } from "../transfer/index.ts";
import type { Part } from "../view/exhibit.ts";
import { standardMaterial } from "../view/material.ts";
import { cornersOf } from "./atlas.ts";
import { type Painted, paint } from "./bake.ts";
import { sceneFiles } from "./scene-files.ts";
import { surfaceOf } from "./surface.ts";
import { usdzOf } from "./usdz.ts";

const stored = golden("transfer");
const light = floats(stored.light);
let transfer: Transfer;
let geometry: BufferGeometry;

beforeAll(() => {
  transfer = parseTransfer(bytes(stored.file).buffer as ArrayBuffer);
  geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(transfer.positions, 3));
  geometry.setAttribute("normal", new BufferAttribute(transfer.normals, 3));
  geometry.setIndex(new BufferAttribute(transfer.triangles, 1));
});

function partOf(material: MeshStandardMaterial, lit = light): Part {
  return { geometry, matrix: new Matrix4(), material, sent: sentByAll(transfer, lit) };
}

const painting = (material: MeshStandardMaterial, lit?: Float32Array): Painted | null => {
  const part = partOf(material, lit);
  return paint(part, surfaceOf(geometry, material));
};

describe("light painted on an object", () => {
  /** Mean difference from the pixels that the page draws at the vertices, in steps of 255. */
  function off({ atlas, pixels }: Painted, lit: Float32Array): number {
    const sent = sentByAll(transfer, lit);
    let sum = 0;
    for (let triangle = 0; triangle < atlas.triangles; triangle++) {
      cornersOf(atlas, triangle).forEach(([column, row], corner) => {
        const vertex = transfer.triangles[3 * triangle + corner]!;
        for (let c = 0; c < 3; c++) {
          const drawn = 255 * pixelFromRadiance(REFLECTIVITY.diffuse * sent[3 * vertex + c]!);
          sum += Math.abs(pixels[4 * (row * atlas.size + column) + c]! - drawn);
        }
      });
    }
    return sum / (9 * atlas.triangles);
  }

  test("is what the page draws there; light from the other side is not", () => {
    const made = painting(standardMaterial("diffuse"))!;
    expect(off(made, light)).toBeLessThan(0.5);
    const mirrored = light.map((value, i) => (Math.floor(i / 3) === 3 ? -value : value)); // x -> -x
    expect(off(painting(standardMaterial("diffuse"), mirrored)!, light)).toBeGreaterThan(3);
  });

  test("stays where its triangle lies", () => {
    const { geometry: made, atlas } = painting(standardMaterial("diffuse"))!;
    expect(made.index).toBeNull();
    expect(made.attributes.position!.count).toBe(3 * atlas.triangles);
    const corner = 3 * (atlas.triangles - 1) + 1;
    const vertex = transfer.triangles[corner]!;
    expect(made.attributes.position!.getX(corner)).toBe(transfer.positions[3 * vertex]);
    expect(made.attributes.uv!.count).toBe(3 * atlas.triangles);
  });

  test("is not what a metal or glass shows", () => {
    expect(painting(standardMaterial("mirror"))).toBeNull();
    expect(painting(standardMaterial("silver"))).toBeNull();
    expect(painting(new MeshStandardMaterial({ transparent: true, opacity: 0.4 }))).toBeNull();
  });

  test("adds to what the object emits by itself", () => {
    const glowing = new MeshStandardMaterial({ color: 0, emissive: 0xffffff, metalness: 0 });
    const { atlas, pixels } = painting(glowing)!;
    const [[column, row]] = cornersOf(atlas, 0) as [[number, number]];
    const white = Math.round(255 * pixelFromRadiance(1));
    expect(pixels[4 * (row * atlas.size + column)]).toBe(white);
  });
});

/** The files of a zip by their entries: name, way of packing, where the content begins. */
function entries(zip: Uint8Array) {
  const view = new DataView(zip.buffer, zip.byteOffset);
  const found = [];
  for (let at = 0; view.getUint32(at, true) === 0x04034b50; ) {
    const [name, extra] = [view.getUint16(at + 26, true), view.getUint16(at + 28, true)];
    const begin = at + 30 + name + extra;
    const length = view.getUint32(at + 18, true);
    const text = new TextDecoder().decode(zip.subarray(at + 30, at + 30 + name));
    found.push({ text, packing: view.getUint16(at + 8, true), begin, length });
    at = begin + length;
  }
  return found;
}

test("a USDZ file is a zip without packing whose files begin at multiples of 64 bytes", async () => {
  const stand = { turnRad: 0.7, sizeM: 0.25 };
  const zip = await usdzOf([partOf(standardMaterial("mirror"))], stand);
  const files = entries(zip);
  expect(files[0]!.text).toBe("model.usda"); // the first one is the model
  expect(files.length).toBeGreaterThan(1);
  for (const { packing, begin } of files) expect([packing, begin % 64]).toEqual([0, 0]);
  const [{ begin, length }] = files as [(typeof files)[0]];
  const text = new TextDecoder().decode(zip.subarray(begin, begin + length));
  expect(text).toMatch(/metersPerUnit = 1\b/);
  expect(text).toMatch(/upAxis = "Y"/);
  const turned = /Xform "Object[\s\S]*?transform = \( \(([^,]+), [^,]+, ([^,]+),/.exec(text)!;
  expect(Number(turned[1])).toBeCloseTo(0.25 * Math.cos(0.7), 6);
  expect(Number(turned[2])).toBeCloseTo(-0.25 * Math.sin(0.7), 6); // rows are columns in USD
});

test("Scene Viewer's files hold the object's triangles and each finish", () => {
  const files = sceneFiles("thing", transfer);
  expect([...files.keys()]).toEqual([
    "thing.bin",
    ...["diffuse", "silver", "mirror", "glossy"].map((finish) => `thing-${finish}.gltf`),
  ]);
  const gltf = JSON.parse(new TextDecoder().decode(files.get("thing-mirror.gltf")));
  const bin = files.get("thing.bin")!;
  expect(gltf.buffers).toEqual([{ uri: "thing.bin", byteLength: bin.length }]);
  const [positions, , corners] = gltf.bufferViews.map(
    ({ byteOffset, byteLength }: { byteOffset: number; byteLength: number }) =>
      bin.slice(byteOffset, byteOffset + byteLength).buffer,
  );
  expect(new Float32Array(positions)).toEqual(transfer.positions);
  expect(gltf.accessors[2].count).toBe(transfer.triangles.length);
  expect(new (transfer.triangles.constructor as Uint16ArrayConstructor)(corners)).toEqual(
    transfer.triangles,
  );
  expect(gltf.materials[0].pbrMetallicRoughness).toMatchObject({
    metallicFactor: 1,
    roughnessFactor: 0,
  });
  const [low, high] = [gltf.accessors[0].min, gltf.accessors[0].max];
  expect(high[1] - low[1]).toBeGreaterThan(0);
});

/** Objects packed by Draco and meshopt open in the built page, by decoders of its own. */
import { createRequire } from "node:module";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { launch, untilLit, visit } from "./browser.ts";
import { type Site, serve } from "./python.ts";

const require = createRequire(import.meta.url);
let site: Site;
let browser: Browser;

beforeAll(async () => {
  [site, browser] = await Promise.all([serve(), launch()]);
});
afterAll(async () => {
  await browser?.close();
  await site?.stop();
});

// A pyramid.
const POSITIONS = new Float32Array([-1, 0, -1, 1, 0, -1, 1, 0, 1, -1, 0, 1, 0, 1.5, 0]);
const FACES = new Uint32Array([0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4, 0, 2, 1, 0, 3, 2]);

async function draco(): Promise<Buffer> {
  const draco = await require("draco3dgltf").createEncoderModule({});
  const [builder, mesh, encoder] = [new draco.MeshBuilder(), new draco.Mesh(), new draco.Encoder()];
  builder.AddFacesToMesh(mesh, FACES.length / 3, FACES);
  const id = builder.AddFloatAttributeToMesh(mesh, draco.POSITION, 5, 3, POSITIONS);
  const into = new draco.DracoInt8Array();
  const length = encoder.EncodeMeshToDracoBuffer(mesh, into);
  const bytes = Buffer.from(Array.from({ length }, (_, i) => into.GetValue(i) & 255));
  const name = "KHR_draco_mesh_compression";
  const primitive = {
    attributes: { POSITION: 0 },
    indices: 1,
    extensions: { [name]: { bufferView: 0, attributes: { POSITION: id } } },
  };
  const accessors = [
    { componentType: 5126, count: 5, type: "VEC3", min: [-1, 0, -1], max: [1, 1.5, 1] },
    { componentType: 5125, count: FACES.length, type: "SCALAR" },
  ];
  return glb(bytes, [name], primitive, accessors, [{ buffer: 0, byteLength: bytes.length }]);
}

async function meshopt(): Promise<Buffer> {
  const { MeshoptEncoder } = await import("meshoptimizer");
  await MeshoptEncoder.ready;
  const name = "EXT_meshopt_compression";
  const raw = (numbers: Float32Array | Uint32Array) => new Uint8Array(numbers.buffer);
  const parts = [
    { numbers: raw(POSITIONS), byteStride: 12, count: 5, mode: "ATTRIBUTES" },
    { numbers: raw(FACES), byteStride: 4, count: FACES.length, mode: "TRIANGLES" },
  ] as const;
  const views: object[] = [];
  const packed: Buffer[] = [];
  let [at, whole] = [0, 0];
  for (const { numbers, byteStride, count, mode } of parts) {
    const bytes = Buffer.from(MeshoptEncoder.encodeGltfBuffer(numbers, count, byteStride, mode));
    const extension = {
      buffer: 0,
      byteOffset: at,
      byteLength: bytes.length,
      byteStride,
      count,
      mode,
    };
    const { length } = numbers;
    const stride = mode === "ATTRIBUTES" ? { byteStride } : {};
    const view = { buffer: 1, byteOffset: whole, byteLength: length, ...stride };
    views.push({ ...view, extensions: { [name]: extension } });
    packed.push(bytes, Buffer.alloc((4 - (bytes.length % 4)) % 4));
    at = Buffer.concat(packed).length;
    whole += length;
  }
  const accessors = [
    {
      bufferView: 0,
      componentType: 5126,
      count: 5,
      type: "VEC3",
      min: [-1, 0, -1],
      max: [1, 1.5, 1],
    },
    { bufferView: 1, componentType: 5125, count: FACES.length, type: "SCALAR" },
  ];
  const fallback = { byteLength: whole, extensions: { [name]: { fallback: true } } };
  const primitive = { attributes: { POSITION: 0 }, indices: 1 };
  return glb(Buffer.concat(packed), [name], primitive, accessors, views, [fallback]);
}

function plain(): Buffer {
  const bytes = Buffer.concat([Buffer.from(POSITIONS.buffer), Buffer.from(FACES.buffer)]);
  const cut = POSITIONS.byteLength;
  const accessors = [
    {
      bufferView: 0,
      componentType: 5126,
      count: 5,
      type: "VEC3",
      min: [-1, 0, -1],
      max: [1, 1.5, 1],
    },
    { bufferView: 1, componentType: 5125, count: FACES.length, type: "SCALAR" },
  ];
  const views = [
    { buffer: 0, byteLength: cut },
    { buffer: 0, byteOffset: cut, byteLength: FACES.byteLength },
  ];
  return glb(bytes, [], { attributes: { POSITION: 0 }, indices: 1 }, accessors, views);
}

function glb(
  bytes: Buffer,
  extensions: string[],
  primitive: object,
  accessors: object[],
  bufferViews: object[],
  buffers: object[] = [],
): Buffer {
  const document = {
    asset: { version: "2.0" },
    ...(extensions.length ? { extensionsUsed: extensions, extensionsRequired: extensions } : {}),
    scenes: [{ nodes: [0] }],
    scene: 0,
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [primitive] }],
    accessors,
    bufferViews,
    buffers: [{ byteLength: bytes.length }, ...buffers],
  };
  const padded = (content: Buffer, fill: number) =>
    Buffer.concat([content, Buffer.alloc((4 - (content.length % 4)) % 4, fill)]);
  const chunk = (kind: string, content: Buffer) => {
    const head = Buffer.alloc(8);
    head.writeUInt32LE(content.length, 0);
    head.write(kind, 4, "latin1");
    return Buffer.concat([head, content]);
  };
  const body = Buffer.concat([
    chunk("JSON", padded(Buffer.from(JSON.stringify(document)), 32)),
    chunk("BIN\0", padded(bytes, 0)),
  ]);
  const head = Buffer.alloc(12);
  head.write("glTF", 0, "latin1");
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + body.length, 8);
  return Buffer.concat([head, body]);
}

/** How the view looks with an object in it. */
async function shown(page: Page, name: string, buffer: Buffer): Promise<Buffer> {
  await page.setInputFiles("#model-file", { name, mimeType: "model/gltf-binary", buffer });
  const chosen = page.locator("#objects label:has(:checked)");
  await expect.poll(() => chosen.textContent()).toContain(name);
  await page.waitForTimeout(500);
  return page.locator("#view").screenshot();
}

test("Draco's and meshopt's pyramids look like the plain one; KTX2 is refused with a sentence", async () => {
  const { page, leave } = await visit(browser, site.url);
  await page.click("#examples button:first-child");
  await untilLit(page);
  const before = await page.locator("#view").screenshot();
  const expected = await shown(page, "plain.glb", plain());
  expect(expected.equals(before)).toBe(false);
  expect(await shown(page, "meshopt.glb", await meshopt())).toEqual(expected);
  const unpacked = await shown(page, "draco.glb", await draco()); // positions are rounded to 1/2047
  expect(Math.abs(unpacked.length / expected.length - 1)).toBeLessThan(0.02);
  const ktx2 = glb(Buffer.alloc(4), ["KHR_texture_basisu"], {}, [], []);
  await page.setInputFiles("#model-file", {
    name: "ktx2.glb",
    mimeType: "model/gltf-binary",
    buffer: ktx2,
  });
  await page.waitForSelector('#notice[open][data-kind="glb-packed"]');
  await leave();
});

/** Objects packed by Draco, meshopt and KTX2 open in the built page, by decoders of its own. */
import { createRequire } from "node:module";
import { encodeToKTX2 } from "ktx2-encoder";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test, vi } from "vitest";
import { launch, visit } from "./browser.ts";
import { type Pixels, pixels } from "./pictures.ts";
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
const CORNERS = { componentType: 5126, count: 5, type: "VEC3", min: [-1, 0, -1], max: [1, 1.5, 1] };
const INDICES = { componentType: 5125, count: FACES.length, type: "SCALAR" };

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
  const accessors = [CORNERS, INDICES];
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
    { bufferView: 0, ...CORNERS },
    { bufferView: 1, ...INDICES },
  ];
  const fallback = { byteLength: whole, extensions: { [name]: { fallback: true } } };
  const primitive = { attributes: { POSITION: 0 }, indices: 1 };
  return glb(Buffer.concat(packed), [name], primitive, accessors, views, [fallback]);
}

function plain(): Buffer {
  const bytes = Buffer.concat([Buffer.from(POSITIONS.buffer), Buffer.from(FACES.buffer)]);
  const cut = POSITIONS.byteLength;
  const accessors = [
    { bufferView: 0, ...CORNERS },
    { bufferView: 1, ...INDICES },
  ];
  const views = [
    { buffer: 0, byteLength: cut },
    { buffer: 0, byteOffset: cut, byteLength: FACES.byteLength },
  ];
  return glb(bytes, [], { attributes: { POSITION: 0 }, indices: 1 }, accessors, views);
}

/** The pyramid with a picture on it: as PNG, or packed. */
function textured(image: Buffer, kind: "png" | "ktx2"): Buffer {
  const corners = Float32Array.from([0, 1, 1, 1, 1, 0, 0, 0, 0.5, 0.5]);
  const parts = [POSITIONS, corners, FACES].map(({ buffer }) => Buffer.from(buffer));
  const padded = Buffer.concat([image, Buffer.alloc(-image.length & 3)]);
  const views = [...parts, padded].map(({ length }, i, all) => ({
    buffer: 0,
    byteOffset: all.slice(0, i).reduce((sum, part) => sum + part.length, 0),
    byteLength: i === parts.length ? image.length : length,
  }));
  const name = "KHR_texture_basisu";
  const isPacked = kind === "ktx2";
  const accessors = [
    { bufferView: 0, ...CORNERS },
    { bufferView: 1, componentType: 5126, count: 5, type: "VEC2" },
    { bufferView: 2, ...INDICES },
  ];
  const look = {
    images: [{ bufferView: 3, mimeType: `image/${kind}` }],
    textures: [isPacked ? { extensions: { [name]: { source: 0 } } } : { source: 0 }],
    materials: [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 }, metallicFactor: 0 } }],
  };
  const primitive = { attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2, material: 0 };
  const bytes = Buffer.concat([...parts, padded]);
  return glb(bytes, isPacked ? [name] : [], primitive, accessors, views, [], look);
}

function glb(
  bytes: Buffer,
  extensions: string[],
  primitive: object,
  accessors: object[],
  bufferViews: object[],
  buffers: object[] = [],
  look: object = {},
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
    ...look,
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

test("Draco's and meshopt's pyramids look like the plain one", async () => {
  const { page, leave } = await visit(browser, site.url);
  await page.click("#examples button:first-child");
  await page.waitForSelector("#viewer[data-light=whole]"); // or it changes between two pictures
  const before = await page.locator("#view").screenshot();
  const expected = await shown(page, "plain.glb", plain());
  expect(expected.equals(before)).toBe(false);
  expect(await shown(page, "meshopt.glb", await meshopt())).toEqual(expected);
  const unpacked = await shown(page, "draco.glb", await draco()); // positions are rounded to 1/2047
  expect(Math.abs(unpacked.length / expected.length - 1)).toBeLessThan(0.02);
  await leave();
});

test("KTX2's textures look like a PNG, by a transcoder that the content policy lets run", async () => {
  const { page, leave } = await visit(browser, site.url);
  await page.click("#examples button:first-child");
  await page.waitForSelector("#viewer[data-light=whole]"); // or it changes between two pictures
  const size = 64;
  const rgba = Uint8Array.from({ length: 4 * size * size }, (_, i) => {
    const [x, y] = [(i >> 2) % size, Math.floor((i >> 2) / size)];
    return [4 * x, 4 * y, x < y ? 220 : 30, 255][i % 4]!;
  });
  const png = await page.evaluate(
    ([numbers, side]) => {
      const canvas = Object.assign(document.createElement("canvas"), { width: side, height: side });
      const image = new ImageData(Uint8ClampedArray.from(numbers), side);
      canvas.getContext("2d")!.putImageData(image, 0, 0);
      return canvas.toDataURL("image/png").split(",")[1]!;
    },
    [[...rgba], size] as const,
  );
  const seen = async (name: string, file: Buffer) => pixels(page, await shown(page, name, file));
  const wanted = await seen("png.glb", textured(Buffer.from(png, "base64"), "png"));
  const bare = await seen("plain.glb", plain());
  const off = (a: Pixels, b: Pixels): number => {
    const [left, top, right, bottom] = [0.35, 0.55, 0.65, 0.75]; // where the object stands
    let sum = 0;
    for (let y = top; y < bottom; y += 0.01) {
      for (let x = left; x < right; x += 0.01) {
        a.at(x, y).forEach((value, c) => {
          sum += Math.abs(value - b.at(x, y)[c]!) / 3 / 600;
        });
      }
    }
    return sum;
  };
  expect(off(bare, wanted)).toBeGreaterThan(15);
  vi.spyOn(console, "log").mockImplementation(() => {}); // the encoder is talkative
  for (const isUASTC of [true, false]) {
    const imageDecoder = async () => ({ data: rgba, width: size, height: size });
    const options = { isUASTC, imageDecoder, generateMipmap: true, enableDebug: false };
    const packed = Buffer.from(await encodeToKTX2(new Uint8Array(1), options));
    const name = isUASTC ? "uastc.glb" : "etc1s.glb";
    expect(off(await seen(name, textured(packed, "ktx2")), wanted)).toBeLessThan(5);
  }
  const damaged = textured(Buffer.alloc(200, 7), "ktx2");
  const mimeType = "model/gltf-binary";
  await page.setInputFiles("#model-file", { name: "damaged.glb", mimeType, buffer: damaged });
  await page.waitForSelector('#notice[open][data-kind="glb-packed"]');
  await leave(/load texture/); // three.js says so, too
});

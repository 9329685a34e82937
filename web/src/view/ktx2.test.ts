import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import vm from "node:vm";
import { encodeToKTX2 } from "ktx2-encoder";
import { beforeAll, describe, expect, test, vi } from "vitest";
import { withoutEval } from "../../build/basis.ts";
import { type Basis, decodeTexture, startedBasis } from "./ktx2-decode.ts";

const require = createRequire(import.meta.url);
const PATH = require.resolve("three/addons/libs/basis/basis_transcoder.js");
const CODE = readFileSync(PATH, "utf8");
const WASM = readFileSync(PATH.replace(/js$/, "wasm"));

/** The transcoder where no text becomes code, as under the page's content policy. */
function started(code: string): Promise<Basis> {
  const globals = {
    WebAssembly,
    console,
    importScripts: () => {},
    self: { location: { href: "" } },
  };
  const context = vm.createContext(globals, { codeGeneration: { strings: false, wasm: true } });
  vm.runInContext(code.replace("export default BASIS;", ""), context);
  return startedBasis(vm.runInContext("BASIS", context), WASM);
}

const SIZE = 32;
/** Smooth, no channel like another, another in every corner. */
const PIXELS = Uint8Array.from({ length: 4 * SIZE * SIZE }, (_, i) => {
  const [x, y] = [(i >> 2) % SIZE, Math.floor((i >> 2) / SIZE)];
  return [8 * x, 8 * y, 255 - 4 * (x + y), 255][i % 4]!;
});

function packed(isUASTC: boolean): Promise<Uint8Array> {
  const imageDecoder = async () => ({ data: PIXELS, width: SIZE, height: SIZE });
  return encodeToKTX2(new Uint8Array(1), {
    isUASTC,
    imageDecoder,
    generateMipmap: true,
    enableDebug: false,
  });
}

test("the transcoder as it comes makes code of text, ours does not", async () => {
  await expect(started(CODE)).rejects.toThrow(/Code generation/);
  await expect(started(withoutEval(CODE))).resolves.toHaveProperty("KTX2File");
  expect(() => withoutEval(CODE.replaceAll("newFunc(", "makeFunc("))).toThrow(/another version/);
});

describe("a texture packed by Basis Universal's own encoder", () => {
  let basis: Basis;
  beforeAll(async () => {
    vi.spyOn(console, "log").mockImplementation(() => {}); // the encoder is talkative
    basis = await started(withoutEval(CODE));
  });

  const off = (pixels: Uint8ClampedArray): number =>
    pixels.reduce((sum, value, i) => sum + Math.abs(value - PIXELS[i]!), 0) / PIXELS.length;

  test.each([
    ["UASTC", true, 2],
    ["ETC1S", false, 6],
  ])("as %s comes back, upright", async (_, isUASTC, near) => {
    const { pixels, width, height } = decodeTexture(basis, await packed(isUASTC));
    expect([width, height]).toEqual([SIZE, SIZE]);
    expect(off(pixels)).toBeLessThan(near);
    const rows = Array.from({ length: SIZE }, (_, y) =>
      pixels.slice(4 * SIZE * y, 4 * SIZE * (y + 1)),
    );
    const fallen = Uint8ClampedArray.from(rows.reverse().flatMap((row) => [...row]));
    expect(off(fallen)).toBeGreaterThan(20);
  });

  test("cut or damaged is refused, and the next one is read", async () => {
    const whole = await packed(true);
    for (const length of [0, 11, 80, 200]) {
      expect(() => decodeTexture(basis, whole.slice(0, length))).toThrow(RangeError);
    }
    const damaged = whole.slice();
    damaged.fill(255, 12, 60);
    expect(() => decodeTexture(basis, damaged)).toThrow(RangeError);
    expect(decodeTexture(basis, whole).width).toBe(SIZE);
  });
});

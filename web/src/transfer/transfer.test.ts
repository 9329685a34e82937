import { crc32 } from "deeplight/core";
import { beforeEach, describe, expect, test } from "vitest";
import { bytes, floats, golden } from "../../tests/golden.ts";
import { fitting, meet, metLength, sentByAll, shadowRatios } from "./evaluate.ts";
import { parseTransfer, type Transfer, TransferError } from "./format.ts";
import { makeGroundShadow, makeTransferObject } from "./object.ts";

const stored = golden("transfer");
const light = floats(stored.light);
const coefficients = light.length / 3;
const content = () => bytes(stored.file).buffer as ArrayBuffer;
let transfer: Transfer;

beforeEach(() => {
  transfer = parseTransfer(content());
});

function largestDifference(got: ArrayLike<number>, want: ArrayLike<number>): number {
  expect(got.length).toBe(want.length);
  return Array.from(got).reduce((most, value, i) => Math.max(most, Math.abs(value - want[i]!)), 0);
}

test("positions and normals are Python's", () => {
  expect(largestDifference(transfer.positions, floats(stored.positions))).toBeLessThan(1e-6);
  expect(largestDifference(transfer.normals, floats(stored.normals))).toBeLessThan(1e-6);
});

test("what leaves the vertices is Python's, and another light's is not", () => {
  expect(largestDifference(sentByAll(transfer, light), floats(stored.diffuse))).toBeLessThan(1e-5);
  const other = light.map((value, i) => (i === 5 ? value * 1.05 : value));
  expect(largestDifference(sentByAll(transfer, other), floats(stored.diffuse))).toBeGreaterThan(
    1e-3,
  );
});

test("the ground's shadow is Python's, and a mirrored light's is not", () => {
  const ratios = (lit: Float32Array) => shadowRatios(transfer.ground!, transfer.order, lit);
  expect(largestDifference(ratios(light), floats(stored.shadow))).toBeLessThan(1e-5);
  const mirrored = light.map((value, i) => (Math.floor(i / 3) === 3 ? -value : value)); // x -> -x
  expect(largestDifference(ratios(mirrored), floats(stored.shadow))).toBeGreaterThan(0.05);
});

test("glossy matrices meet a light as in Python", () => {
  const met = new Float32Array(metLength(transfer));
  meet(transfer.glossy!, light, met);
  const rgb = met.filter((_, i) => i % 4 < 3);
  expect(largestDifference(rgb, floats(stored.met))).toBeLessThan(1e-5);
  meet(transfer.glossy!, light.toReversed(), met);
  const other = met.filter((_, i) => i % 4 < 3);
  expect(largestDifference(other, floats(stored.met))).toBeGreaterThan(1e-2);
});

test("light of another order is cut or filled up", () => {
  expect(fitting(light.subarray(0, 27), coefficients)[26]).toBe(light[26]);
  expect(fitting(light.subarray(0, 27), coefficients)[27]).toBe(0);
  expect(fitting(new Float32Array([...light, 7, 7, 7]), coefficients)).toEqual(light);
});

test("the checksum is that of zip", () => {
  expect(crc32(new TextEncoder().encode("123456789"))).toBe(0xcbf43926);
});

describe("a damaged file is reported, never read", () => {
  test("cut anywhere", () => {
    const whole = content();
    for (let length = 0; length < whole.byteLength; length += 97) {
      expect(() => parseTransfer(whole.slice(0, length))).toThrow(TransferError);
    }
    const longer = new Uint8Array(whole.byteLength + 4);
    longer.set(new Uint8Array(whole));
    expect(() => parseTransfer(longer.buffer)).toThrow(/damaged/);
  });

  test("a bit flipped anywhere", () => {
    const whole = content();
    for (let at = 0; at < whole.byteLength; at += at < 96 ? 1 : 211) {
      const flipped = new Uint8Array(whole.slice(0));
      flipped[at]! ^= 1 << (at % 8);
      expect(() => parseTransfer(flipped.buffer)).toThrow(TransferError);
    }
  });

  test("numbers out of range behind a right checksum", () => {
    const sealed = (change: (view: DataView) => void) => {
      const whole = content();
      const view = new DataView(whole);
      change(view);
      view.setUint32(12, crc32(new Uint8Array(whole, 16)), true);
      return () => parseTransfer(whole);
    };
    expect(sealed(() => {})).not.toThrow();
    expect(sealed((view) => view.setUint32(20, 2 ** 31, true))).toThrow(/out of range/);
    expect(sealed((view) => view.setFloat32(32, Number.NaN, true))).toThrow(/out of range/);
    expect(sealed((view) => view.setUint8(16, 9))).toThrow(/out of range/);
    const firstCorner =
      96 +
      Math.ceil((6 * transfer.positions.length) / 12) * 4 +
      (4 * transfer.positions.length) / 3;
    expect(sealed((view) => view.setUint16(firstCorner, 65_535, true))).toThrow(
      /vertices that it does not have/,
    );
    expect(sealed((view) => view.setUint16(4, 2, true))).toThrow(/version 2/);
  });
});

test("what three.js draws takes light, exposure and colour, and goes away", () => {
  for (const finish of ["diffuse", "glossy"] as const) {
    const object = makeTransferObject(transfer, finish);
    object.setLight(light);
    object.setExposure(2);
    object.setReflectivity(0.1, 0.2, 0.3);
    expect(object.material.uniforms.exposure!.value).toBe(2);
    expect(object.material.uniforms.tint!.value).toEqual([0.1, 0.2, 0.3]);
    object.dispose();
  }
  const shadow = makeGroundShadow(transfer);
  shadow.setLight(light);
  const ratio = shadow.geometry.getAttribute("ratio").array;
  expect(largestDifference(ratio, floats(stored.shadow))).toBeLessThan(1e-5);
  shadow.dispose();
});

test("a file without gloss or ground says so", () => {
  const bare = { ...transfer, glossy: null, ground: null };
  expect(() => makeTransferObject(bare, "glossy")).toThrow(TransferError);
  expect(() => makeGroundShadow(bare)).toThrow(TransferError);
});

/** The model as the page rewrites it, against onnxruntime's own rewriting of the same file. */
import { readFileSync } from "node:fs";
import * as ort from "onnxruntime-web/wasm";
import { describe, expect, test } from "vitest";
import { largestError } from "../../tests/golden.ts";
import { CONTRACT } from "../contract/generated.ts";
import { prepared } from "./prepared.ts";
import { fieldsOf, text } from "./protobuf.ts";

const MODEL = new URL("../../../src/deeplight/weights/deeplight.onnx", import.meta.url);
const model = new Uint8Array(readFileSync(MODEL));
const shape = [1, 3, CONTRACT.height, CONTRACT.width];
const photo = Float32Array.from(
  { length: shape.reduce((a, b) => a * b) },
  (_, i) => Math.sin(i) / 2,
);

describe("a prepared model", () => {
  test("has no weights to widen and no clipping beside a convolution", () => {
    const before = operators(model);
    const after = operators(prepared(model));
    expect(before.Cast).toBeGreaterThan(50);
    expect(after.Cast).toBeUndefined();
    expect(after.FusedConv! + (after.Clip ?? 0)).toBe(before.Clip);
    expect(after.FusedConv! + (after.Conv ?? 0)).toBe(before.Conv);
  });

  test("gives the light of the file itself, to the last bit", async () => {
    const want = await run(model, "extended"); // "all" lays out memory anew: 1e-6
    expect(largestError(await run(prepared(model), "disabled"), want)).toBe(0);
    const changed = model.slice();
    changed[firstWeights(changed) + 1]! ^= 0x40; // the exponent of one
    expect(largestError(await run(prepared(changed), "disabled"), want)).toBeGreaterThan(1e-3);
  });

  test("keeps what is not known", () => {
    const other = Buffer.from(model);
    other.write("Cost", other.indexOf("Cast"));
    expect(operators(prepared(other))).toMatchObject({ Cost: 1 });
  });

  test("is refused where the file is cut", () => {
    expect(() => prepared(model.subarray(0, 1_000_000))).toThrow(/complete ONNX/);
  });
});

async function run(file: Uint8Array, level: "extended" | "disabled"): Promise<Float32Array> {
  ort.env.wasm.numThreads = 1;
  ort.env.logLevel = "fatal";
  const session = await ort.InferenceSession.create(file, { graphOptimizationLevel: level });
  const results = await session.run({ [CONTRACT.input_name]: new ort.Tensor(photo, shape) });
  return results[CONTRACT.output_name]!.data as Float32Array;
}

/** How many nodes there are of each operator. */
function operators(file: Uint8Array): Record<string, number> {
  const counts: Record<string, number> = {};
  for (const part of inGraph(file, 1)) {
    const name = text([...fieldsOf(part)].find(({ number }) => number === 4)!.content);
    counts[name] = (counts[name] ?? 0) + 1;
  }
  return counts;
}

/** Where the numbers of the first weights with many of them start in the file. */
function firstWeights(file: Uint8Array): number {
  for (const part of inGraph(file, 5)) {
    const raw = [...fieldsOf(part)].find(({ number }) => number === 9)!.content;
    if (raw.length > 1000) return raw.byteOffset - file.byteOffset;
  }
  throw new Error("no weights");
}

function inGraph(file: Uint8Array, wanted: number): Uint8Array[] {
  const graph = [...fieldsOf(file)].find(({ number }) => number === 7)!.content;
  return [...fieldsOf(graph)].filter(({ number }) => number === wanted).map((f) => f.content);
}

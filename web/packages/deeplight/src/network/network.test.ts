/** Our own runtime against onnxruntime on the same file and on single layers; each with a failing twin. */
import { readFileSync } from "node:fs";
import * as ort from "onnxruntime-web/wasm";
import { beforeAll, describe, expect, test } from "vitest";
import { largestError } from "../../../../tests/golden.ts";
import { generated } from "../../kernels/build.mjs";
import { CONTRACT } from "../contract/generated.ts";
import { Memory } from "./memory.ts";
import { Network } from "./network.ts";
import { type Attribute, type Dense, graphOf, type Node } from "./onnx.ts";
import { OPERATORS } from "./operators.ts";
import { Program } from "./program.ts";
import { fieldsOf } from "./protobuf.ts";

const MODEL = new URL("../../../../../src/deeplight/weights/deeplight.onnx", import.meta.url);
const model = new Uint8Array(readFileSync(MODEL));
const shape = [1, 3, CONTRACT.height, CONTRACT.width];
const photo = wave(shape).data;

test("the compiled kernels are those of their source", async () => {
  const file = readFileSync(new URL("kernels.generated.ts", import.meta.url), "utf8");
  expect(file, "run npm run kernels --workspace deeplight").toBe(await generated());
}, 120_000);

describe("the shipped network", () => {
  let network: Network;
  let want: Float32Array;

  beforeAll(async () => {
    network = await Network.open(model);
    ort.env.wasm.numThreads = 1;
    const session = await ort.InferenceSession.create(model);
    const results = await session.run({ [CONTRACT.input_name]: new ort.Tensor(photo, shape) });
    want = results[CONTRACT.output_name]!.data as Float32Array;
  });

  test("gives onnxruntime's light, the first time and every time", () => {
    const [first, second] = [network.run(photo), network.run(photo)].map(
      (outputs) => outputs.get(CONTRACT.output_name)!.data,
    );
    expect(largestError(first!, want)).toBeLessThan(1e-4);
    expect(second).toEqual(first);
  });

  test("gives other light where one weight is another", async () => {
    const changed = model.slice();
    changed[firstWeights(changed) + 1]! ^= 0x40; // the exponent of one
    const other = (await Network.open(changed)).run(photo).get(CONTRACT.output_name)!;
    expect(largestError(other.data, want)).toBeGreaterThan(1e-3);
  });

  test("is refused where it is cut, and where its input has another name", async () => {
    expect(() => graphOf(model.subarray(0, 1_000_000))).toThrow(/complete ONNX/);
    const renamed = Buffer.from(model.slice());
    renamed.write("phota", renamed.indexOf('"input_name": "photo"') + 15);
    await expect(Network.open(new Uint8Array(renamed))).rejects.toThrow(/contract/);
  });
});

describe("convolutions", () => {
  test.each([
    ["1 x 1", [5, 6, 1, 1], { pads: [0, 0, 0, 0] }],
    [
      "3 x 3, every second place, uneven edges",
      [6, 6, 3, 3],
      { strides: [2, 2], pads: [0, 1, 1, 0] },
    ],
    ["3 x 3 of each channel by itself", [6, 1, 3, 3], { group: 6, pads: [1, 1, 1, 1] }],
    [
      "the same at every second place",
      [6, 1, 3, 3],
      { group: 6, strides: [2, 2], pads: [0, 1, 1, 1] },
    ],
  ] as const)(
    "%s, are the sums of their definition, clipped",
    async (_, weightShape, attributes) => {
      for (const [height, width] of [
        [7, 5],
        [12, 17],
        [3, 4],
      ] as const) {
        const [x, w] = [wave([1, 6, height, width]), wave([...weightShape])];
        const bias = wave([weightShape[0]]);
        const got = (await layer("Conv", attributes, x, w, bias)).data;
        const want = convolved(x, w, bias, attributes).map((v) => Math.min(Math.max(v, -0.5), 1));
        expect(largestError(got, want)).toBeLessThan(1e-5);
        expect(largestError(got, want.toReversed())).toBeGreaterThan(1e-2);
      }
    },
  );

  test("that are not known are refused by name", async () => {
    const kind = layer("Conv", { dilations: [2, 2] }, wave([1, 6, 9, 9]), wave([2, 6, 3, 3]));
    await expect(kind).rejects.toThrow(/Conv/);
    await expect(layer("Einsum", {}, wave([1, 6]))).rejects.toThrow(/Einsum/);
  });
});

test("a fully connected layer is the rows' products, whatever their length", async () => {
  for (const depth of [1, 6, 8, 33]) {
    const [x, w, b] = [wave([1, depth]), wave([7, depth]), wave([7])];
    const got = (await layer("Gemm", { transB: 1 }, x, w, b)).data;
    const want = Array.from(b.data, (bias, row) =>
      Math.min(
        Math.max(
          x.data.reduce((s, v, k) => s + v * w.data[row * depth + k]!, bias),
          -0.5,
        ),
        1,
      ),
    );
    expect(largestError(got, want)).toBeLessThan(1e-5);
  }
});

describe("small operators", () => {
  const x = wave([2, 3, 4]);

  test("broadcast, reduce, slice and put together as numpy does", () => {
    const column = wave([3, 1]);
    const sum = run("Add", [x, column]);
    expect(sum.shape).toEqual([2, 3, 4]);
    expect(sum.data[23]).toBeCloseTo(x.data[23]! + column.data[2]!, 6);
    const mean = run("ReduceMean", [x], { axes: [-1], keepdims: 0 });
    expect(mean.shape).toEqual([2, 3]);
    expect(mean.data[5]).toBeCloseTo(x.data.slice(20).reduce((a, b) => a + b) / 4, 6);
    const back = run("Slice", [x, list(-1), list(-9), list(2), list(-2)]);
    expect([...back.data.slice(0, 2)]).toEqual([x.data[3], x.data[1]]);
    const halves = OPERATORS.get("Split")!([x], node("Split", { axis: 2 }, 2)) as Dense[];
    expect(run("Concat", halves, { axis: -1 })).toEqual(x);
    const turned = run("Transpose", [x], { perm: [2, 0, 1] });
    expect(turned.shape).toEqual([4, 2, 3]);
    expect(turned.data[1]).toBe(x.data[4]);
    expect(run("Transpose", [turned], { perm: [1, 2, 0] })).toEqual(x);
  });

  test("multiply matrices, also many at once", () => {
    const product = run("MatMul", [x, wave([4, 5])]);
    expect(product.shape).toEqual([2, 3, 5]);
    const want = [0, 1, 2, 3].reduce(
      (s, k) => s + x.data[20 + k]! * wave([4, 5]).data[5 * k + 4]!,
      0,
    );
    expect(product.data[29]).toBeCloseTo(want, 6);
    const pairs = run("MatMul", [x, run("Transpose", [x], { perm: [0, 2, 1] })]);
    expect(pairs.data[9 + 1]).toBeCloseTo(pairs.data[9 + 3]!, 6);
  });

  test("have the values of their names", () => {
    const of = (name: string, value: number) => run(name, [list(value)]).data[0];
    expect(of("Sigmoid", 0)).toBe(0.5);
    expect(of("Softplus", -200)).toBe(0);
    expect(of("Reciprocal", 4)).toBe(0.25);
    expect(of("Asin", 1)).toBeCloseTo(Math.PI / 2, 6);
    expect(run("Softmax", [x]).data.reduce((a, b) => a + b)).toBeCloseTo(6, 5);
    expect(run("Unsqueeze", [x], { axes: [0, -1] }).shape).toEqual([1, 2, 3, 4, 1]);
    expect(run("Reshape", [x, list(0, -1)]).shape).toEqual([2, 12]);
    expect(() => run("Add", [x, wave([5])])).toThrow(/fit/);
  });
});

function run(
  operator: string,
  inputs: readonly Dense[],
  attributes: Node["attributes"] = {},
): Dense {
  return OPERATORS.get(operator)!(inputs, node(operator, attributes)) as Dense;
}

function node(operator: string, attributes: Node["attributes"], outputs = 1): Node {
  return { operator, inputs: [], outputs: Array.from({ length: outputs }, String), attributes };
}

/** One layer with clipping to -0.5 ... 1 after it. */
async function layer(
  operator: string,
  attributes: Readonly<Record<string, Attribute>>,
  x: Dense,
  ...constants: Dense[]
): Promise<Dense> {
  const names = constants.map((_, i) => `c${i}`);
  const known = new Map(names.map((name, i) => [name, constants[i]!]));
  known.set("low", list(-0.5)).set("high", list(1));
  const program = new Program(await Memory.create(), {
    nodes: [
      { operator, inputs: ["x", ...names], outputs: ["y"], attributes },
      { operator: "Clip", inputs: ["y", "low", "high"], outputs: ["z"], attributes: {} },
    ],
    constants: known,
    inputs: ["x"],
    outputs: ["z"],
  });
  return program.run({ x }).get("z")!;
}

/** Straight from the definition. */
function convolved(
  x: Dense,
  w: Dense,
  bias: Dense,
  attributes: Record<string, unknown>,
): Float32Array {
  const [, , rows, columns] = x.shape as [number, number, number, number];
  const [channels, depth, high, wide] = w.shape as [number, number, number, number];
  const {
    group = 1,
    strides = [1, 1],
    pads,
  } = attributes as { group?: number; strides?: number[]; pads: number[] };
  const [top, left, bottom, right] = pads as [number, number, number, number];
  const height = Math.floor((rows + top + bottom - high) / strides[0]!) + 1;
  const width = Math.floor((columns + left + right - wide) / strides[1]!) + 1;
  const at = (c: number, i: number, j: number) =>
    i < 0 || j < 0 || i >= rows || j >= columns ? 0 : x.data[(c * rows + i) * columns + j]!;
  return Float32Array.from({ length: channels * height * width }, (_, place) => {
    const [channel, row, column] = [
      Math.floor(place / (height * width)),
      Math.floor(place / width) % height,
      place % width,
    ];
    const first = group === 1 ? 0 : channel;
    return w.data
      .subarray(channel * depth * high * wide, (channel + 1) * depth * high * wide)
      .reduce((sum, weight, k) => {
        const [c, i, j] = [Math.floor(k / (high * wide)), Math.floor(k / wide) % high, k % wide];
        return (
          sum + weight * at(first + c, row * strides[0]! - top + i, column * strides[1]! - left + j)
        );
      }, bias.data[channel]!);
  });
}

function wave(of: readonly number[]): Dense {
  const count = of.reduce((a, b) => a * b, 1);
  return { shape: of, data: Float32Array.from({ length: count }, (_, i) => Math.sin(i * 1.7) / 2) };
}

function list(...values: number[]): Dense {
  return { shape: [values.length], data: Float32Array.from(values) };
}

/** Where the numbers of the first weights with many of them start in the file. */
function firstWeights(file: Uint8Array): number {
  const graph = [...fieldsOf(file)].find(({ number }) => number === 7)!.content;
  for (const { number, content } of fieldsOf(graph)) {
    if (number !== 5) continue;
    const raw = [...fieldsOf(content)].find((field) => field.number === 9)!.content;
    if (raw.length > 1000) return raw.byteOffset - file.byteOffset;
  }
  throw new Error("no weights");
}

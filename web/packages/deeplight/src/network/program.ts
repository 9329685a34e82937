/** A network as a list of steps, made once: layers in WebAssembly, the rest as in `operators`. */
import { EstimateError } from "../errors.ts";
import { connected, convolution, type Range } from "./convolution.ts";
import type { Memory, Planes } from "./memory.ts";
import type { Dense, Graph, Node } from "./onnx.ts";
import { OPERATORS } from "./operators.ts";
import { resized } from "./resize.ts";

type Value = Dense | Planes;

interface Step {
  readonly inputs: readonly string[];
  readonly outputs: readonly string[];
  run(inputs: readonly Value[]): readonly Value[];
  /** Of the values that are made so far those that no later step looks at. */
  readonly done: string[];
}

const NO_LIMITS: Range = { low: Number.NEGATIVE_INFINITY, high: Number.POSITIVE_INFINITY };

export class Program {
  readonly #constants: Map<string, Value>;
  readonly #steps: Step[] = [];

  /** @throws EstimateError `model-damaged` with the operator that is not known. */
  constructor(
    private readonly memory: Memory,
    private readonly graph: Graph,
  ) {
    const constants = new Map(graph.constants);
    const uses = usesOf(graph);
    const taken = new Set<Node>(); // clipping that is done inside a layer
    for (const node of graph.nodes) {
      if (taken.has(node)) continue;
      if (node.inputs.every((name) => name === "" || constants.has(name))) {
        folded(node, constants);
      } else {
        this.#steps.push(this.#step(node, constants, uses, taken));
      }
    }
    this.#constants = constants;
    this.#release();
  }

  /** All outputs by name. */
  run(inputs: Readonly<Record<string, Dense>>): Map<string, Dense> {
    const values = new Map<string, Value>(this.#constants);
    for (const [name, value] of Object.entries(inputs)) values.set(name, value);
    for (const step of this.#steps) {
      const made = step.run(step.inputs.map((name) => values.get(name)!));
      step.outputs.forEach((name, i) => {
        values.set(name, made[i]!);
      });
      for (const name of step.done) this.#forget(values, name);
    }
    const results = this.graph.outputs.map((name) => [name, this.#dense(values.get(name)!)]);
    for (const name of this.graph.outputs) this.#forget(values, name);
    return new Map(results as [string, Dense][]);
  }

  #step(
    node: Node,
    constants: ReadonlyMap<string, Dense>,
    uses: ReadonlyMap<string, Node[]>,
    taken: Set<Node>,
  ): Step {
    const [x, w, b] = node.inputs;
    const weights = constants.get(w ?? "");
    const bias = constants.get(b ?? "");
    const isLayer = weights && (!b || bias);
    if (node.operator === "Conv" && isLayer) {
      const { range, output } = clippedAfter(node, constants, uses, taken);
      const layer = asked(node, () => convolution(this.memory, node, weights, bias, range));
      return step([x!], [output], ([planes]) => [layer(this.#planes(planes!))]);
    }
    if (node.operator === "Gemm" && isLayer && isPlain(node)) {
      const { range, output } = clippedAfter(node, constants, uses, taken);
      const layer = connected(this.memory, weights, bias, range);
      return step([x!], [output], ([vector]) => [layer(this.#dense(vector!))]);
    }
    if (node.operator === "Resize") {
      const scales = constants.get(node.inputs[2] ?? "");
      const resize = asked(node, () => resized(node, scales));
      return step([x!], node.outputs, ([value]) => [resize(this.#dense(value!))]);
    }
    return this.#general(node);
  }

  #general(node: Node): Step {
    const operator = OPERATORS.get(node.operator);
    if (!operator) throw unknown(node, "");
    const inputs = node.inputs.filter((name) => name !== "");
    return step(inputs, node.outputs, (values) => {
      const [a, b] = values;
      if (node.operator === "Add" && isPlanes(a!) && isPlanes(b!) && isAlike(a, b)) {
        return [this.#sum(a, b)];
      }
      const made = operator(
        values.map((value) => this.#dense(value)),
        node,
      );
      return "data" in made ? [made] : made;
    });
  }

  #sum(a: Planes, b: Planes): Planes {
    const [, channels, height, width] = a.shape;
    const out = this.memory.planes(channels, height, width);
    this.memory.kernels.sum(a.at, b.at, out.at, channels * a.pitch);
    return out;
  }

  #dense(value: Value): Dense {
    if (!isPlanes(value)) return value;
    const { shape, at, pitch } = value;
    const [, channels, height, width] = shape;
    const size = height * width;
    const all = this.memory.floats(at, channels * pitch);
    const data = new Float32Array(channels * size);
    for (let channel = 0; channel < channels; channel++) {
      data.set(all.subarray(channel * pitch, channel * pitch + size), channel * size);
    }
    return { shape, data };
  }

  #planes(value: Value): Planes {
    if (isPlanes(value)) return value;
    const [, channels, height, width] = value.shape as [number, number, number, number];
    const planes = this.memory.planes(channels, height, width);
    const size = height * width;
    const all = this.memory.floats(planes.at, channels * planes.pitch);
    for (let channel = 0; channel < channels; channel++) {
      const from = value.data.subarray(channel * size, (channel + 1) * size);
      all.set(from, channel * planes.pitch);
    }
    this.#borrowed.push(planes.at);
    return planes;
  }

  /** Copies made for one step. */
  readonly #borrowed: number[] = [];

  #forget(values: Map<string, Value>, name: string): void {
    for (const at of this.#borrowed.splice(0)) this.memory.give(at);
    const value = values.get(name);
    if (value && isPlanes(value)) this.memory.give(value.at);
    values.delete(name);
  }

  /** Notes after which step a value is not needed any more. */
  #release(): void {
    const seen = new Set(this.graph.outputs);
    for (const { inputs, outputs, done } of [...this.#steps].reverse()) {
      for (const name of [...inputs, ...outputs]) {
        if (seen.has(name) || this.#constants.has(name)) continue;
        seen.add(name);
        done.push(name);
      }
    }
  }
}

function step(inputs: readonly string[], outputs: readonly string[], run: Step["run"]): Step {
  return { inputs, outputs, run, done: [] };
}

/** The clipping that is all that follows a layer becomes part of it. */
function clippedAfter(
  node: Node,
  constants: ReadonlyMap<string, Dense>,
  uses: ReadonlyMap<string, Node[]>,
  taken: Set<Node>,
): { readonly range: Range; readonly output: string } {
  const output = node.outputs[0]!;
  const next = uses.get(output) ?? [];
  const [clip] = next;
  const isAll = next.length === 1 && (clip?.operator === "Clip" || clip?.operator === "Relu");
  if (!clip || !isAll) return { range: NO_LIMITS, output };
  const limits = clip.inputs.slice(1);
  if (!limits.every((name) => name === "" || constants.has(name))) {
    return { range: NO_LIMITS, output };
  }
  taken.add(clip);
  const [low, high] = [0, 1].map((i) => constants.get(limits[i] ?? "")?.data[0]);
  const least = clip.operator === "Relu" ? 0 : (low ?? NO_LIMITS.low);
  return { range: { low: least, high: high ?? NO_LIMITS.high }, output: clip.outputs[0]! };
}

/** Who looks at each value; an output of the graph counts as one more. */
function usesOf({ nodes, outputs }: Graph): Map<string, Node[]> {
  const uses = new Map<string, Node[]>();
  const end: Node = { operator: "", inputs: outputs, outputs: [], attributes: {} };
  for (const node of [...nodes, end]) {
    for (const name of node.inputs) {
      const list = uses.get(name);
      if (list) list.push(node);
      else uses.set(name, [node]);
    }
  }
  return uses;
}

function folded(node: Node, constants: Map<string, Dense>): void {
  const operator = OPERATORS.get(node.operator);
  if (!operator) throw unknown(node, "");
  const inputs = node.inputs.filter((name) => name !== "").map((name) => constants.get(name)!);
  const made = asked(node, () => operator(inputs, node));
  ("data" in made ? [made] : made).forEach((value, i) => {
    constants.set(node.outputs[i]!, value);
  });
}

function isPlain({ attributes }: Node): boolean {
  const { transA = 0, transB = 0, alpha = 1, beta = 1 } = attributes;
  return transA === 0 && transB === 1 && alpha === 1 && beta === 1;
}

function isPlanes(value: Value): value is Planes {
  return "pitch" in value;
}

function isAlike(a: Planes, b: Planes): boolean {
  return a.shape.every((n, axis) => n === b.shape[axis]);
}

function asked<T>(node: Node, make: () => T): T {
  try {
    return make();
  } catch (error) {
    throw unknown(node, error instanceof Error ? error.message : String(error));
  }
}

function unknown({ operator }: Node, detail: string): EstimateError {
  const got = detail ? `${operator}: ${detail}` : `'${operator}'`;
  return new EstimateError("model-damaged", `expected operators that can be run here, got ${got}`);
}

/**
 * A model as onnxruntime would rewrite it before its first run: weights widened from float16, and
 * clipping done inside the convolutions. The runtime needs a second for that, since its own code
 * has yet to be compiled then; here it takes some milliseconds.
 *
 * Whatever is not recognised stays as it is, and is right, if slower.
 */
import {
  fieldsOf,
  joined,
  packed,
  packedFloat,
  packedNumber,
  packedText,
  text,
} from "./protobuf.ts";

// Numbers of fields in onnx.proto, and of its types.
const MODEL = { graph: 7, opsets: 8 };
const OPSET = { domain: 1, version: 2 };
const GRAPH = { node: 1, initializer: 5, output: 12 };
const NODE = { input: 1, output: 2, operator: 4, attribute: 5, domain: 7 };
const ATTRIBUTE = { name: 1, integer: 3, text: 4, floats: 7, type: 20 };
const TENSOR = { dims: 1, type: 2, name: 8, raw: 9 };
const [FLOAT, HALF] = [1, 10];
const [TEXT, FLOATS] = [3, 6];
const DOMAIN = "com.microsoft"; // where onnxruntime keeps its own operators

interface Node {
  readonly whole: Uint8Array;
  readonly content: Uint8Array;
  readonly operator: string;
  readonly inputs: readonly string[];
  readonly outputs: readonly string[];
}

interface Tensor {
  readonly whole: Uint8Array;
  readonly type: number;
  readonly name: string;
  readonly dims: readonly Uint8Array[];
  readonly raw: Uint8Array | undefined; // undefined where the numbers are kept in another way
}

/** @throws EstimateError `model-damaged` where it is no complete ONNX file. */
export function prepared(model: Uint8Array): Uint8Array {
  const parts: Uint8Array[] = [];
  for (const { number, content, whole } of fieldsOf(model)) {
    parts.push(number === MODEL.graph ? packed(MODEL.graph, rewritten(content)) : whole);
  }
  const opset = [packedText(OPSET.domain, DOMAIN), packedNumber(OPSET.version, 1)];
  return joined([...parts, packed(MODEL.opsets, joined(opset))]);
}

function rewritten(graph: Uint8Array): Uint8Array {
  const [nodes, tensors, rest]: [Node[], Map<string, Tensor>, Uint8Array[]] = [[], new Map(), []];
  const used = new Map<string, number>();
  for (const { number, content, whole } of fieldsOf(graph)) {
    if (number === GRAPH.node) nodes.push(nodeOf(content, whole));
    else if (number === GRAPH.initializer) {
      const tensor = tensorOf(content, whole);
      tensors.set(tensor.name, tensor);
    } else {
      rest.push(whole);
      if (number === GRAPH.output) count(used, nameOf(content));
    }
  }
  for (const { inputs } of nodes) for (const name of inputs) count(used, name);
  const left = withoutCasts(nodes, tensors, used);
  const written = withFusedClips(left, tensors, used).map((node) => node.whole);
  return joined([...rest, ...written, ...[...tensors.values()].map(({ whole }) => whole)]);
}

/** Replaces float16 weights that are cast at once by float32 ones of the cast's name. */
function withoutCasts(
  nodes: readonly Node[],
  tensors: Map<string, Tensor>,
  used: Map<string, number>,
): Node[] {
  return nodes.filter((node) => {
    const [from, to] = [node.inputs[0]!, node.outputs[0]!];
    const tensor = tensors.get(from);
    if (node.operator !== "Cast" || targetOf(node) !== FLOAT) return true;
    if (tensor?.type !== HALF || !tensor.raw || used.get(from) !== 1) return true;
    tensors.delete(from);
    tensors.set(to, widened(tensor.raw, tensor.dims, to));
    return false;
  });
}

/** Puts a Clip with known limits into the convolution before it, where nobody else reads that. */
function withFusedClips(
  nodes: readonly Node[],
  tensors: Map<string, Tensor>,
  used: Map<string, number>,
): Node[] {
  const convolutions = new Map(
    nodes.filter(({ operator }) => operator === "Conv").map((node) => [node.outputs[0]!, node]),
  );
  const fused = new Map<Node, Node>(); // by the convolution, which comes first
  const clips = new Set<Node>();
  for (const node of nodes) {
    const from = convolutions.get(node.inputs[0]!);
    const limits = node.inputs.slice(1).map((name) => scalar(tensors.get(name)));
    if (node.operator !== "Clip" || !from || used.get(node.inputs[0]!) !== 1) continue;
    if (limits.length !== 2 || limits.includes(undefined)) continue;
    fused.set(from, clipped(from, node.outputs[0]!, limits as number[]));
    clips.add(node);
  }
  return nodes.filter((node) => !clips.has(node)).map((node) => fused.get(node) ?? node);
}

function clipped(convolution: Node, output: string, limits: readonly number[]): Node {
  const replaced = new Set([NODE.output, NODE.operator, NODE.domain]);
  const kept = [...fieldsOf(convolution.content)].filter(({ number }) => !replaced.has(number));
  const activation = [
    packedText(ATTRIBUTE.name, "activation"),
    packedText(ATTRIBUTE.text, "Clip"),
    packedNumber(ATTRIBUTE.type, TEXT),
  ];
  const between = [
    packedText(ATTRIBUTE.name, "activation_params"),
    ...limits.map((limit) => packedFloat(ATTRIBUTE.floats, limit)),
    packedNumber(ATTRIBUTE.type, FLOATS),
  ];
  const content = joined([
    ...kept.map(({ whole }) => whole),
    packedText(NODE.output, output),
    packedText(NODE.operator, "FusedConv"),
    packedText(NODE.domain, DOMAIN),
    packed(NODE.attribute, joined(activation)),
    packed(NODE.attribute, joined(between)),
  ]);
  return nodeOf(content, packed(GRAPH.node, content));
}

function nodeOf(content: Uint8Array, whole: Uint8Array): Node {
  const [inputs, outputs]: [string[], string[]] = [[], []];
  let operator = "";
  for (const field of fieldsOf(content)) {
    if (field.number === NODE.input) inputs.push(text(field.content));
    else if (field.number === NODE.output) outputs.push(text(field.content));
    else if (field.number === NODE.operator) operator = text(field.content);
  }
  return { whole, content, operator, inputs, outputs };
}

function tensorOf(content: Uint8Array, whole: Uint8Array): Tensor {
  const dims: Uint8Array[] = [];
  let [type, name, raw]: [number, string, Uint8Array | undefined] = [0, "", undefined];
  for (const field of fieldsOf(content)) {
    if (field.number === TENSOR.dims) dims.push(field.whole);
    else if (field.number === TENSOR.type) type = field.value;
    else if (field.number === TENSOR.name) name = text(field.content);
    else if (field.number === TENSOR.raw) raw = field.content;
  }
  return { whole, type, name, dims, raw };
}

/** Float16 numbers as a float32 tensor. */
function widened(raw: Uint8Array, dims: readonly Uint8Array[], name: string): Tensor {
  const halves = new Uint16Array(new Uint8Array(raw).buffer); // wherever it lay in the file
  const wide = new Uint8Array(Float32Array.from(halves, (bits) => WIDE[bits]!).buffer);
  const content = joined([
    ...dims,
    packedNumber(TENSOR.type, FLOAT),
    packedText(TENSOR.name, name),
    packed(TENSOR.raw, wide),
  ]);
  return { whole: packed(GRAPH.initializer, content), type: FLOAT, name, dims, raw: wide };
}

function scalar(tensor: Tensor | undefined): number | undefined {
  if (tensor?.type !== FLOAT || tensor.raw?.length !== 4) return undefined;
  return new DataView(tensor.raw.buffer, tensor.raw.byteOffset).getFloat32(0, true);
}

/** The type that a Cast makes. */
function targetOf(node: Node): number | undefined {
  for (const { number, content } of fieldsOf(node.content)) {
    if (number !== NODE.attribute) continue;
    const fields = [...fieldsOf(content)];
    const name = fields.find((field) => field.number === ATTRIBUTE.name);
    if (name && text(name.content) === "to") {
      return fields.find((field) => field.number === ATTRIBUTE.integer)?.value;
    }
  }
  return undefined;
}

function nameOf(value: Uint8Array): string {
  for (const { number, content } of fieldsOf(value)) if (number === 1) return text(content);
  return "";
}

function count(used: Map<string, number>, name: string): void {
  used.set(name, (used.get(name) ?? 0) + 1);
}

/** Every float16 number by its bits. */
const WIDE = Float32Array.from({ length: 2 ** 16 }, (_, bits) => {
  const [sign, exponent, fraction] = [bits >> 15, (bits >> 10) & 31, bits & 1023];
  const size =
    exponent === 0
      ? fraction * 2 ** -24
      : exponent === 31
        ? fraction === 0
          ? Number.POSITIVE_INFINITY
          : Number.NaN
        : (1024 + fraction) * 2 ** (exponent - 25);
  return sign === 0 ? size : -size;
});

/** An ONNX file as a list of operators and the numbers that they start from. */
import { EstimateError } from "../errors.ts";
import { type Field, fieldsOf, text } from "./protobuf.ts";

/** Numbers and their shape; row-major, of any type: all become 32-bit floats. */
export interface Dense {
  readonly shape: readonly number[];
  readonly data: Float32Array;
}

export type Attribute = number | string | readonly number[] | Dense;

export interface Node {
  readonly operator: string;
  /** Names of values; empty where an optional one is left out. */
  readonly inputs: readonly string[];
  readonly outputs: readonly string[];
  readonly attributes: Readonly<Record<string, Attribute>>;
}

export interface Graph {
  readonly nodes: readonly Node[];
  readonly constants: ReadonlyMap<string, Dense>;
  /** Names of what goes in, constants left out, and of what comes out. */
  readonly inputs: readonly string[];
  readonly outputs: readonly string[];
}

// Numbers of fields in onnx.proto.
const GRAPH_OF_MODEL = 7;
const GRAPH = { node: 1, initializer: 5, input: 11, output: 12 };
const NODE = { input: 1, output: 2, operator: 4, attribute: 5, domain: 7 };
const ATTRIBUTE = { name: 1, float: 2, integer: 3, text: 4, tensor: 5, floats: 7, integers: 8 };
const TENSOR = { dims: 1, type: 2, floats: 4, int32s: 5, int64s: 7, name: 8, raw: 9, doubles: 10 };

/** @throws EstimateError `model-damaged` where it is no complete ONNX file. */
export function graphOf(model: Uint8Array): Graph {
  for (const { number, content } of fieldsOf(model)) {
    if (number === GRAPH_OF_MODEL) return parsed(content);
  }
  throw damaged("a graph in the ONNX file, got none");
}

function parsed(graph: Uint8Array): Graph {
  const nodes: Node[] = [];
  const constants = new Map<string, Dense>();
  const [inputs, outputs]: [string[], string[]] = [[], []];
  for (const { number, content } of fieldsOf(graph)) {
    if (number === GRAPH.node) nodes.push(nodeOf(content));
    else if (number === GRAPH.initializer) constants.set(...namedTensor(content));
    else if (number === GRAPH.input) inputs.push(nameOf(content));
    else if (number === GRAPH.output) outputs.push(nameOf(content));
  }
  return { nodes, constants, inputs: inputs.filter((name) => !constants.has(name)), outputs };
}

function nodeOf(content: Uint8Array): Node {
  const [inputs, outputs]: [string[], string[]] = [[], []];
  const attributes: Record<string, Attribute> = {};
  let [operator, domain] = ["", ""];
  for (const field of fieldsOf(content)) {
    if (field.number === NODE.input) inputs.push(text(field.content));
    else if (field.number === NODE.output) outputs.push(text(field.content));
    else if (field.number === NODE.operator) operator = text(field.content);
    else if (field.number === NODE.domain) domain = text(field.content);
    else if (field.number === NODE.attribute) {
      const [name, value] = attributeOf(field.content);
      attributes[name] = value;
    }
  }
  const isStandard = domain === "" || domain === "ai.onnx";
  return { operator: isStandard ? operator : `${domain}.${operator}`, inputs, outputs, attributes };
}

function attributeOf(content: Uint8Array): [string, Attribute] {
  let name = "";
  let value: Attribute = 0;
  const list: number[] = [];
  for (const field of fieldsOf(content)) {
    if (field.number === ATTRIBUTE.name) name = text(field.content);
    else if (field.number === ATTRIBUTE.float) value = float(field);
    else if (field.number === ATTRIBUTE.integer) value = field.value;
    else if (field.number === ATTRIBUTE.text) value = text(field.content);
    else if (field.number === ATTRIBUTE.tensor) value = namedTensor(field.content)[1];
    else if (field.number === ATTRIBUTE.floats) list.push(...floats(field));
    else if (field.number === ATTRIBUTE.integers) list.push(...integers(field));
  }
  return [name, list.length > 0 ? list : value];
}

function namedTensor(content: Uint8Array): [string, Dense] {
  const [shape, listed]: [number[], number[]] = [[], []];
  let [type, name, raw]: [number, string, Uint8Array | undefined] = [0, "", undefined];
  for (const field of fieldsOf(content)) {
    if (field.number === TENSOR.dims) shape.push(...integers(field));
    else if (field.number === TENSOR.type) type = field.value;
    else if (field.number === TENSOR.name) name = text(field.content);
    else if (field.number === TENSOR.raw) raw = field.content;
    else if (field.number === TENSOR.floats) listed.push(...floats(field));
    else if (field.number === TENSOR.int32s || field.number === TENSOR.int64s) {
      listed.push(...integers(field));
    }
  }
  const count = shape.reduce((a, b) => a * b, 1);
  const data = raw ? numbersOf(raw, type) : Float32Array.from(listed);
  if (data.length !== count) {
    throw damaged(`${count} numbers in '${name}', got ${data.length} of type ${type}`);
  }
  return [name, { shape, data }];
}

/** Little-endian numbers of one of onnx.proto's types. */
function numbersOf(raw: Uint8Array, type: number): Float32Array {
  const { buffer } = new Uint8Array(raw); // wherever it lay in the file
  if (raw.length % bytesOf(type) !== 0) return new Float32Array();
  switch (type) {
    case 1:
      return new Float32Array(buffer);
    case 2:
    case 9:
      return Float32Array.from(new Uint8Array(buffer));
    case 3:
      return Float32Array.from(new Int8Array(buffer));
    case 6:
      return Float32Array.from(new Int32Array(buffer));
    case 7:
      return Float32Array.from(new BigInt64Array(buffer), Number);
    case 10:
      return widened(new Uint16Array(buffer));
    case 11:
      return Float32Array.from(new Float64Array(buffer));
    default:
      throw damaged(`numbers of a known type, got type ${type}`);
  }
}

/** A loop of its own: there are millions of them. */
function widened(halves: Uint16Array): Float32Array {
  const wide = new Float32Array(halves.length);
  for (let i = 0; i < halves.length; i++) wide[i] = WIDE[halves[i]!]!;
  return wide;
}

function bytesOf(type: number): number {
  return { 1: 4, 6: 4, 7: 8, 10: 2, 11: 8 }[type] ?? 1;
}

function float({ whole }: Field): number {
  return new DataView(whole.buffer, whole.byteOffset + whole.length - 4).getFloat32(0, true);
}

/** One, or as many as are packed together. */
function floats(field: Field): number[] {
  const { content } = field;
  if (content.length === 0) return [float(field)];
  const view = new DataView(content.buffer, content.byteOffset, content.byteLength);
  return Array.from({ length: content.length >> 2 }, (_, i) => view.getFloat32(4 * i, true));
}

function integers({ content, value }: Field): number[] {
  if (content.length === 0) return [value];
  // Packed: as if each were a field of its own, number 1.
  const fields = new Uint8Array(2 * content.length);
  let to = 0;
  content.forEach((byte, i) => {
    if (i === 0 || content[i - 1]! < 128) fields[to++] = 8;
    fields[to++] = byte;
  });
  return [...fieldsOf(fields.subarray(0, to))].map((field) => field.value);
}

function nameOf(value: Uint8Array): string {
  for (const { number, content } of fieldsOf(value)) if (number === 1) return text(content);
  return "";
}

function damaged(expected: string): EstimateError {
  return new EstimateError("model-damaged", `expected ${expected}`);
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

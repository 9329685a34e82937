/**
 * ONNX operators on small arrays, as numpy would compute them: for the little that follows the
 * convolutions of a network. Convolutions themselves are in `engine`.
 */
import type { Dense, Node } from "./onnx.ts";

type Operator = (inputs: readonly Dense[], node: Node) => Dense | readonly Dense[];

const sigmoid = (x: number): number => 1 / (1 + Math.exp(-x));

const ONE: Record<string, (x: number) => number> = {
  Abs: Math.abs,
  Asin: Math.asin,
  Cos: Math.cos,
  Exp: Math.exp,
  Log: Math.log,
  Neg: (x) => -x,
  Reciprocal: (x) => 1 / x,
  Relu: (x) => Math.max(x, 0),
  Sigmoid: sigmoid,
  Sin: Math.sin,
  Softplus: (x) => Math.max(x, 0) + Math.log1p(Math.exp(-Math.abs(x))),
  Sqrt: Math.sqrt,
  Tanh: Math.tanh,
};
const TWO: Record<string, (row: Row) => void> = {
  Add({ out, to, length, a, b, i, j, along, and }) {
    for (let k = 0; k < length; k++) out[to + k] = a[i + k * along]! + b[j + k * and]!;
  },
  Div({ out, to, length, a, b, i, j, along, and }) {
    for (let k = 0; k < length; k++) out[to + k] = a[i + k * along]! / b[j + k * and]!;
  },
  Max: rowOf(Math.max),
  Min: rowOf(Math.min),
  Mul({ out, to, length, a, b, i, j, along, and }) {
    for (let k = 0; k < length; k++) out[to + k] = a[i + k * along]! * b[j + k * and]!;
  },
  Pow: rowOf((a, b) => a ** b),
  Sub({ out, to, length, a, b, i, j, along, and }) {
    for (let k = 0; k < length; k++) out[to + k] = a[i + k * along]! - b[j + k * and]!;
  },
};

/** Numbers in a row, made of two arrays from their places on; a step is 0 or 1. */
interface Row {
  readonly out: Float32Array;
  readonly to: number;
  readonly length: number;
  readonly a: Float32Array;
  readonly b: Float32Array;
  readonly i: number;
  readonly j: number;
  readonly along: number;
  readonly and: number;
}

/** Slower than a loop of its own: for what is done to few numbers. */
function rowOf(put: (a: number, b: number) => number): (row: Row) => void {
  return ({ out, to, length, a, b, i, j, along, and }) => {
    for (let k = 0; k < length; k++) out[to + k] = put(a[i + k * along]!, b[j + k * and]!);
  };
}

/** How values are put together, from what on, and what is done with all at the end. */
const REDUCE: Record<string, Reduction> = {
  ReduceL2: { start: 0, add: (sum, x) => sum + x * x, end: Math.sqrt },
  ReduceMax: { start: Number.NEGATIVE_INFINITY, add: Math.max, end: (x) => x },
  ReduceMean: { start: 0, add: (sum, x) => sum + x, end: (sum, count) => sum / count },
  ReduceMin: { start: Number.POSITIVE_INFINITY, add: Math.min, end: (x) => x },
  ReduceSum: { start: 0, add: (sum, x) => sum + x, end: (x) => x },
};

interface Reduction {
  readonly start: number;
  add(sum: number, x: number): number;
  end(sum: number, count: number): number;
}

export const OPERATORS: ReadonlyMap<string, Operator> = new Map<string, Operator>([
  ...Object.entries(ONE).map(([name, map]): [string, Operator] => [name, ([x]) => each(x!, map)]),
  ...Object.entries(TWO).map(([name, put]): [string, Operator] => [
    name,
    (inputs) => inputs.reduce((a, b) => broadcast(a, b, put)),
  ]),
  ...Object.entries(REDUCE).map(([name, how]): [string, Operator] => [
    name,
    ([x, axes], node) => reduced(x!, axesOf(axes, node), node.attributes.keepdims !== 0, how),
  ]),
  ["Cast", ([x]) => x!], // every number here is a 32-bit float
  ["Identity", ([x]) => x!],
  ["Constant", (_, { attributes }) => constant(attributes.value ?? attributes.value_float ?? 0)],
  ["Clip", ([x, low, high]) => each(x!, clip(low, high))],
  ["Concat", (inputs, { attributes }) => concatenated(inputs, Number(attributes.axis))],
  ["Flatten", ([x], { attributes }) => flattened(x!, Number(attributes.axis ?? 1))],
  ["GlobalAveragePool", ([x]) => reduced(x!, [2, 3], true, REDUCE.ReduceMean!)],
  ["MatMul", ([a, b]) => multiplied(a!, b!)],
  ["Reshape", ([x, shape]) => ({ shape: reshaped(x!, numbers(shape!)), data: x!.data })],
  ["Slice", ([x, ...range]) => sliced(x!, range)],
  ["Softmax", ([x], { attributes }) => softmax(x!, Number(attributes.axis ?? -1))],
  ["Split", split],
  ["Squeeze", ([x, axes], node) => squeezed(x!, axesOf(axes, node))],
  ["Transpose", ([x], { attributes }) => transposed(x!, attributes.perm as number[] | undefined)],
  ["Unsqueeze", ([x, axes], node) => unsqueezed(x!, axesOf(axes, node) ?? [])],
]);

export function numbers({ data }: Dense): number[] {
  return Array.from(data);
}

function each({ shape, data }: Dense, map: (x: number) => number): Dense {
  return { shape, data: data.map(map) };
}

function constant(value: unknown): Dense {
  if (typeof value === "number") return { shape: [], data: Float32Array.of(value) };
  return value as Dense;
}

function clip(low?: Dense, high?: Dense): (x: number) => number {
  const [least, most] = [low?.data[0] ?? -Infinity, high?.data[0] ?? Infinity];
  return (x) => Math.min(Math.max(x, least), most);
}

/** Step in floats along each axis; 0 where there is one value for all. */
function steps(shape: readonly number[], rank: number): number[] {
  const result = new Array<number>(rank).fill(0);
  let step = 1;
  for (let axis = shape.length - 1; axis >= 0; axis--) {
    result[axis + rank - shape.length] = shape[axis] === 1 ? 0 : step;
    step *= shape[axis]!;
  }
  return result;
}

function broadcast(a: Dense, b: Dense, put: (row: Row) => void): Dense {
  const rank = Math.max(a.shape.length, b.shape.length);
  const along = ({ shape }: Dense, axis: number) => shape[axis + shape.length - rank] ?? 1;
  const shape = Array.from({ length: rank }, (_, axis) => {
    const [m, n] = [along(a, axis), along(b, axis)];
    if (m !== n && m !== 1 && n !== 1) {
      throw new RangeError(`shapes ${a.shape} and ${b.shape} do not fit together`);
    }
    return m === 1 ? n : m;
  });
  const [from, and] = [steps(a.shape, rank), steps(b.shape, rank)];
  const { axis, length, by } = longestRow(shape, [from, and]);
  const data = new Float32Array(shape.reduce((product, n) => product * n, 1));
  const row = {
    out: data,
    to: 0,
    length,
    a: a.data,
    b: b.data,
    i: 0,
    j: 0,
    along: by[0]!,
    and: by[1]!,
  };
  walked(shape.slice(0, axis), [from.slice(0, axis), and.slice(0, axis)], ([i, j]) => {
    put({ ...row, i: i!, j: j! });
    row.to += length;
    return 0;
  });
  return { shape, data };
}

/** The last axes along which every array goes on evenly or stays: no place there need be looked up. */
function longestRow(shape: readonly number[], along: readonly (readonly number[])[]) {
  const by = along.map(() => -1); // not known yet
  let [axis, length] = [shape.length, 1];
  for (; axis > 0; axis--) {
    const count = shape[axis - 1]!;
    if (count === 1) continue;
    const next = along.map((step) => step[axis - 1]! / length);
    if (!next.every((step, k) => (by[k] === -1 ? step === 0 || step === 1 : step === by[k]))) break;
    next.forEach((step, k) => {
      by[k] = step;
    });
    length *= count;
  }
  return { axis, length, by: by.map((step) => Math.max(step, 0)) };
}

/** An array of `shape`, each value made of the places that `along` steps lead to. */
function walked(
  shape: readonly number[],
  along: readonly (readonly number[])[],
  make: (places: readonly number[]) => number,
  starts: readonly number[] = along.map(() => 0),
): Dense {
  const data = new Float32Array(shape.reduce((product, n) => product * n, 1));
  const index = new Array<number>(shape.length).fill(0);
  const places = [...starts];
  for (let i = 0; i < data.length; i++) {
    data[i] = make(places);
    for (let axis = shape.length - 1; axis >= 0; axis--) {
      const isNext = ++index[axis]! < shape[axis]!;
      const by = isNext ? 1 : 1 - shape[axis]!;
      along.forEach((step, k) => {
        places[k]! += by * step[axis]!;
      });
      if (isNext) break;
      index[axis] = 0;
    }
  }
  return { shape, data };
}

/** As steps of `shape`, without the zeros. */
function ownSteps(shape: readonly number[]): number[] {
  return shape.map((_, axis) => shape.slice(axis + 1).reduce((a, b) => a * b, 1));
}

function axesOf(axes: Dense | undefined, { attributes }: Node): number[] | undefined {
  if (axes) return numbers(axes);
  return attributes.axes as number[] | undefined;
}

const positive = (axis: number, rank: number): number => (axis < 0 ? axis + rank : axis);

function reduced(x: Dense, axes: number[] | undefined, keeps: boolean, how: Reduction): Dense {
  const rank = x.shape.length;
  const gone = new Set((axes ?? x.shape.map((_, i) => i)).map((axis) => positive(axis, rank)));
  const shape = x.shape.map((n, axis) => (gone.has(axis) ? 1 : n));
  const result = new Float64Array(shape.reduce((a, b) => a * b, 1)).fill(how.start);
  const count = x.data.length / result.length;
  const kept = x.shape.findLastIndex((n, axis) => n > 1 && !gone.has(axis));
  if (x.shape.every((n, axis) => axis > kept || n === 1 || !gone.has(axis))) {
    // What goes lies together, so the places need not be looked up.
    for (let to = 0, at = 0; to < result.length; to++) {
      let sum = how.start;
      for (const end = at + count; at < end; at++) sum = how.add(sum, x.data[at]!);
      result[to] = sum;
    }
  } else {
    walked(x.shape, [ownSteps(x.shape), steps(shape, rank)], ([from, to]) => {
      result[to!] = how.add(result[to!]!, x.data[from!]!);
      return 0;
    });
  }
  const data = Float32Array.from(result, (sum) => how.end(sum, count));
  return { shape: keeps ? shape : shape.filter((_, axis) => !gone.has(axis)), data };
}

function concatenated(inputs: readonly Dense[], axis: number): Dense {
  const first = inputs[0]!.shape;
  const at = positive(axis, first.length);
  const inner = (x: Dense) => x.shape.slice(at).reduce((a, b) => a * b, 1);
  const outer = first.slice(0, at).reduce((a, b) => a * b, 1);
  const width = inputs.reduce((sum, x) => sum + inner(x), 0);
  const data = new Float32Array(outer * width);
  for (let row = 0, to = 0; row < outer; row++) {
    for (const x of inputs) {
      data.set(x.data.subarray(row * inner(x), (row + 1) * inner(x)), to);
      to += inner(x);
    }
  }
  const length = inputs.reduce((sum, { shape }) => sum + shape[at]!, 0);
  return { shape: first.map((n, i) => (i === at ? length : n)), data };
}

function flattened({ shape, data }: Dense, axis: number): Dense {
  const rows = shape.slice(0, positive(axis, shape.length)).reduce((a, b) => a * b, 1);
  return { shape: [rows, data.length / rows], data };
}

/** With one -1 filled in and zeros taken over; a batch of one fits all. */
export function reshaped(x: { readonly shape: readonly number[] }, wanted: number[]): number[] {
  const count = x.shape.reduce((a, b) => a * b, 1);
  const shape = wanted.map((n, axis) => (n === 0 ? (x.shape[axis] ?? 0) : n));
  const known = shape.reduce((product, n) => (n === -1 ? product : product * n), 1);
  const filled = shape.map((n) => (n === -1 ? count / known : n));
  if (filled.reduce((a, b) => a * b, 1) !== count) {
    throw new RangeError(`${count} numbers cannot have the shape ${wanted}`);
  }
  return filled;
}

/** Matrices in the last two axes; the axes before them are broadcast. */
function multiplied(a: Dense, b: Dense): Dense {
  const depth = a.shape.at(-1)!;
  const [rows, columns] = [a.shape.at(-2) ?? 1, b.shape.at(-1)!];
  if (b.shape.at(-2) !== depth) throw new RangeError(`cannot multiply ${a.shape} by ${b.shape}`);
  const rank = Math.max(a.shape.length, b.shape.length, 2);
  const outer = (x: Dense, i: number) => x.shape.slice(0, -2)[i + x.shape.length - rank] ?? 1;
  const batch = Array.from({ length: rank - 2 }, (_, i) => Math.max(outer(a, i), outer(b, i)));
  const shape = [...batch, rows, columns];
  const lead = (x: Dense) =>
    steps(x.shape, rank)
      .slice(0, -2)
      .concat(0, 0)
      .slice(0, rank - 2);
  const along = [
    [...lead(a), depth, 0],
    [...lead(b), 0, 1],
  ];
  return walked(shape, along, ([i, j]) => {
    let sum = 0;
    for (let k = 0; k < depth; k++) sum += a.data[i! + k]! * b.data[j! + k * columns]!;
    return sum;
  });
}

function sliced(x: Dense, [starts, ends, axes, by]: readonly Dense[]): Dense {
  const shape = [...x.shape];
  const step = ownSteps(x.shape);
  let first = 0;
  numbers(starts!).forEach((from, i) => {
    const axis = positive(axes?.data[i] ?? i, shape.length);
    const [length, jump] = [x.shape[axis]!, by?.data[i] ?? 1];
    const [low, high] = jump > 0 ? [0, length] : [-1, length - 1];
    const within = (n: number) => Math.min(Math.max(n < 0 ? n + length : n, low), high);
    const [start, end] = [within(from), within(ends!.data[i]!)];
    shape[axis] = Math.max(Math.ceil((end - start) / jump), 0);
    first += start * step[axis]!;
    step[axis]! *= jump;
  });
  return walked(shape, [step], ([i]) => x.data[i!]!, [first]);
}

function split([x, sizes]: readonly Dense[], node: Node): Dense[] {
  const axis = positive(Number(node.attributes.axis ?? 0), x!.shape.length);
  const length = x!.shape[axis]!;
  const parts = sizes
    ? numbers(sizes)
    : node.outputs.map(() => Math.ceil(length / node.outputs.length));
  let from = 0;
  return parts.map((size) => {
    const range = [from, from + size, axis].map((n) => constant(n));
    from += size;
    return sliced(x!, range);
  });
}

function softmax(x: Dense, axis: number): Dense {
  const most = reduced(x, [axis], true, REDUCE.ReduceMax!);
  const powers = each(broadcast(x, most, TWO.Sub!), Math.exp);
  const sum = reduced(powers, [axis], true, REDUCE.ReduceSum!);
  return broadcast(powers, sum, TWO.Div!);
}

function squeezed({ shape, data }: Dense, axes: number[] | undefined): Dense {
  const gone = axes?.map((axis) => positive(axis, shape.length));
  return { shape: shape.filter((n, axis) => !(gone ? gone.includes(axis) : n === 1)), data };
}

function unsqueezed({ shape, data }: Dense, axes: number[]): Dense {
  const rank = shape.length + axes.length;
  const result = [...shape];
  for (const axis of axes.map((a) => positive(a, rank)).sort((a, b) => a - b)) {
    result.splice(axis, 0, 1);
  }
  return { shape: result, data };
}

function transposed(x: Dense, order = x.shape.map((_, i) => x.shape.length - 1 - i)): Dense {
  const step = ownSteps(x.shape);
  const along = order.map((axis) => step[axis]!);
  return walked(
    order.map((axis) => x.shape[axis]!),
    [along],
    ([i]) => x.data[i!]!,
  );
}

/** Convolutions and fully connected layers with the clipping that follows them, in WebAssembly. */
import type { Memory, Planes } from "./memory.ts";
import type { Attribute, Dense, Node } from "./onnx.ts";

/** What comes after a layer. */
export interface Range {
  readonly low: number;
  readonly high: number;
}

export type Layer = (planes: Planes) => Planes;

interface Window {
  readonly height: number;
  readonly width: number;
  readonly top: number;
  readonly left: number;
  readonly bottom: number;
  readonly right: number;
  readonly stride: number;
}

/** @throws RangeError where it is a convolution of a kind that is not computed here. */
export function convolution(
  memory: Memory,
  node: Node,
  weights: Dense,
  bias: Dense | undefined,
  range: Range,
): Layer {
  const window = windowOf(node, weights);
  const group = Number(node.attributes.group ?? 1);
  const [channels, depth] = weights.shape as [number, number];
  const biases = memory.kept(padded(bias?.data, channels));
  if (group === 1) return dense(memory, weights, biases, window, range);
  if (depth !== 1 || group !== channels || window.height !== 3 || window.width !== 3) {
    throw new RangeError(`a convolution of ${group} groups with weights ${weights.shape}`);
  }
  return alone(memory, memory.kept(weights.data), biases, window, range);
}

/** rows x depth weights on a vector of `depth` numbers. */
export function connected(
  memory: Memory,
  { shape, data }: Dense,
  bias: Dense | undefined,
  { low, high }: Range,
): (x: Dense) => Dense {
  const [rows, depth] = shape as [number, number];
  const wide = (depth + 3) & ~3;
  const weights = new Float32Array(rows * wide);
  for (let row = 0; row < rows; row++) {
    weights.set(data.subarray(row * depth, (row + 1) * depth), row * wide);
  }
  const biases = memory.kept(padded(bias?.data, rows));
  const [from, at, out] = [memory.kept(weights), memory.take(wide), memory.take(rows)];
  memory.floats(at, wide).fill(0);
  return (x) => {
    memory.floats(at, depth).set(x.data);
    memory.kernels.connected(from, at, out, biases, rows, wide, low, high);
    return { shape: [1, rows], data: memory.floats(out, rows).slice() };
  };
}

/** Every output channel sees all input channels. */
function dense(
  memory: Memory,
  weights: Dense,
  biases: number,
  window: Window,
  { low, high }: Range,
): Layer {
  const channels = weights.shape[0]!;
  const depth = weights.data.length / channels;
  const blocks = Math.ceil(channels / 4);
  const from = memory.kept(interleaved(weights.data, channels, depth));
  const stripe = memory.take(16 * depth);
  const { kernels } = memory;
  const isPoint = window.height === 1 && window.width === 1 && window.stride === 1;
  const isPlain = isPoint && window.top === 0 && window.left === 0;
  return (planes) => {
    const [height, width] = sizeAfter(planes, window);
    const out = memory.planes(channels, height, width);
    const seen = isPlain ? planes : unfolded(memory, planes, window, height, width);
    const { at, pitch } = out;
    kernels.product(from, seen.at, at, biases, stripe, blocks, depth, pitch, low, high);
    if (seen !== planes) memory.give(seen.at);
    return out;
  };
}

/** Every channel by itself, 3 x 3. */
function alone(
  memory: Memory,
  weights: number,
  biases: number,
  window: Window,
  { low, high }: Range,
): Layer {
  const { top, left, stride } = window;
  return (planes) => {
    const [, channels, height, width] = planes.shape;
    const [outHeight, outWidth] = sizeAfter(planes, window);
    const room = memory.take((height + 3) * (width + 8));
    const out = memory.planes(channels, outHeight, outWidth);
    const sizes = [channels, height, width, top, left, stride, outHeight, outWidth];
    const [{ at, pitch }, to] = [planes, out];
    const rest = [pitch, to.pitch, low, high];
    memory.kernels.depthwise(weights, at, to.at, biases, room, ...sizes, ...rest);
    memory.give(room);
    return out;
  };
}

function unfolded(
  memory: Memory,
  planes: Planes,
  window: Window,
  height: number,
  width: number,
): Planes {
  const [, channels, rows, columns] = planes.shape;
  const out = memory.planes(channels * window.height * window.width, height, width);
  const { top, left, stride } = window;
  const sizes = [channels, rows, columns, window.height, window.width, top, left, stride];
  memory.kernels.windows(planes.at, out.at, ...sizes, height, width, planes.pitch, out.pitch);
  return out;
}

function windowOf({ attributes }: Node, weights: Dense): Window {
  const [height, width] = weights.shape.slice(2) as [number, number];
  const list = (value: Attribute | undefined, usual: number[]) => (value ?? usual) as number[];
  const [top, left, bottom, right] = list(attributes.pads, [0, 0, 0, 0]);
  const [stride, across] = list(attributes.strides, [1, 1]);
  const isApart = list(attributes.dilations, [1, 1]).some((step) => step !== 1);
  const isAutomatic = (attributes.auto_pad ?? "NOTSET") !== "NOTSET";
  if (weights.shape.length !== 4 || stride !== across || isApart || isAutomatic) {
    throw new RangeError(`a convolution with ${JSON.stringify(attributes)}`);
  }
  const edges = { top: top!, left: left!, bottom: bottom!, right: right! };
  return { height, width, ...edges, stride: stride! };
}

function sizeAfter({ shape }: Planes, window: Window): [number, number] {
  const { height, width, top, left, bottom, right, stride } = window;
  const along = (length: number, size: number) => Math.floor((length - size) / stride) + 1;
  return [along(shape[2] + top + bottom, height), along(shape[3] + left + right, width)];
}

/** Four output channels side by side, for each number of the depth. */
function interleaved(weights: Float32Array, channels: number, depth: number): Float32Array {
  const result = new Float32Array(4 * Math.ceil(channels / 4) * depth);
  for (let channel = 0; channel < channels; channel++) {
    const to = 4 * depth * (channel >> 2) + (channel & 3);
    for (let k = 0; k < depth; k++) result[to + 4 * k] = weights[channel * depth + k]!;
  }
  return result;
}

function padded(values: Float32Array | undefined, count: number): Float32Array {
  const result = new Float32Array((count + 3) & ~3);
  if (values) result.set(values);
  return result;
}

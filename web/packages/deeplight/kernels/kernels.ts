/**
 * The network's arithmetic in WebAssembly with SIMD: npm run kernels --workspace deeplight.
 *
 * AssemblyScript, not TypeScript. A plane is a picture of one channel, its rows one after the other;
 * planes stand `pitch` floats apart, a multiple of 8, and what lies between is never looked at.
 * Addresses are in bytes, all other sizes in floats. Memory behind the last plane may be read, and
 * the padding of a plane written, up to 4 floats too far: the caller leaves room.
 */

/**
 * out[channel][pixel] = sum over k of weights[channel][k] * planes[k][pixel] + bias[channel],
 * clipped: a 1 x 1 convolution. Weights come four channels interleaved, `blocks` times
 * [k][4]; `stripe` is room for 16 x depth floats.
 */
export function product(
  weights: usize,
  planes: usize,
  out: usize,
  bias: usize,
  stripe: usize,
  blocks: i32,
  depth: i32,
  pitch: i32,
  low: f32,
  high: f32,
): void {
  const row = <usize>pitch << 2;
  for (let pixel = 0; pixel < pitch; pixel += 16) {
    const wide = pitch - pixel >= 16;
    gather(planes + (<usize>pixel << 2), stripe, depth, row, wide);
    for (let block = 0; block < blocks; block++) {
      const from = weights + (<usize>(block * depth) << 4);
      const to = out + (<usize>(block * 4 * pitch + pixel) << 2);
      const biases = bias + (<usize>block << 4);
      tile(from, stripe, to, biases, depth, row, low, high);
      if (wide) tile(from, stripe + 32, to + 32, biases, depth, row, low, high);
    }
  }
}

/** 16 pixels of every plane, or 8, side by side. */
// @ts-expect-error: decorator
@inline
function gather(planes: usize, stripe: usize, depth: i32, row: usize, wide: bool): void {
  for (let k = 0; k < depth; k++) {
    v128.store(stripe, v128.load(planes));
    v128.store(stripe, v128.load(planes, 16), 16);
    if (wide) {
      v128.store(stripe, v128.load(planes, 32), 32);
      v128.store(stripe, v128.load(planes, 48), 48);
    }
    stripe += 64;
    planes += row;
  }
}

/** Four channels of eight pixels. */
// @ts-expect-error: decorator
@inline
function tile(
  weights: usize,
  stripe: usize,
  out: usize,
  bias: usize,
  depth: i32,
  row: usize,
  low: f32,
  high: f32,
): void {
  let a0 = v128.load32_splat(bias);
  let b0 = v128.load32_splat(bias, 4);
  let c0 = v128.load32_splat(bias, 8);
  let d0 = v128.load32_splat(bias, 12);
  let a1 = a0;
  let b1 = b0;
  let c1 = c0;
  let d1 = d0;
  for (let k = 0; k < depth; k++) {
    const x0 = v128.load(stripe);
    const x1 = v128.load(stripe, 16);
    const a = v128.load32_splat(weights);
    a0 = f32x4.add(a0, f32x4.mul(a, x0));
    a1 = f32x4.add(a1, f32x4.mul(a, x1));
    const b = v128.load32_splat(weights, 4);
    b0 = f32x4.add(b0, f32x4.mul(b, x0));
    b1 = f32x4.add(b1, f32x4.mul(b, x1));
    const c = v128.load32_splat(weights, 8);
    c0 = f32x4.add(c0, f32x4.mul(c, x0));
    c1 = f32x4.add(c1, f32x4.mul(c, x1));
    const d = v128.load32_splat(weights, 12);
    d0 = f32x4.add(d0, f32x4.mul(d, x0));
    d1 = f32x4.add(d1, f32x4.mul(d, x1));
    stripe += 64;
    weights += 16;
  }
  const least = f32x4.splat(low);
  const most = f32x4.splat(high);
  keep(out, a0, a1, least, most);
  keep(out + row, b0, b1, least, most);
  keep(out + 2 * row, c0, c1, least, most);
  keep(out + 3 * row, d0, d1, least, most);
}

// @ts-expect-error: decorator
@inline
function keep(at: usize, left: v128, right: v128, least: v128, most: v128): void {
  v128.store(at, f32x4.pmin(f32x4.pmax(left, least), most));
  v128.store(at, f32x4.pmin(f32x4.pmax(right, least), most), 16);
}

/**
 * A 3 x 3 convolution of each channel by itself, `stride` 1 or 2, clipped. `room` holds one plane
 * with its border of zeros: (height + 3) x (width + 8) floats.
 */
export function depthwise(
  weights: usize,
  planes: usize,
  out: usize,
  bias: usize,
  room: usize,
  channels: i32,
  height: i32,
  width: i32,
  top: i32,
  left: i32,
  stride: i32,
  outHeight: i32,
  outWidth: i32,
  pitch: i32,
  outPitch: i32,
  low: f32,
  high: f32,
): void {
  const across = width + 8;
  memory.fill(room, 0, <usize>((height + 3) * across) << 2);
  const inner = room + (<usize>(top * across + left) << 2);
  const row = <usize>across << 2;
  const least = f32x4.splat(low);
  const most = f32x4.splat(high);
  for (let channel = 0; channel < channels; channel++) {
    const plane = planes + (<usize>(channel * pitch) << 2);
    for (let y = 0; y < height; y++) {
      const from = plane + (<usize>(y * width) << 2);
      memory.copy(inner + <usize>y * row, from, <usize>width << 2);
    }
    const to = out + (<usize>(channel * outPitch) << 2);
    for (let y = 0; y < outHeight; y++) {
      const from = room + <usize>(y * stride) * row;
      const at = to + (<usize>(y * outWidth) << 2);
      if (stride == 1) each(weights, from, at, bias, row, outWidth, least, most);
      else everySecond(weights, from, at, bias, row, outWidth, least, most);
    }
    weights += 36;
    bias += 4;
  }
}

// @ts-expect-error: decorator
@inline
function each(
  weights: usize,
  from: usize,
  to: usize,
  bias: usize,
  row: usize,
  width: i32,
  least: v128,
  most: v128,
): void {
  for (let x = 0; x < width; x += 4) {
    let sum = v128.load32_splat(bias);
    for (let y = 0; y < 3; y++) {
      const at = from + <usize>y * row;
      const w = weights + <usize>(y * 12);
      sum = f32x4.add(sum, f32x4.mul(v128.load32_splat(w), v128.load(at)));
      sum = f32x4.add(sum, f32x4.mul(v128.load32_splat(w, 4), v128.load(at, 4)));
      sum = f32x4.add(sum, f32x4.mul(v128.load32_splat(w, 8), v128.load(at, 8)));
    }
    v128.store(to, f32x4.pmin(f32x4.pmax(sum, least), most));
    from += 16;
    to += 16;
  }
}

// @ts-expect-error: decorator
@inline
function everySecond(
  weights: usize,
  from: usize,
  to: usize,
  bias: usize,
  row: usize,
  width: i32,
  least: v128,
  most: v128,
): void {
  for (let x = 0; x < width; x += 4) {
    let sum = v128.load32_splat(bias);
    for (let y = 0; y < 3; y++) {
      const at = from + <usize>y * row;
      const w = weights + <usize>(y * 12);
      const a = v128.load(at);
      const b = v128.load(at, 16);
      const even = v128.shuffle<f32>(a, b, 0, 2, 4, 6);
      const odd = v128.shuffle<f32>(a, b, 1, 3, 5, 7);
      const next = v128.shuffle<f32>(v128.load(at, 8), v128.load(at, 24), 0, 2, 4, 6);
      sum = f32x4.add(sum, f32x4.mul(v128.load32_splat(w), even));
      sum = f32x4.add(sum, f32x4.mul(v128.load32_splat(w, 4), odd));
      sum = f32x4.add(sum, f32x4.mul(v128.load32_splat(w, 8), next));
    }
    v128.store(to, f32x4.pmin(f32x4.pmax(sum, least), most));
    from += 32;
    to += 16;
  }
}

/**
 * What a convolution's window sees, one plane for each channel and place in the window, so that
 * `product` does the rest; zeros outside the picture.
 */
export function windows(
  planes: usize,
  out: usize,
  channels: i32,
  height: i32,
  width: i32,
  kernelHeight: i32,
  kernelWidth: i32,
  top: i32,
  left: i32,
  stride: i32,
  outHeight: i32,
  outWidth: i32,
  pitch: i32,
  outPitch: i32,
): void {
  for (let channel = 0; channel < channels; channel++) {
    const plane = planes + (<usize>(channel * pitch) << 2);
    for (let i = 0; i < kernelHeight; i++) {
      for (let j = 0; j < kernelWidth; j++) {
        let to = out;
        for (let y = 0; y < outHeight; y++) {
          const row = y * stride + i - top;
          const isInside = row >= 0 && row < height;
          const from = plane + (<usize>(row * width) << 2);
          for (let x = 0; x < outWidth; x++) {
            const column = x * stride + j - left;
            const isSeen = isInside && column >= 0 && column < width;
            store<f32>(to, isSeen ? load<f32>(from + (<usize>column << 2)) : 0);
            to += 4;
          }
        }
        out += <usize>outPitch << 2;
      }
    }
  }
}

/** out = a + b, `count` floats, a multiple of 4. */
export function sum(a: usize, b: usize, out: usize, count: i32): void {
  for (let i: usize = 0; i < <usize>count << 2; i += 16) {
    v128.store(out + i, f32x4.add(v128.load(a + i), v128.load(b + i)));
  }
}

/**
 * out[row] = weights[row] . x + bias[row]: a fully connected layer; `depth` a multiple of 4, else
 * both padded with zeros.
 */
export function connected(
  weights: usize,
  x: usize,
  out: usize,
  bias: usize,
  rows: i32,
  depth: i32,
  low: f32,
  high: f32,
): void {
  const bytes = <usize>depth << 2;
  for (let row = 0; row < rows; row++) {
    let a = f32x4.splat(0);
    let b = f32x4.splat(0);
    let i: usize = 0;
    for (; i + 32 <= bytes; i += 32) {
      a = f32x4.add(a, f32x4.mul(v128.load(weights + i), v128.load(x + i)));
      b = f32x4.add(b, f32x4.mul(v128.load(weights + i, 16), v128.load(x + i, 16)));
    }
    for (; i < bytes; i += 16) {
      a = f32x4.add(a, f32x4.mul(v128.load(weights + i), v128.load(x + i)));
    }
    a = f32x4.add(a, b);
    const total =
      f32x4.extract_lane(a, 0) +
      f32x4.extract_lane(a, 1) +
      f32x4.extract_lane(a, 2) +
      f32x4.extract_lane(a, 3) +
      load<f32>(bias);
    store<f32>(out, min(max(total, low), high));
    weights += bytes;
    out += 4;
    bias += 4;
  }
}

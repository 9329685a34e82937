/** The kernels and their memory: weights for good, pictures for as long as they are needed. */
import { KERNELS } from "./kernels.generated.ts";

/** See kernels/kernels.ts. */
export interface Kernels {
  product(...args: number[]): void;
  depthwise(...args: number[]): void;
  windows(...args: number[]): void;
  sum(...args: number[]): void;
  connected(...args: number[]): void;
}

/** Pictures of one channel each, one after the other; `pitch` floats from one to the next. */
export interface Planes {
  readonly shape: readonly [1, number, number, number];
  readonly at: number;
  readonly pitch: number;
}

const PAGE = 65536;
/** Kernels may read and write a little past the end. */
const SLACK = 64;

export class Memory {
  readonly #memory: WebAssembly.Memory;
  readonly #free = new Map<number, number[]>(); // addresses by size
  readonly #sizes = new Map<number, number>();
  #end = PAGE; // what lies before is the kernels' own

  private constructor(
    memory: WebAssembly.Memory,
    readonly kernels: Kernels,
  ) {
    this.#memory = memory;
  }

  /** @throws WebAssembly.CompileError where the browser has no SIMD. */
  static async create(): Promise<Memory> {
    const memory = new WebAssembly.Memory({ initial: 2 });
    const code = Uint8Array.from(atob(KERNELS), (letter) => letter.charCodeAt(0));
    const { instance } = await WebAssembly.instantiate(code, { env: { memory } });
    return new Memory(memory, instance.exports as unknown as Kernels);
  }

  /** Room for `count` floats: its address in bytes. */
  take(count: number): number {
    const bytes = (4 * count + SLACK + 15) & ~15;
    const free = this.#free.get(bytes)?.pop();
    if (free !== undefined) return free;
    const at = this.#end;
    this.#end += bytes;
    const missing = this.#end - this.#memory.buffer.byteLength;
    if (missing > 0) this.#memory.grow(Math.ceil(missing / PAGE));
    this.#sizes.set(at, bytes);
    return at;
  }

  /** What was taken is not needed any more. */
  give(at: number): void {
    const bytes = this.#sizes.get(at)!;
    const free = this.#free.get(bytes);
    if (free) free.push(at);
    else this.#free.set(bytes, [at]);
  }

  /** Good until the next `take`. */
  floats(at: number, count: number): Float32Array {
    return new Float32Array(this.#memory.buffer, at, count);
  }

  /** Numbers kept for good. */
  kept(values: Float32Array): number {
    const at = this.take(values.length);
    this.floats(at, values.length).set(values);
    return at;
  }

  /** Planes of any content; the channels' count is rounded up to fours. */
  planes(channels: number, height: number, width: number): Planes {
    const pitch = (height * width + 7) & ~7;
    const at = this.take(pitch * ((channels + 3) & ~3));
    return { shape: [1, channels, height, width], at, pitch };
  }
}

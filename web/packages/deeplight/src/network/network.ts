/** The network itself, on one thread of WebAssembly; no special headers needed. */

import { EstimateError } from "../errors.ts";
import { type Contract, contractOf } from "./contract.ts";
import { Memory } from "./memory.ts";
import { type Dense, graphOf } from "./onnx.ts";
import { Program } from "./program.ts";

export class Network {
  private constructor(
    readonly contract: Contract,
    private readonly program: Program,
  ) {}

  /** @throws EstimateError `model-...` where the file is at fault, `runtime` where the browser is. */
  static async open(model: Uint8Array): Promise<Network> {
    const contract = contractOf(model);
    const graph = graphOf(model);
    const { input_name: input, output_name: output } = contract;
    if (graph.inputs.join() !== input || !graph.outputs.includes(output)) throw outOfContract();
    const memory = await Memory.create().catch((error: unknown) => {
      throw new EstimateError("runtime", String(error));
    });
    return new Network(contract, new Program(memory, graph));
  }

  /** All that the network gives for a picture's planes, by name. */
  run(planes: Float32Array): Map<string, Dense> {
    const { contract } = this;
    const shape = [1, 3, contract.height, contract.width];
    return this.program.run({ [contract.input_name]: { shape, data: planes } });
  }

  /** The light, and what else the network gives. */
  estimate(planes: Float32Array): {
    readonly logRadiance: Float32Array;
    readonly others: ReadonlyMap<string, Dense>;
  } {
    const { output_name: name, output_size: size } = this.contract;
    const others = this.run(planes);
    const output = others.get(name);
    if (output?.shape.join() !== `1,3,${size},${size}`) throw outOfContract();
    others.delete(name);
    return { logRadiance: interleaved(output.data), others };
  }

  /** Log radiance of the mirror ball, rows from the top, RGB. */
  logRadiance(planes: Float32Array): Float32Array {
    return this.estimate(planes).logRadiance;
  }
}

/** @throws EstimateError `no-light` where it is more than a 32-bit float holds, or NaN. */
export function requireFinite(logRadiance: Float32Array): void {
  if (!logRadiance.every((value) => value < 88.7)) {
    throw new EstimateError("no-light", "expected finite light, got NaN or infinity");
  }
}

function outOfContract(): EstimateError {
  return new EstimateError("model-damaged", "expected a model that keeps its own contract");
}

/** From planes of one channel each to RGB by pixel. */
function interleaved(planes: Float32Array): Float32Array {
  const count = planes.length / 3;
  return planes.map((_, i) => planes[(i % 3) * count + Math.floor(i / 3)]!);
}

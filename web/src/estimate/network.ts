/** The network itself: onnxruntime-web on one WASM thread, no special headers needed. */
import * as ort from "onnxruntime-web/wasm";
import { type Contract, contractOf } from "./contract.ts";
import { EstimateError } from "./errors.ts";
import { prepared } from "./prepared.ts";

export class Network {
  private constructor(
    readonly contract: Contract,
    private readonly session: ort.InferenceSession,
  ) {}

  /** @param runtime the folder of onnxruntime's .wasm and .mjs, with its last slash; none: beside it */
  static async open(model: Uint8Array, runtime?: string): Promise<Network> {
    const contract = contractOf(model);
    ort.env.wasm.numThreads = 1; // more need cross-origin isolation, which hosts rarely give
    ort.env.logLevel = "fatal"; // faults come as exceptions
    if (runtime !== undefined) ort.env.wasm.wasmPaths = runtime;
    const session = await opened(model);
    return new Network(contract, session);
  }

  /** Log radiance of the mirror ball, rows from the top, RGB. */
  async logRadiance(planes: Float32Array): Promise<Float32Array> {
    const { contract } = this;
    const shape = [1, 3, contract.height, contract.width];
    const feeds = { [contract.input_name]: new ort.Tensor("float32", planes, shape) };
    const results = await this.session.run(feeds);
    const output = results[contract.output_name];
    if (
      output === undefined ||
      output.dims.join() !== `1,3,${contract.output_size},${contract.output_size}`
    ) {
      throw new EstimateError("model-damaged", "expected a model that keeps its own contract");
    }
    return interleaved((await output.getData()) as Float32Array);
  }
}

async function opened(model: Uint8Array): Promise<ort.InferenceSession> {
  try {
    return await ort.InferenceSession.create(prepared(model), {
      executionProviders: ["wasm"],
      graphOptimizationLevel: "disabled", // it is done
    });
  } catch (error) {
    const why = String(error);
    // The runtime says so when it cannot start at all; everything else is the model's fault.
    const kind = why.includes("no available backend") ? "runtime" : "model-damaged";
    throw new EstimateError(kind, why);
  }
}

/** From planes of one channel each to RGB by pixel. */
function interleaved(planes: Float32Array): Float32Array {
  const count = planes.length / 3;
  return planes.map((_, i) => planes[(i % 3) * count + Math.floor(i / 3)]!);
}

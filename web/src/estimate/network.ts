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

  /**
   * Fetches and starts onnxruntime while the model is still on its way.
   *
   * @param folder of its .wasm and .mjs, with the last slash; without this call they lie beside us.
   */
  static startRuntime(folder: string): void {
    ort.env.wasm.wasmPaths = folder;
    // There is no call for this alone. What fails here fails again, and is told, in `open`.
    void created(new Uint8Array(1)).catch(() => {});
  }

  static async open(model: Uint8Array): Promise<Network> {
    const contract = contractOf(model);
    return new Network(contract, await opened(model));
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
  const file = prepared(model);
  try {
    return await created(file);
  } catch (error) {
    const why = String(error);
    // The runtime says so when it cannot start at all; everything else is the model's fault.
    const kind = why.includes("no available backend") ? "runtime" : "model-damaged";
    throw new EstimateError(kind, why);
  }
}

function created(model: Uint8Array): Promise<ort.InferenceSession> {
  ort.env.wasm.numThreads = 1; // more need cross-origin isolation, which hosts rarely give
  ort.env.logLevel = "fatal"; // faults come as exceptions
  return ort.InferenceSession.create(model, {
    executionProviders: ["wasm"],
    graphOptimizationLevel: "disabled", // `prepared` has done it
  });
}

/** From planes of one channel each to RGB by pixel. */
function interleaved(planes: Float32Array): Float32Array {
  const count = planes.length / 3;
  return planes.map((_, i) => planes[(i % 3) * count + Math.floor(i / 3)]!);
}

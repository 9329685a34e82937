/** What can go wrong between a frame and its light. */
export type EstimateErrorKind =
  | "model-missing" // no such file, or the connection broke
  | "model-damaged" // no ONNX file, cut short, or not one of ours
  | "model-version" // a contract that this page does not serve
  | "runtime" // WebAssembly with SIMD is missing
  | "no-light" // the network gave NaN or infinite light
  | "session-damaged" // no file of what was seen, cut short, or of another version
  | "closed"; // the estimator was closed

export class EstimateError extends Error {
  override readonly name = "EstimateError";

  constructor(
    readonly kind: EstimateErrorKind,
    detail: string,
  ) {
    super(detail);
  }
}

/** Everything that can go wrong on the page; what is said about it is in page/advice.ts. */
import { EstimateError, type EstimateErrorKind } from "deeplight/core";

export type FailureKind =
  | Exclude<EstimateErrorKind, "closed"> // nobody asks a closed estimator
  | "insecure"
  | "denied"
  | "no-camera"
  | "camera-busy"
  | "camera-lost"
  | "motion-denied"
  | "no-motion"
  | "no-room"
  | "no-scene-viewer"
  | "no-webgl"
  | "graphics-lost"
  | "photo-unreadable"
  | "photo-too-large"
  | "photo-too-small"
  | "glb-broken"
  | "glb-packed"
  | "glb-too-large"
  | "object-missing"
  | "cannot-save"
  | "unexpected";

export class Failure extends Error {
  constructor(
    readonly kind: FailureKind,
    detail = "",
  ) {
    super(detail || kind);
    this.name = "Failure";
  }
}

export function asFailure(error: unknown): Failure {
  if (error instanceof Failure) return error;
  if (error instanceof EstimateError && error.kind !== "closed") {
    return new Failure(error.kind, error.message);
  }
  return new Failure("unexpected", error instanceof Error ? error.message : String(error));
}

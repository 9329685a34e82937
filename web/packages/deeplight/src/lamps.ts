/** Lamps: the compact lights that a network names by themselves, where it does. */
import type { Vector3 } from "./light/matrix.ts";
import type { Dense } from "./network/onnx.ts";

/** An even disc far away. Its light is in the network's light already. */
export interface Lamp {
  /** Unit vector towards it, camera frame. */
  readonly direction: Vector3;
  /** RGB radiance integrated over the disc: radiance unit times sr. */
  readonly flux: Vector3;
  readonly angularRadiusRad: number;
}

/** Direction, ln flux, angular radius. */
const NUMBERS = 7;

/** From the network's output of (1, lamps, 7). @throws RangeError where it is none. */
export function lampsOf({ shape, data }: Dense): readonly Lamp[] {
  if (shape.length !== 3 || shape[2] !== NUMBERS) {
    throw new RangeError(`expected lamps of ${NUMBERS} numbers, got the shape ${shape}`);
  }
  return Array.from({ length: shape[1]! }, (_, i) => {
    const at = (k: number): number => data[NUMBERS * i + k]!;
    const length = Math.hypot(at(0), at(1), at(2)) || 1;
    return {
      direction: [at(0) / length, at(1) / length, at(2) / length],
      flux: [Math.exp(at(3)), Math.exp(at(4)), Math.exp(at(5))],
      angularRadiusRad: at(6),
    };
  });
}

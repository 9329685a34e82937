/** The network's answer, given in the frame of what it was shown, in the photo's frame: look.py. */
import { LEAST_RADIANCE } from "../contract/generated.ts";
import { type Lamp, lampsOf, lobeOnBall, NUMBERS } from "../light/lamp.ts";
import type { Vector3 } from "../light/matrix.ts";
import { onBall, pixelDirection } from "../light/mirror-ball.ts";
import type { Contract } from "../network/contract.ts";
import type { Dense } from "../network/onnx.ts";

/** What a network gives: ln radiance on the mirror ball, and its other outputs by name. */
export interface Answered {
  readonly logRadiance: Float32Array;
  readonly others: ReadonlyMap<string, Dense>;
}

/** @param pitchRad how far up the view looks from the photo's axis; 0 changes nothing. */
export function seenFromPhoto(answer: Answered, contract: Contract, pitchRad: number): Answered {
  if (pitchRad === 0) return answer;
  const numbers = answer.others.get(contract.lamps_name);
  const lamps = numbers ? lampsOf(numbers) : [];
  const moved = lamps.map((lamp) => ({ ...lamp, direction: raised(lamp.direction, pitchRad) }));
  const others = new Map(answer.others);
  if (numbers) others.set(contract.lamps_name, withDirections(numbers, moved));
  const heads = others.get(contract.heads_name);
  if (heads) others.set(contract.heads_name, withPitch(heads, contract, pitchRad));
  return { logRadiance: turned(answer.logRadiance, lamps, moved, pitchRad), others };
}

/** The map turned, and its lamps drawn where they are then. */
function turned(
  logRadiance: Float32Array,
  lamps: readonly Lamp[],
  moved: readonly Lamp[],
  pitchRad: number,
): Float32Array {
  const size = Math.sqrt(logRadiance.length / 3);
  const [before, after] = [lamps, moved].map((own) => drawn(own, size));
  const soft = logRadiance.map((value, i) => {
    return Math.log(Math.max(Math.exp(value) - before![i]!, LEAST_RADIANCE));
  });
  const result = new Float32Array(logRadiance.length);
  const at: [number, number, number] = [0, 0, 0];
  for (let pixel = 0; pixel < size * size; pixel++) {
    onBall(soft, raised(pixelDirection(pixel, size), -pitchRad), at);
    for (const c of [0, 1, 2] as const) {
      result[3 * pixel + c] = Math.log(Math.exp(at[c]) + after![3 * pixel + c]!);
    }
  }
  return result;
}

function drawn(lamps: readonly Lamp[], size: number): Float32Array {
  const whole = new Float32Array(3 * size * size);
  for (const lamp of lamps) {
    lobeOnBall(lamp, size).forEach((value, i) => {
      whole[i]! += value;
    });
  }
  return whole;
}

/** A direction of the view in the frame of the photo. */
function raised([x, y, z]: Vector3, pitchRad: number): Vector3 {
  const [cos, sin] = [Math.cos(pitchRad), Math.sin(pitchRad)];
  return [x, cos * y - sin * z, sin * y + cos * z];
}

function withDirections(numbers: Dense, lamps: readonly Lamp[]): Dense {
  const data = Float32Array.from(numbers.data);
  lamps.forEach((lamp, i) => {
    data.set(lamp.direction, NUMBERS * i);
  });
  return { ...numbers, data };
}

function withPitch(heads: Dense, contract: Contract, pitchRad: number): Dense {
  const at = (contract.heads as readonly string[]).indexOf("pitch_rad");
  const data = Float32Array.from(heads.data);
  if (at >= 0) data[at]! -= pitchRad;
  return { ...heads, data };
}

/** Whether a photo is upright, and where up is, by what the network says: upright.py, continuation.py. */
import { UPRIGHT } from "../contract/generated.ts";
import type { Vector3 } from "../light/matrix.ts";

const TURNS = [0, 90, 180, 270] as const;

/** By how many degrees clockwise the photo should be turned to be upright, and the chance. */
export function likeliestTurn(heads: Readonly<Record<string, number>>): {
  readonly turn: number;
  readonly chance: number;
} {
  const turns = TURNS.map((turn) => ({ turn, chance: heads[`upright_${turn}`]! }));
  return turns.reduce((best, one) => (one.chance > best.chance ? one : best));
}

/**
 * Where up is in the camera frame, by the network's guess of the pitch. Null where it takes the photo
 * to lie on its side.
 */
export function upOf(heads: Readonly<Record<string, number>>): Vector3 | null {
  const { turn, chance } = likeliestTurn(heads);
  if (turn !== 0 && chance >= UPRIGHT.SURE_CHANCE) return null;
  const pitch = heads.pitch_rad!;
  return [0, Math.cos(pitch), -Math.sin(pitch)];
}

/** Whether a photo is upright, and where up is, by what the network says: upright.py. */
import { UPRIGHT } from "../contract/generated.ts";
import type { Tilt } from "../scene/continuation.ts";

const TURNS = [0, 90, 180, 270] as const;

/** By how many degrees clockwise the photo should be turned to be upright, and the chance. */
export function likeliestTurn(heads: Readonly<Record<string, number>>): {
  readonly turn: number;
  readonly chance: number;
} {
  const turns = TURNS.map((turn) => ({ turn, chance: heads[`upright_${turn}`]! }));
  return turns.reduce((best, one) => (one.chance > best.chance ? one : best));
}

/** The network's guess of the tilt, without roll. Null where it takes the photo to need turning. */
export function guessedTilt(heads: Readonly<Record<string, number>>): Tilt | null {
  const { turn, chance } = likeliestTurn(heads);
  const lying = heads.upright_90! + heads.upright_270!;
  if (turn !== 0 && chance >= UPRIGHT.SURE_CHANCE) return null;
  if (lying >= UPRIGHT.LYING_CHANCE) return null;
  const pitch = heads.pitch_rad!;
  return { up: [0, Math.cos(pitch), -Math.sin(pitch)], scaleRad: heads.pitch_scale! };
}

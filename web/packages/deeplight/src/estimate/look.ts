/** The network's answers to its views of a photo as one, in the photo's frame: look.py. */
import { AGREEING, LEAST_RADIANCE } from "../contract/generated.ts";
import { type Lamp, lampsOf, lobeOnBall, luminous, NUMBERS } from "../light/lamp.ts";
import { dot, transposed, turned, type Vector3 } from "../light/matrix.ts";
import { onBall, pixelDirection } from "../light/mirror-ball.ts";
import type { Contract } from "../network/contract.ts";
import type { Dense } from "../network/onnx.ts";
import { type Framing, isCentred, photoFromView, pitchOf } from "./framing.ts";

/** What a network gives: ln radiance on the mirror ball, and its other outputs by name. */
export interface Answered {
  readonly logRadiance: Float32Array;
  readonly others: ReadonlyMap<string, Dense>;
}

/** Of one view around the photo's centre it is the answer itself. */
export function seenFromPhoto(
  answers: readonly Answered[],
  contract: Contract,
  views: readonly Framing[],
): Answered {
  const first = answers[0]!;
  if (views.length === 1 && isCentred(views[0]!)) return first;
  const radiance = new Float32Array(first.logRadiance.length);
  const size = Math.sqrt(radiance.length / 3);
  const share = 1 / views.length;
  const at: [number, number, number] = [0, 0, 0];
  const all = answers.flatMap(({ logRadiance, others }, i) => {
    const turn = photoFromView(views[i]!);
    const numbers = others.get(contract.lamps_name);
    const lamps = numbers ? lampsOf(numbers) : [];
    const soft = logRadiance.map(Math.exp);
    addLobes(soft, lamps, size, -1);
    const log = soft.map((value) => Math.log(Math.max(value, LEAST_RADIANCE)));
    // Straight ahead is the whole rim: looked up, it is one place of it.
    const isLookedUp = !isCentred(views[i]!);
    const back = transposed(turn);
    for (let pixel = 0; pixel < size * size; pixel++) {
      if (isLookedUp) onBall(log, turned(back, pixelDirection(pixel, size)), at);
      for (const c of [0, 1, 2] as const) {
        const value = isLookedUp ? at[c] : log[3 * pixel + c]!;
        radiance[3 * pixel + c]! += share * Math.exp(value);
      }
    }
    return lamps.map((lamp) => ({
      ...lamp,
      direction: turned(turn, lamp.direction),
      flux: times(lamp.flux, () => share),
    }));
  });
  const lamps = agreeing(all);
  addLobes(radiance, lamps, size, 1);
  const others = new Map(first.others);
  if (lamps.length > 0) others.set(contract.lamps_name, numbersOf(lamps));
  const heads = first.others.get(contract.heads_name);
  if (heads) {
    const pitch = (contract.heads as readonly string[]).indexOf("pitch_rad");
    const data = heads.data.map((_, i) =>
      answers.reduce((sum, answer, view) => {
        const value = answer.others.get(contract.heads_name)!.data[i]!;
        return sum + share * (value - (i === pitch ? pitchOf(views[view]!) : 0));
      }, 0),
    );
    others.set(contract.heads_name, { ...heads, data });
  }
  return { logRadiance: radiance.map(Math.log), others };
}

function addLobes(map: Float32Array, lamps: readonly Lamp[], size: number, gain: number): void {
  for (const lamp of lamps) {
    lobeOnBall(lamp, size).forEach((value, i) => {
      map[i]! += gain * value;
    });
  }
}

/** Lamps with the same flux together, more of it where they point alike; the strongest first. */
export function agreeing(lamps: readonly Lamp[]): readonly Lamp[] {
  const sums = (weights: readonly number[]): readonly number[] =>
    [0, 1, 2].map((c) => {
      const sum = lamps.reduce((sum, { flux }, i) => sum + weights[i]! * flux[c]!, 0);
      return Math.max(sum, LEAST_RADIANCE);
    });
  const whole = sums(lamps.map(() => 1));
  const alike = lamps.map(({ direction }) => {
    const near = lamps.map((other) =>
      Math.exp(AGREEING.NEARNESS * (dot(direction, other.direction) - 1)),
    );
    return sums(near).reduce((sum, value, c) => sum + value / whole[c]!, 0);
  });
  const most = Math.max(...alike);
  const trust = alike.map((value) => (value / most) ** AGREEING.TRUST);
  const trusted = sums(trust);
  const found = lamps.map((lamp, i) => ({
    ...lamp,
    flux: times(lamp.flux, (c) => (trust[i]! * whole[c]!) / trusted[c]!),
  }));
  const strongest = Math.max(...found.map(({ flux }) => luminous(flux)));
  return found
    .filter(({ flux }) => luminous(flux) >= AGREEING.LEAST_FLUX * strongest)
    .sort((a, b) => luminous(b.flux) - luminous(a.flux));
}

function times([red, green, blue]: Vector3, gain: (channel: number) => number): Vector3 {
  return [red * gain(0), green * gain(1), blue * gain(2)];
}

/** As a network gives them. */
function numbersOf(lamps: readonly Lamp[]): Dense {
  const numbers = lamps.flatMap(({ direction, flux, angularRadiusRad }) => [
    ...direction,
    ...flux.map(Math.log),
    angularRadiusRad,
  ]);
  return { shape: [1, lamps.length, NUMBERS], data: Float32Array.from(numbers) };
}

/** How sure an estimate is: how much the answers to the same photo, flipped and cropped, differ. confidence.py. */
import { CONFIDENCE, SURENESS_LIMITS } from "../contract/generated.ts";
import { luminous } from "../light/lamp.ts";
import { findMainLight } from "../light/main-light.ts";
import { dot, type Vector3 } from "../light/matrix.ts";
import { powerOfBall, solidAngles } from "../light/mirror-ball.ts";
import type { Contract } from "../network/contract.ts";
import type { Dense } from "../network/onnx.ts";
import type { PlacedPhoto } from "../scene/image-plane.ts";
import type { Framing } from "./framing.ts";

export type Word = "roughly known" | "not known";

/**
 * How far off the light may be: by the network's own word, which holds for two of three such photos;
 * of a network without heads, how far its answers to the same photo flipped and cropped differ.
 */
export interface Confidence {
  readonly directionDeg: number;
  readonly brightnessStops: number;
  readonly colourDeg: number;
  /** Whether a main light stands out at all. */
  readonly hasDirection: boolean;
  readonly words: { readonly direction: Word; readonly brightness: Word; readonly colour: Word };
  /** What is wrong with the photo itself, in words. */
  readonly warnings: readonly string[];
}

const { BLANK_LEVELS, BRIGHTNESS_STOPS, DIRECTION_DEG, FAINT_SHARE } = CONFIDENCE;
/** Size of the cuts and how far they lie to the right, as parts of the trained view. */
export const CROPS = CONFIDENCE.CROPS;
const DEGREES = 180 / Math.PI;

/** The framing of a smaller view, as if it were the trained one. */
export function cutFraming(framing: Framing, [size, right]: readonly [number, number]): Framing {
  const [height, width] = [framing.bottom - framing.top, framing.right - framing.left];
  const [down, across] = [(height * (1 - size)) / 2, (width * (1 - size)) / 2];
  return {
    ...framing,
    top: framing.top + down,
    bottom: framing.bottom - down,
    left: framing.left + across + right * width,
    right: framing.right - across + right * width,
  };
}

/** The network's input of the mirrored photo. */
export function mirroredPlanes(planes: Float32Array, { width }: Contract): Float32Array {
  return planes.map((_, i) => planes[i - (i % width) + (width - 1 - (i % width))]!);
}

/** A ball of light seen in a mirror: u becomes -u. */
export function mirroredBall(ball: Float32Array): Float32Array {
  const width = Math.sqrt(ball.length / 3);
  return ball.map((_, i) => {
    const [pixel, c] = [Math.floor(i / 3), i % 3];
    return ball[3 * (pixel - (pixel % width) + (width - 1 - (pixel % width))) + c]!;
  });
}

/** @param answers ln radiance, like the first's, of the photo flipped (and flipped back) and cropped. */
export function confidenceOf(
  first: Float32Array,
  answers: readonly Float32Array[],
  photo: PlacedPhoto,
): Confidence {
  const all = [first, ...answers].map(aboutBall);
  const [own, ...others] = all as [About, ...About[]];
  const mean = (values: readonly number[]) => values.reduce((a, b) => a + b) / values.length;
  const stops = all.map(({ power }) => Math.log2(Math.max(luminous(power), 1e-12)));
  const directionDeg = mean(others.map(({ direction }) => angleDeg(own.direction, direction)));
  const brightnessStops = Math.sqrt(mean(stops.map((value) => (value - mean(stops)) ** 2)));
  const colourDeg = mean(others.map(({ power }) => angleDeg(own.power, power)));
  const hasDirection = own.share > FAINT_SHARE;
  const warnings = warningsOf(photo);
  const isUnfit = warnings.length > 0;
  const word = (isVague: boolean): Word => (isUnfit || isVague ? "not known" : "roughly known");
  const words = {
    direction: word(!hasDirection || directionDeg >= DIRECTION_DEG),
    brightness: word(brightnessStops >= BRIGHTNESS_STOPS),
    colour: word(false),
  };
  return { directionDeg, brightnessStops, colourDeg, hasDirection, words, warnings };
}

/** What a network says besides light, by name; null where it has no such output. */
export function headsIn(
  others: ReadonlyMap<string, Dense>,
  { heads, heads_name }: Contract,
): Readonly<Record<string, number>> | null {
  const output = others.get(heads_name);
  if (!output || heads.length === 0) return null;
  return Object.fromEntries(heads.map((name, i) => [name, output.data[i]!]));
}

/** By the network's own word: sureness.py. */
export function surenessOf(
  heads: Readonly<Record<string, number>>,
  logRadiance: Float32Array,
  photo: PlacedPhoto,
): Confidence {
  const hasDirection = aboutBall(logRadiance).share > FAINT_SHARE;
  const warnings = warningsOf(photo);
  const scales = {
    direction: heads.direction_scale! * DEGREES,
    brightness: heads.brightness_scale! / Math.LN2,
    colour: heads.colour_scale! * DEGREES,
  };
  const word = (name: keyof typeof scales): Word => {
    const isVague = scales[name] >= SURENESS_LIMITS[name] || warnings.length > 0;
    return isVague || (name === "direction" && !hasDirection) ? "not known" : "roughly known";
  };
  return {
    directionDeg: scales.direction,
    brightnessStops: scales.brightness,
    colourDeg: scales.colour,
    hasDirection,
    words: {
      direction: word("direction"),
      brightness: word("brightness"),
      colour: word("colour"),
    },
    warnings,
  };
}

interface About {
  readonly direction: Vector3;
  readonly share: number;
  readonly power: Vector3;
}

function aboutBall(log: Float32Array): About {
  const size = Math.sqrt(log.length / 3);
  const sr = solidAngles(size);
  const radiance = log.map((value, i) => (sr[Math.floor(i / 3)]! > 0 ? Math.exp(value) : 0));
  const { direction, share } = findMainLight(radiance, size);
  return { direction, share, power: powerOfBall(radiance, size) };
}

/** What makes a photo unfit to estimate light from, in words. */
function warningsOf({ pixels, width, height }: PlacedPhoto): string[] {
  const [down, across] = [height, width].map((n) => Math.max(1, Math.floor(n / 64)));
  const grey: number[] = [];
  for (let row = 0; row < height; row += down!) {
    for (let column = 0; column < width; column += across!) {
      const at = 3 * (row * width + column);
      grey.push((255 * (pixels[at]! + pixels[at + 1]! + pixels[at + 2]!)) / 3);
    }
  }
  const mean = grey.reduce((a, b) => a + b) / grey.length;
  const spread = Math.sqrt(grey.reduce((sum, value) => sum + (value - mean) ** 2, 0) / grey.length);
  grey.sort((a, b) => a - b);
  const part = (share: number) => grey[Math.round(share * (grey.length - 1))]!;
  if (spread < BLANK_LEVELS) {
    const kind = mean < 16 ? "black" : mean > 239 ? "white" : "of one colour";
    return [`the photo is ${kind} all over: its light is a guess`];
  }
  if (part(0.9) < 16) return ["the photo is almost black: its light is a guess"];
  if (part(0.1) > 250) {
    return ["the photo is almost all clipped: its light is at least this bright"];
  }
  return [];
}

function angleDeg(a: Vector3, b: Vector3): number {
  const cosine = dot(a, b) / Math.max(Math.hypot(...a) * Math.hypot(...b), 1e-12);
  return Math.acos(Math.min(Math.max(cosine, -1), 1)) * DEGREES;
}

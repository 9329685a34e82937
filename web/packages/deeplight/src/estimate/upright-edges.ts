/** The camera's tilt by the photo's edges: upright ones run towards the point above our heads. upright_edges.py. */
import { UPRIGHT_EDGES } from "../contract/generated.ts";
import type { Size } from "../light/means.ts";
import type { Tilt } from "../scene/continuation.ts";
import { evenly, type ImagePlane } from "../scene/image-plane.ts";
import { type Grid, wholePhoto } from "./cell-means.ts";
import { guessedTilt } from "./upright.ts";

const { AGREES_RAD, FEWEST, HELD_PITCH_RAD, HELD_SCALE_RAD, LEAST_EVIDENCE } = UPRIGHT_EDGES;
const { LEAST_SCALE_RAD, LEAST_STEP, MOST, PITCHES_DEG, ROLL_RAD, ROLLS_DEG } = UPRIGHT_EDGES;
const { ROLLED, ROLLED_RAD, SIDE, SPREAD, STEEPEST_LEAN, SURE_RAD, TRUST } = UPRIGHT_EDGES;

/** A picture in which edges are looked for: RGB, 0 to 255, of cells of a photo. */
export interface EdgePicture {
  readonly grid: Grid;
  readonly pixels: Float32Array;
}

interface Edge {
  /** Right and up on the plane at distance 1. */
  readonly x: number;
  readonly y: number;
  /** What runs across it in the picture, right and up, by how far off it may be. */
  readonly right: number;
  readonly up: number;
  readonly steepness: number;
}

interface Held {
  readonly pitch: number;
  readonly roll: number;
}

const TILTS: readonly Held[] = radians(PITCHES_DEG).flatMap((pitch) =>
  radians(ROLLS_DEG).map((roll) => ({ pitch, roll })),
);

/**
 * The tilt by the network's guess, and by upright edges where that is not sure. Null where neither
 * says anything, and of a photo that seems to need turning: upright edges lie there.
 */
export async function seenTilt(
  heads: Readonly<Record<string, number>> | null,
  plane: ImagePlane,
  picture: () => Promise<EdgePicture>,
): Promise<Tilt | null> {
  const guess = heads && guessedTilt(heads);
  if (guess ? guess.scaleRad < SURE_RAD : heads) return guess;
  return tiltWithEdges(await picture(), plane, guess);
}

/** Square cells of whole pixels, some 256 along the longer side. */
export function edgeGrid({ width, height }: Size): Grid {
  const step = Math.max(1, evenly(Math.max(width, height) / SIDE));
  const cells = {
    width: Math.max(Math.floor(width / step), 1),
    height: Math.max(Math.floor(height / step), 1),
  };
  const all = wholePhoto({ width, height }, cells);
  return { ...all, right: step * cells.width, bottom: step * cells.height };
}

/**
 * The mean of all tilts by how likely they are: those that the guess thinks likely and edges agree
 * with. Without enough edges the guess comes back.
 *
 * @param plane where the whole photo lies.
 * @param guess left out, how cameras are held.
 */
function tiltWithEdges(picture: EdgePicture, plane: ImagePlane, guess: Tilt | null): Tilt | null {
  const edges = uprightEdges(picture, plane);
  if (edges.length < FEWEST) return guess;
  const scores = TILTS.map((tilt) => agreement(edges, upOf(tilt)));
  const sorted = Float64Array.from(scores).sort();
  if (sorted.at(-1)! - sorted[sorted.length >> 1]! < LEAST_EVIDENCE) return guess;
  const pitch = guess ? Math.asin(-guess.up[2]) : HELD_PITCH_RAD;
  const scale = Math.max(guess ? guess.scaleRad : HELD_SCALE_RAD, LEAST_SCALE_RAD);
  const likely = TILTS.map((tilt, i) => {
    const off = (tilt.pitch - pitch) / scale;
    const held = bell(tilt.roll / ROLL_RAD) + ROLLED * bell(tilt.roll / ROLLED_RAD);
    return TRUST * scores[i]! - off ** 2 / 2 + Math.log(held);
  });
  const most = Math.max(...likely);
  const chance = likely.map((value) => Math.exp(value - most));
  const whole = chance.reduce((a, b) => a + b);
  const mean = (value: (tilt: Held) => number) =>
    TILTS.reduce((sum, tilt, i) => sum + chance[i]! * value(tilt), 0) / whole;
  const found = { pitch: mean((tilt) => tilt.pitch), roll: mean((tilt) => tilt.roll) };
  const spread = Math.sqrt(mean((tilt) => (tilt.pitch - found.pitch) ** 2));
  return { up: upOf(found), scaleRad: Math.max(spread, LEAST_SCALE_RAD) };
}

/** The strongest edges that lean little. */
function uprightEdges({ grid, pixels }: EdgePicture, plane: ImagePlane): readonly Edge[] {
  const { inputWidth: width, inputHeight: height, photoWidth, photoHeight } = grid;
  const step = grid.right / width;
  const grey = Uint8Array.from({ length: width * height }, (_, i) => {
    // Rounded twice, as Pillow's.
    const level = (channel: number) => Math.floor(pixels[3 * i + channel]! + 0.5);
    return (19595 * level(0) + 38470 * level(1) + 7471 * level(2)) / 65536 + 0.5;
  });
  const edges: Edge[] = [];
  for (let row = 1; row < height - 1; row++) {
    for (let column = 1; column < width - 1; column++) {
      const at = row * width + column;
      // Sobel's, times 8: across a line, the mean of three along it.
      const sum = (first: number, by: number) =>
        grey[first - by]! + 2 * grey[first]! + grey[first + by]!;
      const right = sum(at + 1, width) - sum(at - 1, width);
      const up = sum(at - width, 1) - sum(at + width, 1);
      if (Math.abs(right) <= 8 * LEAST_STEP) continue;
      if (Math.abs(up) >= STEEPEST_LEAN * Math.abs(right)) continue;
      const x = (((column + 0.5) * step * 2) / photoWidth - 1) * plane.halfWidth;
      const y = (1 - ((row + 0.5) * step * 2) / photoHeight) * plane.halfHeight;
      const scale = right / (right ** 2 + up ** 2) / Math.sin(AGREES_RAD);
      const steepness = Math.hypot(right, up);
      edges.push({ x, y, right: right * scale, up: up * scale, steepness });
    }
  }
  return edges.sort((a, b) => b.steepness - a.steepness).slice(0, MOST);
}

/** How much of the edges runs along the vertical of a tilt, in standard deviations of chance. */
function agreement(edges: readonly Edge[], [right, up, back]: Tilt["up"]): number {
  let [sum, square] = [0, 0];
  for (const edge of edges) {
    // Seen at (x, y), a step up moves by (right + x back, up + y back) on the plane.
    const off = (edge.right * (right + edge.x * back)) / (up + edge.y * back) + edge.up;
    const near = Math.max(1 - off * off, 0);
    sum += Math.sqrt(edge.steepness) * near * near; // a bright lamp's edge is no better than a door's
    square += edge.steepness;
  }
  return sum / Math.sqrt(SPREAD * square);
}

function bell(deviations: number): number {
  return Math.exp(-(deviations ** 2) / 2);
}

/** Against gravity, camera frame. */
function upOf({ pitch, roll }: Held): Tilt["up"] {
  const level = Math.cos(pitch);
  return [level * Math.sin(roll), level * Math.cos(roll), -Math.sin(pitch)];
}

function radians([from, to, step]: readonly [number, number, number]): readonly number[] {
  const count = Math.ceil((to - from) / step);
  return Array.from({ length: count }, (_, i) => ((from + i * step) * Math.PI) / 180);
}

/** The main light as one would say it, for who does not see the panel. */
import type { MainLight } from "deeplight/core";

const SIDES = [
  "ahead",
  "ahead on the right",
  "the right",
  "behind on the right",
  "behind",
  "behind on the left",
  "the left",
  "ahead on the left",
] as const;
const FAINT = 0.1;

export function inWords({ direction: [right, up, back], share }: MainLight): string {
  if (share < FAINT) return "It comes evenly from all sides.";
  const aboveDeg = Math.round((Math.asin(Math.max(-1, Math.min(1, up))) * 180) / Math.PI);
  const eighth = Math.round(Math.atan2(right, -back) / (Math.PI / 4));
  const side = aboveDeg > 75 ? "above" : SIDES[(eighth + 8) % 8];
  const height = aboveDeg >= 0 ? `${aboveDeg} degrees up` : `${-aboveDeg} degrees down`;
  return `The main light comes from ${side}, ${height}.`;
}

/** The main light as one would say it, for who does not see the panel. */
import type { Confidence, MainLight } from "deeplight/core";

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

/** What is not known of a photo's light; empty where all of it is, roughly. */
export function unsureOf({ words, warnings }: Confidence): string {
  const [warning] = warnings;
  if (warning) return `${warning[0]!.toUpperCase()}${warning.slice(1)}.`;
  const vague = (["direction", "brightness", "colour"] as const).filter(
    (name) => words[name] === "not known",
  );
  if (vague.length > 1) return `Unsure: ${vague.join(", ")}`; // one line of a phone's screen
  return vague[0] ? `Unsure: ${vague[0]} of the light` : "";
}

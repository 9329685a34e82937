/** The ring that shows which way one has looked: the top is ahead. */
import { type Environment, type Matrix3x3, rowSolidAngles } from "deeplight/core";

export const SECTORS = 24;
const BAND_RAD = Math.PI / 4; // above and below the horizon

/** How much of each sector was seen, 0 to 1, from ahead of the camera clockwise. */
export function sectorsSeen({ seen, height }: Environment, worldFromCamera: Matrix3x3): number[] {
  const heading = Math.atan2(-worldFromCamera[2], worldFromCamera[8]);
  const sr = rowSolidAngles(height);
  const [sum, whole] = [new Array<number>(SECTORS).fill(0), new Array<number>(SECTORS).fill(0)];
  for (let row = 0; row < height; row++) {
    const elevation = Math.PI / 2 - ((row + 0.5) * Math.PI) / height;
    if (Math.abs(elevation) > BAND_RAD) continue;
    for (let column = 0; column < 2 * height; column++) {
      const azimuth = ((column + 0.5) * Math.PI) / height - Math.PI - heading;
      const at = (Math.round((azimuth / (2 * Math.PI)) * SECTORS) + 2 * SECTORS) % SECTORS;
      sum[at]! += sr[row]! * seen[row * 2 * height + column]!;
      whole[at]! += sr[row]!;
    }
  }
  return sum.map((value, i) => value / whole[i]!);
}

export function drawRing(onto: HTMLCanvasElement, sectors: readonly number[]): void {
  const context = onto.getContext("2d");
  if (!context) return;
  const middle = onto.width / 2;
  context.clearRect(0, 0, onto.width, onto.height);
  context.lineWidth = 0.2 * middle;
  sectors.forEach((seen, i) => {
    const from = ((i - 0.5 + 0.08) / SECTORS) * 2 * Math.PI - Math.PI / 2;
    const to = ((i + 0.5 - 0.08) / SECTORS) * 2 * Math.PI - Math.PI / 2;
    context.strokeStyle = `rgb(255 196 107 / ${Math.round(18 + 82 * Math.min(1, 1.4 * seen))}%)`;
    context.beginPath();
    context.arc(middle, middle, 0.78 * middle, from, to);
    context.stroke();
  });
  context.fillStyle = "#f4f1ea"; // where one looks
  context.beginPath();
  context.moveTo(middle, 0.3 * middle);
  context.lineTo(0.8 * middle, 0.72 * middle);
  context.lineTo(1.2 * middle, 0.72 * middle);
  context.fill();
}

/** A panorama and its ever coarser averages, for reflections that are sharp or not. */
import { type Environment, resized } from "deeplight/core";
import type { Level } from "./ball-levels.ts";

/** Coarser ones are the ball's: a panorama's poles would show. */
const COARSEST_ROWS = 16;

export function panoramaLevels({ radiance, height }: Environment): Level[] {
  const levels: Level[] = [{ size: height, rgb: radiance }];
  for (let rows = height; rows % 2 === 0 && rows > COARSEST_ROWS; rows /= 2) {
    levels.push({ size: rows / 2, rgb: resized(levels.at(-1)!.rgb, rows, rows / 2) });
  }
  return levels;
}

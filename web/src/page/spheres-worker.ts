/** Makes the spheres' bases off the main thread: see `prepare-spheres.ts`. */
import { LIGHTING_SIZE, makeBasis, SPHERES } from "deeplight/core";

const made = SPHERES.map((name) => [name, makeBasis(name, LIGHTING_SIZE)] as const);
self.postMessage(made, {
  transfer: made.flatMap(([, { start, light, weight }]) => [
    start.buffer,
    light.buffer,
    weight.buffer,
  ]),
});

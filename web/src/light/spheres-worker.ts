/** Makes the spheres' bases off the main thread: see `prepareSpheres`. */
import { makeBasis, SPHERES } from "./spheres.ts";

const made = SPHERES.map((name) => [name, makeBasis(name)] as const);
self.postMessage(made, {
  transfer: made.flatMap(([, { start, light, weight }]) => [
    start.buffer,
    light.buffer,
    weight.buffer,
  ]),
});

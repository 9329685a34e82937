/** Makes the spheres' bases off the main thread: see `prepareSpheres`. */
import { LIGHTING_SIZE } from "../contract/generated.ts";
import { makeBasis, SPHERES } from "./spheres.ts";

const made = SPHERES.map((name) => [name, makeBasis(name, LIGHTING_SIZE)] as const);
self.postMessage(made, {
  transfer: made.flatMap(([, { start, light, weight }]) => [
    start.buffer,
    light.buffer,
    weight.buffer,
  ]),
});

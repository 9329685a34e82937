/** Makes the three spheres' bases in a worker, so that drawing them never waits for that. */
import { type Basis, keepBasis, LIGHTING_SIZE, type SphereName } from "deeplight/core";

export async function prepareSpheres(): Promise<void> {
  const worker = new Worker(new URL("./spheres-worker.ts", import.meta.url), { type: "module" });
  try {
    await new Promise<void>((done, failed) => {
      worker.onmessage = ({ data }: MessageEvent<[SphereName, Basis][]>) => {
        for (const [name, basis] of data) keepBasis(name, LIGHTING_SIZE, basis);
        done();
      };
      worker.onerror = (event) => failed(new Error(event.message));
    });
  } finally {
    worker.terminate();
  }
}

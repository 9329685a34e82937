/**
 * What an estimate and what is done with it cost on one core, in the JavaScript engine of Chromium:
 * npm run bench. Processor time, so that other work on the machine counts less.
 */
import { readFileSync } from "node:fs";
import * as ort from "onnxruntime-web/wasm";
import { beforeAll, test } from "vitest";
import { CONTRACT } from "../packages/deeplight/src/contract/generated.ts";
import { CellMeans } from "../packages/deeplight/src/estimate/cell-means.ts";
import { framePhoto } from "../packages/deeplight/src/estimate/framing.ts";
import { Lighting } from "../packages/deeplight/src/light/lighting.ts";
import { IDENTITY } from "../packages/deeplight/src/light/matrix.ts";
import { Smoother } from "../packages/deeplight/src/light/smoother.ts";
import { relit, SPHERES } from "../packages/deeplight/src/light/spheres.ts";
import { Network } from "../packages/deeplight/src/network/network.ts";
import { floats, golden } from "../tests/golden.ts";

const WARM_UP = 10;
const radiance = floats(golden("light").radiance);
const turn = golden("light").turn;

test("the network", async () => {
  const model = new URL("../../src/deeplight/weights/deeplight.onnx", import.meta.url);
  const network = await Network.open(new Uint8Array(readFileSync(model)));
  const planes = new Float32Array(3 * CONTRACT.height * CONTRACT.width);
  await report("one run of the network", 100, () => network.logRadiance(planes));
  ort.env.wasm.numThreads = 1;
  const session = await ort.InferenceSession.create(new Uint8Array(readFileSync(model)));
  const shape = [1, 3, CONTRACT.height, CONTRACT.width];
  const feeds = { [CONTRACT.input_name]: new ort.Tensor("float32", planes, shape) };
  await report("the same by onnxruntime-web", 100, () => session.run(feeds));
});

test.each([
  [720, 1280],
  [1080, 1920],
  [3024, 4032],
])("the pixels of a frame of %i x %i", async (width, height) => {
  const framing = framePhoto(height, width, undefined, CONTRACT);
  const part = new CellMeans(framing);
  const pixels = new Uint8ClampedArray(4 * part.width * part.height).map((_, i) => i * 7);
  await report(`averages of ${width} x ${height}`, width > 2000 ? 5 : 50, () => {
    const means = new CellMeans(framing);
    means.add(pixels, means.top);
    means.planes(CONTRACT.input_low, CONTRACT.input_high);
  });
});

test("what is made of a light", async () => {
  const each: [string, (light: Lighting) => unknown][] = [
    ["harmonics of order 4", (light) => light.harmonics(4)],
    ["main light", (light) => light.mainLight()],
    ["turned", (light) => light.turned(turn)],
    ["panorama of 128 rows", (light) => light.equirect(128)],
    ...SPHERES.map((name): [string, (light: Lighting) => unknown] => [
      `sphere: ${name}`,
      (light) => relit(name, light.radiance()),
    ]),
  ];
  for (const [name, make] of each) {
    await report(name, 20, () => make(Lighting.fromRadiance(radiance)));
  }
  const smoother = new Smoother();
  const light = Lighting.fromRadiance(radiance);
  let time = 0;
  await report("smoothed, camera still", 50, () => smoother.next(light, time++, IDENTITY));
});

beforeAll(() => {
  console.log(`node ${process.version}; milliseconds of processor time: fastest, median`);
});

async function report(name: string, count: number, act: () => unknown): Promise<void> {
  for (let i = 0; i < Math.min(WARM_UP, count); i++) await act();
  const times: number[] = [];
  for (let i = 0; i < count; i++) {
    const before = process.cpuUsage();
    await act();
    const { user, system } = process.cpuUsage(before);
    times.push((user + system) / 1000);
  }
  times.sort((a, b) => a - b);
  const shown = [times[0]!, times[count >> 1]!].map((ms) => ms.toFixed(1).padStart(7));
  console.log(`${name.padEnd(28)} ${shown.join("")}`);
}

/** What the browser tests call: the estimator, on frames made from plain pixels. */

import { EstimateError } from "../../packages/deeplight/src/errors.ts";
import { Estimator } from "../../packages/deeplight/src/estimate/estimator.ts";
import { noise } from "../noise.ts";

const estimators: Estimator[] = [];

const harness = {
  /** Loads a model; gives "ok" or the error's kind, and what was reported of the progress. */
  async load(model: string): Promise<{ got: string; progress: number[][] }> {
    const progress: number[][] = [];
    try {
      const estimator = Estimator.start({
        model: new URL(model, location.href),
        worker: () =>
          new Worker(new URL("../../packages/deeplight/src/worker.ts", import.meta.url), {
            type: "module",
          }),
        onProgress: (...at) => progress.push(at),
      });
      await estimator.loaded;
      estimators.push(estimator);
      return { got: "ok", progress };
    } catch (error) {
      return { got: error instanceof EstimateError ? error.kind : String(error), progress };
    }
  },

  facts: () => newest().model!,

  async logRadiance(base64: string, width: number, height: number): Promise<number[]> {
    const estimate = await newest().estimate(await bitmap(base64, width, height));
    return Array.from(estimate!.lighting.logRadiance);
  },

  /** Of a frame of noise, made on both sides by the same rule. */
  async ofNoise(width: number, height: number): Promise<number[]> {
    const frame = await createImageBitmap(new ImageData(noise(width, height), width, height));
    return Array.from((await newest().estimate(frame))!.lighting.logRadiance);
  },

  /** Sends frames faster than they can be estimated; returns which came through. */
  async burst(count: number): Promise<boolean[]> {
    const frames = Array.from({ length: count }, () => blank(90, 160));
    const results = (await Promise.all(frames)).map((frame) => newest().estimate(frame));
    return (await Promise.all(results)).map((estimate) => estimate !== null);
  },

  /** Milliseconds of `count` frames of a size: for each what the worker says. */
  async time(width: number, height: number, count: number): Promise<[number, number][]> {
    const times: [number, number][] = [];
    for (let i = 0; i < count; i++) {
      const { preprocessMs, runMs } = (await newest().estimate(await blank(width, height)))!;
      times.push([preprocessMs, runMs]);
    }
    return times;
  },

  /** The longest that the page itself had to wait for a turn while `count` frames were estimated. */
  async longestPause(count: number): Promise<number> {
    let [longest, last, running] = [0, performance.now(), true];
    const watch = () => {
      longest = Math.max(longest, performance.now() - last);
      last = performance.now();
      if (running) setTimeout(watch, 0);
    };
    watch();
    await this.time(90, 160, count);
    running = false;
    return longest;
  },

  /** For each frame of a film, grey values of flat pictures, whether the network was asked. */
  async asked(greys: readonly number[], yawsRad: readonly number[]): Promise<boolean[]> {
    const estimator = newest();
    const asked: boolean[] = [];
    for (const [i, grey] of greys.entries()) {
      const [c, s] = [Math.cos(yawsRad[i]!), Math.sin(yawsRad[i]!)];
      const worldFromCamera = [c, 0, s, 0, 1, 0, -s, 0, c] as const;
      const request = { worldFromCamera, start: worldFromCamera, rows: 0 };
      const tracked = await estimator.track(await flat(grey), undefined, request);
      asked.push(tracked!.added !== null && !tracked!.isStill);
    }
    estimator.leavePlace();
    return asked;
  },

  async closed(): Promise<(boolean | null)[]> {
    const estimator = estimators.pop()!;
    const before = estimator.estimate(await blank(90, 160));
    estimator.close();
    const after = estimator.estimate(await blank(90, 160));
    return (await Promise.all([before, after])).map((estimate) => estimate === null);
  },
};

export type Harness = typeof harness;

Object.assign(window, { harness });

function newest(): Estimator {
  return estimators.at(-1)!;
}

function bitmap(base64: string, width: number, height: number): Promise<ImageBitmap> {
  const rgb = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const pixels = new ImageData(width, height);
  pixels.data.fill(255);
  rgb.forEach((value, i) => {
    pixels.data[4 * Math.floor(i / 3) + (i % 3)] = value;
  });
  return createImageBitmap(pixels);
}

function flat(grey: number): Promise<ImageBitmap> {
  const canvas = new OffscreenCanvas(90, 160);
  const context = canvas.getContext("2d")!;
  context.fillStyle = `rgb(${grey} ${grey} ${grey})`;
  context.fillRect(0, 0, 90, 160);
  return createImageBitmap(canvas);
}

function blank(width: number, height: number): Promise<ImageBitmap> {
  const canvas = new OffscreenCanvas(width, height);
  const context = canvas.getContext("2d")!;
  context.fillStyle = "#7a8";
  context.fillRect(0, 0, width, height / 2);
  return createImageBitmap(canvas);
}

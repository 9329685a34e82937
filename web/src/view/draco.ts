/** Draco's decoder as three.js's GLTFLoader wants it, from our own files only. */
import { BufferAttribute, BufferGeometry } from "three";
import type { NumberType, Wanted } from "./draco-decode.ts";
import type { DracoAnswer, DracoJob } from "./draco-worker.ts";

export class DracoUnpacker {
  private readonly worker: Worker;
  private readonly waiting = new Map<number, (answer: DracoAnswer) => void>();
  private count = 0;

  constructor() {
    this.worker = new Worker(new URL("./draco-worker.ts", import.meta.url), { type: "module" });
    this.worker.onmessage = ({ data }: MessageEvent<DracoAnswer>) => {
      this.waiting.get(data.number)?.(data);
      this.waiting.delete(data.number);
    };
    this.worker.onerror = (event) => {
      for (const [number, done] of this.waiting) done({ number, failed: event.message });
      this.waiting.clear();
    };
  }

  preload(): void {}

  /** The names and the order are GLTFLoader's. */
  decodeDracoFile(
    bytes: ArrayBuffer,
    done: (geometry: BufferGeometry) => void,
    ids: Readonly<Record<string, number>>,
    types: Readonly<Record<string, NumberType>>,
    _colours: string,
    failed: (error: Error) => void,
  ): void {
    const number = this.count++;
    const wanted: Wanted = Object.fromEntries(
      Object.entries(ids).map(([name, id]) => [name, { id, type: types[name] ?? "Float32Array" }]),
    );
    this.waiting.set(number, (answer) => {
      if ("failed" in answer) failed(new Error(answer.failed));
      else done(geometryOf(answer.decoded));
    });
    this.worker.postMessage({ number, bytes, wanted } satisfies DracoJob);
  }

  dispose(): void {
    this.worker.terminate();
  }
}

function geometryOf({ index, attributes }: Extract<DracoAnswer, { decoded: unknown }>["decoded"]) {
  const geometry = new BufferGeometry();
  geometry.setIndex(new BufferAttribute(index, 1));
  for (const [name, { array, itemSize }] of Object.entries(attributes)) {
    geometry.setAttribute(name, new BufferAttribute(array, itemSize));
  }
  return geometry;
}

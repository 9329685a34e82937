/** Draco's decoder as three.js's GLTFLoader wants it, from our own files only. */
import { BufferAttribute, BufferGeometry } from "three";
import { AskedWorker } from "./asked-worker.ts";
import type { Decoded, NumberType, Wanted } from "./draco-decode.ts";
import type { DracoJob } from "./draco-worker.ts";

export class DracoUnpacker {
  private readonly worker = new AskedWorker<DracoJob, Decoded>(
    new Worker(new URL("./draco-worker.ts", import.meta.url), { type: "module" }),
  );

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
    const wanted: Wanted = Object.fromEntries(
      Object.entries(ids).map(([name, id]) => [name, { id, type: types[name] ?? "Float32Array" }]),
    );
    this.worker.ask({ bytes, wanted }).then((decoded) => done(geometryOf(decoded)), failed);
  }

  dispose(): void {
    this.worker.dispose();
  }
}

function geometryOf({ index, attributes }: Decoded): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setIndex(new BufferAttribute(index, 1));
  for (const [name, { array, itemSize }] of Object.entries(attributes)) {
    geometry.setAttribute(name, new BufferAttribute(array, itemSize));
  }
  return geometry;
}

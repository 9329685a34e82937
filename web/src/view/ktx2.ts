/** KTX2 textures as three.js's GLTFLoader wants them, from our own files only. */
import { Texture } from "three";
import { AskedWorker } from "./asked-worker.ts";
import type { DecodedImage } from "./ktx2-decode.ts";

export class Ktx2Unpacker {
  /** By this GLTFLoader knows that `parse` takes bytes. */
  readonly isKTX2Loader = true;
  /** The first thing that went wrong: GLTFLoader goes on without a texture. */
  problem: Error | null = null;
  private readonly worker = new AskedWorker<ArrayBuffer, DecodedImage>(
    new Worker(new URL("./ktx2-worker.ts", import.meta.url), { type: "module" }),
  );

  parse(
    bytes: ArrayBuffer,
    done: (texture: Texture) => void,
    failed: (error: unknown) => void,
  ): void {
    this.unpacked(bytes).then(done, (error: Error) => {
      this.problem ??= error;
      failed(error);
    });
  }

  /** A texture in another file; those are never fetched. */
  load(url: string, _done: unknown, _progress: unknown, failed: (error: Error) => void): void {
    this.problem ??= new Error(`the file refers to ${url}`);
    failed(this.problem);
  }

  dispose(): void {
    this.worker.dispose();
  }

  private async unpacked(bytes: ArrayBuffer): Promise<Texture> {
    const { pixels, width, height } = await this.worker.ask(bytes);
    const image = new ImageData(pixels, width, height);
    const as = { premultiplyAlpha: "none", colorSpaceConversion: "none" } as const;
    const texture = new Texture(await createImageBitmap(image, as));
    texture.needsUpdate = true;
    return texture;
  }
}

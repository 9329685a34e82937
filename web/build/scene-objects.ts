import { readdirSync, readFileSync } from "node:fs";
import path from "node:path";
import { type Plugin, runnerImport } from "vite";

type Written = typeof import("../src/handoff/scene-files.ts");
type Read = typeof import("../src/transfer/format.ts");

/**
 * Writes the built-in objects as glTF next to the page, for Scene Viewer: by the page's own reader.
 *
 * @param core the library's source.
 */
export function sceneObjects(folder: string, core: string): Plugin {
  const config = { configFile: false, resolve: { alias: { "deeplight/core": core } } } as const;
  return {
    name: "deeplight:scene-objects",
    apply: "build",
    async generateBundle() {
      const own = async <T>(name: string): Promise<T> =>
        (await runnerImport<T>(path.resolve(import.meta.dirname, "../src", name), config)).module;
      const { sceneFiles } = await own<Written>("handoff/scene-files.ts");
      const { parseTransfer } = await own<Read>("transfer/format.ts");
      for (const file of readdirSync(folder).filter((name) => name.endsWith(".transfer"))) {
        const content = Uint8Array.from(readFileSync(path.join(folder, file))).buffer;
        const files = sceneFiles(path.parse(file).name, parseTransfer(content));
        for (const [name, source] of files) {
          this.emitFile({ type: "asset", fileName: `objects/${name}`, source });
        }
      }
    },
  };
}

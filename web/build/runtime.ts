import { createReadStream, readFileSync } from "node:fs";
import { type Connect, defaultClientConditions, type Plugin } from "vite";

/** onnxruntime's own files, as they are: the worker loads them by these names from `runtime/`. */
const FILES = ["ort-wasm-simd-threaded.mjs", "ort-wasm-simd-threaded.wasm"];

/** Puts onnxruntime's WASM build into `runtime/` of the page: built, in dev and in preview. */
export function runtime(folder: string): Plugin {
  const serve: Connect.NextHandleFunction = (request, response, next) => {
    const name = FILES.find((file) => request.url?.split("?")[0] === `/runtime/${file}`);
    if (name === undefined) return next();
    const type = name.endsWith(".wasm") ? "application/wasm" : "text/javascript";
    response.setHeader("Content-Type", type);
    createReadStream(`${folder}/${name}`).pipe(response);
  };
  return {
    name: "deeplight:runtime",
    // The build of onnxruntime that loads those files instead of carrying copies of them.
    config: () => ({
      resolve: { conditions: ["onnxruntime-web-use-extern-wasm", ...defaultClientConditions] },
    }),
    configureServer: (server) => void server.middlewares.use(serve),
    generateBundle() {
      for (const name of FILES) {
        const source = readFileSync(`${folder}/${name}`);
        this.emitFile({ type: "asset", fileName: `runtime/${name}`, source });
      }
    },
  };
}

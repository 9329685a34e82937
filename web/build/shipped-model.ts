import { createReadStream, existsSync, readFileSync } from "node:fs";
import type { Connect, Plugin } from "vite";

/** Where the page finds the network, relative to its own address. */
const NAME = "model/deeplight.onnx";

/** Puts the network that the Python package ships next to the page: built, in dev and in preview. */
export function shippedModel(path: string): Plugin {
  const serve: Connect.NextHandleFunction = (request, response, next) => {
    if (request.url?.split("?")[0] !== `/${NAME}`) return next();
    response.setHeader("Content-Type", "application/octet-stream");
    createReadStream(path).pipe(response);
  };
  return {
    name: "deeplight:shipped-model",
    configureServer: (server) => void server.middlewares.use(serve),
    generateBundle() {
      if (!existsSync(path)) this.error(`expected the trained network at ${path}, got no file`);
      this.emitFile({ type: "asset", fileName: NAME, source: readFileSync(path) });
    },
  };
}

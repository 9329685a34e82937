import { fileURLToPath } from "node:url";
import { defineConfig } from "vitest/config";
import { runtime } from "./build/runtime.ts";
import { shippedModel } from "./build/shipped-model.ts";

const here = (path: string) => fileURLToPath(new URL(path, import.meta.url));

export default defineConfig({
  base: "./", // the built page works in any folder of any host
  plugins: [
    shippedModel(here("../src/deeplight/weights/deeplight.onnx")),
    runtime(here("node_modules/onnxruntime-web/dist")),
  ],
  worker: { format: "es" },
  build: {
    outDir: here("../src/deeplight/demo/site"),
    emptyOutDir: true,
    target: "es2022", // Safari 16.4, Chrome 94, Firefox 93: what WASM with SIMD needs anyway
    assetsInlineLimit: 0, // the content policy has no place for data: scripts or fonts
    chunkSizeWarningLimit: 1024,
  },
  test: { include: ["src/**/*.test.ts", "tests/**/*.test.ts"], testTimeout: 20_000 },
});

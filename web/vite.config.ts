import { fileURLToPath } from "node:url";
import { defaultClientConditions } from "vite";
import { defineConfig } from "vitest/config";
import { basisWithoutEval } from "./build/basis.ts";
import { detailLibrary } from "./build/detail-library.ts";
import { contentPolicy } from "./build/policy.ts";
import { precache } from "./build/precache.ts";
import { sceneObjects } from "./build/scene-objects.ts";
import { shippedModel } from "./build/shipped-model.ts";
import { threeInParts } from "./build/three.ts";

const here = (path: string) => fileURLToPath(new URL(path, import.meta.url));

export default defineConfig({
  base: "./", // the built page works in any folder of any host
  plugins: [
    basisWithoutEval(),
    threeInParts(),
    contentPolicy(here("../src/deeplight/demo/policy.txt")),
    shippedModel(here("../src/deeplight/weights/deeplight.onnx")),
    detailLibrary(here("../src/deeplight/weights/detail.npz")),
    sceneObjects(here("public/objects"), here("packages/deeplight/src/core.ts")),
    precache("service-worker.js", /^objects\/.*\.(bin|gltf)$|^icons\/share\.jpg$/),
  ],
  // The library as it is written, not as it is published: one build makes both.
  resolve: { conditions: ["deeplight-source", ...defaultClientConditions] },
  ssr: { resolve: { conditions: ["deeplight-source"] }, noExternal: ["deeplight"] },
  worker: { format: "es", plugins: () => [basisWithoutEval()] },
  build: {
    outDir: here("../src/deeplight/demo/site"),
    emptyOutDir: true,
    target: "es2022", // Safari 16.4, Chrome 94, Firefox 93: what WASM with SIMD needs anyway
    assetsInlineLimit: 0, // the content policy has no place for data: scripts or fonts
    chunkSizeWarningLimit: 1024,
    rollupOptions: {
      input: {
        page: here("index.html"),
        "service-worker": here("src/page/service-worker.ts"),
      },
      output: {
        // The worker's address must not change, and its folder is what it serves.
        entryFileNames: ({ name }) =>
          name === "service-worker" ? "[name].js" : "assets/[name]-[hash].js",
      },
    },
  },
  server: { fs: { allow: [here("."), here("../examples/photos")] } },
  test: {
    include: ["src/**/*.test.ts", "packages/*/src/**/*.test.ts", "tests/**/*.test.ts"],
    testTimeout: 20_000,
    hookTimeout: 60_000,
  },
});

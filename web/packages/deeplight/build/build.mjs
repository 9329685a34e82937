// Makes dist/: ES modules, their types, the network. npm run build --workspace deeplight
import { execFileSync } from "node:child_process";
import { copyFile, readdir, readFile, rm, writeFile } from "node:fs/promises";
import { createRequire } from "node:module";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "vite";

const here = (name) => fileURLToPath(new URL(`../${name}`, import.meta.url));
const ADAPTERS = ["three", "react-three-fiber", "babylon", "model-viewer", "aframe", "element"];

await rm(here("dist"), { recursive: true, force: true });
await build({
  root: here("."),
  configFile: false,
  logLevel: "warn",
  worker: { format: "es" },
  build: {
    outDir: here("dist"),
    target: "es2022",
    minify: true,
    lib: {
      formats: ["es"],
      entry: {
        ...Object.fromEntries(
          ["index", "core", "worker"].map((name) => [name, here(`src/${name}.ts`)]),
        ),
        ...Object.fromEntries(ADAPTERS.map((name) => [name, here(`src/adapters/${name}.ts`)])),
      },
    },
    rollupOptions: {
      external: [/^three/, /^react/],
      output: {
        chunkFileNames: "[name]-[hash].js", // all in one folder: the network lies next to them
        minify: true, // white space, too, which Vite leaves in libraries
      },
    },
  },
});
// Bundlers find the network by this very spelling, and take it along; Vite hides it from them.
let named = 0;
for (const name of await readdir(here("dist"))) {
  const code = await readFile(here(`dist/${name}`), "utf8");
  const plain = code.replace(
    /`\.\/deeplight\.onnx`,``\+import\.meta/,
    '"./deeplight.onnx",import.meta',
  );
  if (plain === code) continue;
  await writeFile(here(`dist/${name}`), plain);
  named++;
}
if (named !== 1) throw new Error(`expected the network's address in one module, got ${named}`);
// TypeScript's own command, wherever npm put it.
const require = createRequire(import.meta.url);
const tsc = path.join(path.dirname(require.resolve("typescript/package.json")), "bin/tsc");
execFileSync(process.execPath, [tsc, "--project", here("tsconfig.json")], { stdio: "inherit" });
await copyFile(here("../../../src/deeplight/weights/deeplight.onnx"), here("dist/deeplight.onnx"));
await copyFile(here("../../../LICENSE"), here("LICENSE"));

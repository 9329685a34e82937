// npm run sizes: what a visitor fetches before the first light, and whether that is within bounds.
// With -- --brotli also what brotli makes of it, which takes half a minute.
import { readdir, readFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { brotliCompressSync, gzipSync } from "node:zlib";

const SITE = fileURLToPath(new URL("../../src/deeplight/demo/site/", import.meta.url));
const PACKAGE = fileURLToPath(new URL("../packages/deeplight/dist/", import.meta.url));
const MB = 1e6;
const WITH_BROTLI = process.argv.includes("--brotli");

/** Fetched only for the user's own object, and where there is a room or another app to put one into. */
const LATER = /^(asked-worker|draco|ktx2|meshopt|glb|room-view|usdz)/;

/** Files to sum up, and the most that they may have gzipped. */
const SUMS = [
  {
    what: "page: scripts, styles, html",
    files: await matching(SITE, /^index\.html$|\.(js|css)$/),
    most: 0.225 * MB,
  },
  {
    what: "page: everything before first light",
    files: await matching(SITE, /^index\.html$|\.(js|css|onnx)$/),
    most: 6 * MB,
  },
  {
    what: "package: its module, the worker inside",
    files: await imported(`${PACKAGE}index.js`),
    most: 0.06 * MB,
  },
  {
    what: "package: that and the network",
    files: [...(await imported(`${PACKAGE}index.js`)), `${PACKAGE}deeplight.onnx`],
    most: 6 * MB,
  },
];

async function matching(folder, names) {
  const entries = await readdir(folder, { recursive: true, withFileTypes: true });
  return entries
    .filter(({ name }) => names.test(name) && !LATER.test(name))
    .filter((entry) => entry.isFile())
    .map((entry) => `${entry.parentPath}/${entry.name}`);
}

/** A module and all that it imports. */
async function imported(module, found = new Set()) {
  if (found.has(module)) return [...found];
  found.add(module);
  const code = await readFile(module, "utf8");
  for (const [, name] of code.matchAll(/(?:from|import)\s*"\.\/([^"]+)"/g)) {
    await imported(`${PACKAGE}${name}`, found);
  }
  return [...found];
}

const table = [];
let failed = false;
for (const { what, files: paths, most } of SUMS) {
  const files = await Promise.all(paths.map((path) => readFile(path)));
  const sum = (size) => files.reduce((all, file) => all + size(file), 0);
  const gzip = sum((file) => gzipSync(file, { level: 9 }).length);
  failed ||= gzip > most;
  table.push({
    what,
    files: files.length,
    bytes: sum((file) => file.length),
    gzip,
    ...(WITH_BROTLI ? { brotli: sum((file) => brotliCompressSync(file).length) } : {}),
    "gzip at most": most,
  });
}
console.table(table);
if (failed) {
  console.error("larger than it may be");
  process.exit(1);
}

/** Lists for the service worker, once everything is built, which files it keeps for offline use. */
import { createHash } from "node:crypto";
import { readdir, readFile, writeFile } from "node:fs/promises";
import { join, relative, sep } from "node:path";
import type { Plugin } from "vite";

const PLACE = "__FILES__";

/** @param others are fetched by other programs, never by the page. */
export function precache(worker: string, others: RegExp): Plugin {
  let folder = "";
  return {
    name: "precache",
    apply: "build",
    enforce: "post",
    configResolved(config) {
      folder = config.build.outDir;
    },
    async closeBundle() {
      const file = join(folder, worker);
      const code = await readFile(file, "utf8");
      if (!code.includes(PLACE)) this.error(`${worker} has no place for the list of files`);
      const files = (await listed(folder, worker)).filter(([name]) => !others.test(name));
      await writeFile(file, code.replace(PLACE, JSON.stringify(files)));
    },
  };
}

/** Every file but the worker itself: its path from the folder, and the start of its SHA-256. */
async function listed(folder: string, worker: string): Promise<[string, string][]> {
  const entries = await readdir(folder, { recursive: true, withFileTypes: true });
  const paths = entries
    .filter((entry) => entry.isFile() && entry.name !== worker)
    .map((entry) => join(entry.parentPath, entry.name))
    .sort();
  return Promise.all(
    paths.map(async (path): Promise<[string, string]> => {
      const hash = createHash("sha256")
        .update(await readFile(path))
        .digest("hex");
      return [relative(folder, path).split(sep).join("/"), hash.slice(0, 16)];
    }),
  );
}

// Compiles kernels.ts and writes it, as text, to src/network/kernels.generated.ts.
import { readFile, writeFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import asc from "assemblyscript/asc";

const SOURCE = fileURLToPath(new URL("kernels.ts", import.meta.url));
const TARGET = new URL("../src/network/kernels.generated.ts", import.meta.url);
const OPTIONS = ["-O3", "--enable", "simd", "--runtime", "stub", "--noAssert", "--importMemory"];

/** The TypeScript file with the compiled kernels. */
export async function generated() {
  let code;
  const { error, stderr } = await asc.main(
    ["kernels.ts", "--outFile", "kernels.wasm", "--use", "abort=", ...OPTIONS],
    {
      readFile: (name) => (name === "kernels.ts" ? readFile(SOURCE, "utf8") : null),
      writeFile: (_, contents) => {
        code = contents;
      },
      listFiles: () => [],
    },
  );
  if (error) throw new Error(`${error.message}\n${stderr}`);
  const text = Buffer.from(code).toString("base64");
  return `// Made by kernels/build.mjs from kernels/kernels.ts. Do not edit.\n\nexport const KERNELS =\n  "${text}";\n`;
}

if (process.argv[1] === fileURLToPath(import.meta.url)) await writeFile(TARGET, await generated());

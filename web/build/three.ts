/**
 * three.js out of its sources instead of its two large published files: a class that only the reader of .glb
 * files needs then comes with that reader, and one that nobody needs does not come at all.
 */
import { fileURLToPath } from "node:url";
import type { Plugin } from "vite";

const SOURCES = fileURLToPath(new URL("../node_modules/three/src/Three.js", import.meta.url));

export function threeInParts(): Plugin {
  return {
    name: "deeplight:three-in-parts",
    apply: "build",
    enforce: "pre",
    resolveId: { filter: { id: /^three$/ }, handler: () => SOURCES },
    transform: {
      filter: { id: /three\/src\/.*\.js$/, code: "/* glsl */" },
      handler: (code) => ({ code: withShortShaders(code), map: null }),
    },
  };
}

/** The same module, its shaders' text without comments, indentation and empty lines. */
export function withShortShaders(code: string): string {
  return code.replace(/\/\* glsl \*\/\s*`([^`]*)`/g, (_, shader: string) => `\`${short(shader)}\``);
}

function short(shader: string): string {
  const bare = shader.replace(/\/\/.*|\/\*[\s\S]*?\*\//g, "");
  return bare.replace(/^[ \t]+|[ \t]+$/gm, "").replace(/\n+/g, "\n");
}

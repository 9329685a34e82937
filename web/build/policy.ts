import { readFileSync } from "node:fs";
import type { Plugin } from "vite";

/**
 * Writes the content policy of `deeplight demo` into the built page, so that it holds on any web
 * host. A page cannot say who may frame it: that rule only works as a header.
 */
export function contentPolicy(path: string): Plugin {
  const rules = readFileSync(path, "utf-8").trim().split("; ");
  const content = rules.filter((rule) => !rule.startsWith("frame-ancestors")).join("; ");
  return {
    name: "deeplight:content-policy",
    apply: "build",
    transformIndexHtml: () => [
      {
        tag: "meta",
        attrs: { "http-equiv": "Content-Security-Policy", content },
        injectTo: "head-prepend",
      },
    ],
  };
}

/** three.js as the page has it, out of its sources, against the published one. */
import { ShaderChunk } from "three";
import { ShaderChunk as written } from "three/src/renderers/shaders/ShaderChunk.js";
import { describe, expect, test } from "vitest";
import { withShortShaders } from "../build/three.ts";

/** Words and signs, without comments and what lies between them; directives keep their line. */
const tokens = (shader: string) =>
  shader
    .replace(/\/\/.*/g, "")
    .match(/#.*|\w+|[^\s\w]/g)
    ?.map((token) => token.trim());
const shortened = (shader: string): string => {
  const code = withShortShaders(`export default /* glsl */\`${shader}\`;`);
  return code.slice("export default `".length, -"`;".length);
};

describe("shaders without comments and indentation", () => {
  const names = Object.keys(written) as (keyof typeof ShaderChunk)[];

  test.each(names)("%s is the published one", (name) => {
    expect(tokens(shortened(written[name]))).toEqual(tokens(ShaderChunk[name]));
  });

  test("a shader that lacks a word is not", () => {
    const lacking = written.common.replace("highp", "");
    expect(tokens(shortened(lacking))).not.toEqual(tokens(ShaderChunk.common));
  });

  test("they are shorter than the written ones", () => {
    const length = (of: (name: (typeof names)[number]) => string) =>
      names.reduce((sum, name) => sum + of(name).length, 0);
    expect(length((name) => shortened(written[name]))).toBeLessThan(
      0.9 * length((name) => written[name]),
    );
  });
});

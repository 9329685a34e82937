import { defineConfig } from "vitest/config";

/** A busy machine needs more. */
const PATIENCE_MS = Number(process.env.DEEPLIGHT_PATIENCE_MS ?? 30_000);

// The package as `npm pack` makes it, in a project of its own; asks the registry for a few others.
export default defineConfig({
  test: {
    include: ["tarball/**/*.test.ts"],
    testTimeout: 4 * PATIENCE_MS,
    hookTimeout: 10 * PATIENCE_MS,
    fileParallelism: false,
  },
});

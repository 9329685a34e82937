import { defineConfig } from "vitest/config";

// The package as `npm pack` makes it, in a project of its own; asks the registry for a few others.
export default defineConfig({
  test: {
    include: ["tarball/**/*.test.ts"],
    testTimeout: 120_000,
    hookTimeout: 300_000,
    fileParallelism: false,
  },
});

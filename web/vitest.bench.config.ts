import { defineConfig } from "vitest/config";

// Prints times; what they are worth depends on what else the machine does.
export default defineConfig({
  test: { include: ["bench/**/*.test.ts"], testTimeout: 300_000, fileParallelism: false },
});

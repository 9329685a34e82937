import { defaultClientConditions } from "vite";
import { defineConfig } from "vitest/config";

const conditions = ["deeplight-source", ...defaultClientConditions];

/** A busy machine needs more. */
const PATIENCE_MS = Number(process.env.DEEPLIGHT_PATIENCE_MS ?? 30_000);

// The built page in a real browser: run `npm run build` first.
export default defineConfig({
  resolve: { conditions },
  ssr: { resolve: { conditions }, noExternal: ["deeplight"] },
  test: {
    include: ["e2e/**/*.test.ts"],
    testTimeout: 2 * PATIENCE_MS,
    hookTimeout: 4 * PATIENCE_MS,
    fileParallelism: false,
    expect: { poll: { timeout: (2 / 3) * PATIENCE_MS } },
  },
});

import { defaultClientConditions } from "vite";
import { defineConfig } from "vitest/config";

const conditions = ["deeplight-source", ...defaultClientConditions];

// The built page in a real browser: run `npm run build` first.
export default defineConfig({
  resolve: { conditions },
  ssr: { resolve: { conditions }, noExternal: ["deeplight"] },
  test: {
    include: ["e2e/**/*.test.ts"],
    testTimeout: 2 * Number(process.env.DEEPLIGHT_PATIENCE_MS ?? 30_000),
    hookTimeout: 120_000,
    fileParallelism: false,
    expect: { poll: { timeout: 20_000 } },
  },
});

import { readdirSync } from "node:fs";
import { defineConfig } from "vite";

const pages = readdirSync(import.meta.dirname).filter((name) => name.endsWith(".html"));

export default defineConfig({
  base: "./",
  // So that the network stays next to the module that fetches it.
  optimizeDeps: { exclude: ["deeplight"] },
  build: {
    target: "es2022",
    chunkSizeWarningLimit: 8192,
    rollupOptions: { input: pages.map((name) => `${import.meta.dirname}/${name}`) },
  },
});

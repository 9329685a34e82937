/** A small page of ours in a real Chromium, straight from the source: for what the whole page hides. */
import type { Page } from "playwright-core";
import { createServer } from "vite";
import { launch } from "./browser.ts";

export interface Stage {
  readonly page: Page;
  close(): Promise<void>;
}

/**
 * Opens one of e2e/pages.
 *
 * @param name of the page.
 * @param ready the name that it gives `window` when it can be asked.
 */
export async function staged(name: string, ready: string): Promise<Stage> {
  const root = new URL("..", import.meta.url).pathname;
  const [server, browser] = await Promise.all([
    createServer({ root, logLevel: "error" }),
    launch(),
  ]);
  const close = async () => {
    await browser.close();
    await server.close();
  };
  try {
    await server.listen();
    const page = await browser.newPage();
    await page.goto(new URL(`/e2e/pages/${name}.html`, server.resolvedUrls!.local[0]).href);
    await page.waitForFunction((what) => what in window, ready);
    return { page, close };
  } catch (error) {
    await close();
    throw error;
  }
}

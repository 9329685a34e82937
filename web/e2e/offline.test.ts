/** The page without a network, and a new version of it. */
import { execFile } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdtemp, readFile, writeFile } from "node:fs/promises";
import { createServer, type Server } from "node:http";
import type { AddressInfo } from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { promisify } from "node:util";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { launch, untilLit, visit } from "./browser.ts";
import { PHOTOS } from "./clip.ts";
import { saved } from "./pictures.ts";
import { ballOf, farthest, PROGRAM, serve } from "./python.ts";

let browser: Browser;

beforeAll(async () => {
  browser = await launch();
});
afterAll(() => browser?.close());

async function untilKept(page: Page): Promise<void> {
  await page.waitForFunction(() => navigator.serviceWorker.controller !== null);
}

test("after the first visit everything works with the server gone", async () => {
  const site = await serve();
  const { page, leave } = await visit(browser, site.url, { keeps: true });
  await page.click("#examples button");
  await page.waitForSelector("#viewer[data-light=whole]");
  const online = ballOf((await saved(page, "#save-json")).toString());
  await untilKept(page);
  await site.stop();
  await page.goto(site.url);
  await page.click("#examples button");
  await page.waitForSelector("#viewer[data-light=whole]");
  const offline = ballOf((await saved(page, "#save-json")).toString());
  expect(farthest(offline, online)).toBe(0);
  await page.click('[data-tray="object"]');
  await page.getByText("Teapot").click();
  await expect.poll(() => page.inputValue("#objects input:checked")).toBe("pot");
  await leave();
});

test("a photo that another app shares to the installed page opens there, once", async () => {
  const site = await serve();
  const { page, leave } = await visit(browser, site.url, { keeps: true });
  await untilKept(page);
  const manifest = await (await fetch(new URL("manifest.webmanifest", site.url))).json();
  const { action, method, params } = manifest.share_target;
  const photo = [...(await readFile(new URL("pagoda.jpg", PHOTOS)))];
  // As the system does it: a form, sent to the address that the manifest names.
  const status = await page.evaluate(
    async ({ to, how, name, bytes }) => {
      const form = new FormData();
      form.append(name, new File([Uint8Array.from(bytes)], "p.jpg", { type: "image/jpeg" }));
      return (await fetch(to, { method: how, body: form })).status;
    },
    { to: action, how: method, name: params.files[0].name, bytes: photo },
  );
  expect(status).toBe(200);
  const led = `${site.url}?shared`; // where the worker sends the system's browser
  await page.goto(led);
  await untilLit(page);
  expect(page.url()).toBe(site.url);
  const { photo: opened } = JSON.parse((await saved(page, "#save-json")).toString());
  expect(opened.file).toBe("p.jpg");
  await page.goto(led); // it is not kept
  await page.waitForSelector("#examples button:nth-child(3)");
  expect(await page.isVisible("#viewer")).toBe(false);
  await leave(undefined, /^POST \S+\/share$/); // the worker's, which sends it nowhere
  await site.stop();
});

test("a new version is offered, and comes when asked for", async () => {
  const folder = await mkdtemp(path.join(tmpdir(), "deeplight-site-"));
  await promisify(execFile)(PROGRAM, ["demo", "--export", path.join(folder, "site")]);
  const host = await serveFolder(path.join(folder, "site"));
  const { page, leave } = await visit(browser, host.url, { keeps: true });
  await untilKept(page);
  await publish(path.join(folder, "site"), "DeepLight", "DeepLight the second");
  await page.reload();
  expect(await page.title()).toBe("DeepLight"); // the old one still, whole
  const fetchedBefore = host.fetched.length;
  await page.click("#update-now");
  await expect.poll(() => page.title()).toBe("DeepLight the second");
  const fetched = new Set(host.fetched.slice(fetchedBefore));
  expect([...fetched].filter((file) => /onnx|wasm/.test(file))).toEqual([]); // unchanged: kept
  await leave();
  host.server.close();
});

interface Host {
  readonly url: string;
  readonly server: Server;
  readonly fetched: string[];
}

/** Some web host: no headers but the types. */
async function serveFolder(folder: string): Promise<Host> {
  const types: Record<string, string> = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".mjs": "text/javascript",
    ".css": "text/css",
    ".wasm": "application/wasm",
    ".svg": "image/svg+xml",
  };
  const fetched: string[] = [];
  const server = createServer((request, response) => {
    const name = new URL(request.url!, "http://host").pathname.slice(1) || "index.html";
    fetched.push(name);
    readFile(path.join(folder, name)).then(
      (content) => {
        const type = types[path.extname(name)] ?? "application/octet-stream";
        response.writeHead(200, { "content-type": type }).end(content);
      },
      () => response.writeHead(404).end(),
    );
  });
  await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
  const { port } = server.address() as AddressInfo;
  return { url: `http://127.0.0.1:${port}/`, server, fetched };
}

/** Changes the title as a new build would: the page, and its hash in the service worker. */
async function publish(folder: string, before: string, after: string): Promise<void> {
  const hash = (text: string): string =>
    createHash("sha256").update(text).digest("hex").slice(0, 16);
  const [page, worker] = ["index.html", "service-worker.js"].map((name) => path.join(folder, name));
  const old = await readFile(page!, "utf8");
  const fresh = old.replace(`<title>${before}<`, `<title>${after}<`);
  await writeFile(page!, fresh);
  const code = await readFile(worker!, "utf8");
  await writeFile(worker!, code.replace(hash(old), hash(fresh)));
}

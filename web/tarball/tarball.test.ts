/**
 * The package as users get it: packed by `npm pack`, in a project of its own, in a real browser.
 * `npm run tarball --prefix web`; it asks the registry for the tools that the examples are for.
 */
import { mkdir, readFile, writeFile } from "node:fs/promises";
import path from "node:path";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, describe, expect, test } from "vitest";
import { launch } from "../e2e/browser.ts";
import { ballOf, estimated, farthest } from "../e2e/python.ts";
import { alike, apart, brightSideOf, mirrored, seenOn } from "./highlight.ts";
import { bareProject, type Host, host, PHOTO, ran } from "./project.ts";

const LAMPS = [
  [0.6, 0.5, 0.6245],
  [-0.381, 0.254, -0.889],
] as const;
const WINDOW = [0.6, 0.5, 0.6245] as const;
const SHARPNESS = 3;
let folder: string;
let browser: Browser;
let built: Host;
let python: Float32Array;

beforeAll(async () => {
  folder = await bareProject();
  browser = await launch();
  python = ballOf((await estimated(PHOTO, "--light-only")).json);
  await ran(folder, "npx", "vite", "build", "--logLevel", "error");
  built = await host(path.join(folder, "dist"));
});
afterAll(async () => {
  await browser?.close();
  await built?.stop();
});

interface Opened {
  readonly page: Page;
  readonly foreign: string[];
}

async function open(url: string): Promise<Opened> {
  const page = await browser.newPage({ viewport: { width: 420, height: 420 } });
  const foreign: string[] = [];
  page.on("request", (request) => {
    const { origin, protocol } = new URL(request.url());
    if (origin !== new URL(url).origin && !/^(blob|data):$/.test(protocol)) foreign.push(origin);
  });
  await page.goto(url);
  await page.waitForFunction(() => "lit" in window);
  return { page, foreign };
}

/** Log radiance of the photo's light, as the page estimated it. */
async function ballOn(page: Page): Promise<Float32Array> {
  return ballOf(await page.evaluate(() => window.lit.then((light) => light.json().text())));
}

/** A page of its own without any bundler. */
async function plain(name: string, script: string, head = ""): Promise<void> {
  const text = `<!doctype html>${head}<link rel="icon" href="data:,"><script type="module">
    ${script}
    window.lit = load(window.options).then(async (estimator) =>
      estimator.estimate(await (await fetch("./public/photo.jpg")).blob()));
  </script>`;
  await writeFile(path.join(folder, name), text);
}

const MODULE = "node_modules/deeplight/dist/index.js";
const IMPORT = `import { load } from "./${MODULE}";`;

test("its types hold under the strictest rules, without anybody else's", async () => {
  const strict = {
    compilerOptions: {
      target: "ES2022",
      lib: ["ES2023", "DOM"],
      module: "ESNext",
      moduleResolution: "bundler",
      strict: true,
      exactOptionalPropertyTypes: true,
      noUncheckedIndexedAccess: true,
      types: [],
      noEmit: true,
    },
    files: ["types/strict.ts"],
  };
  await mkdir(path.join(folder, "types"));
  await writeFile(path.join(folder, "tsconfig.strict.json"), JSON.stringify(strict));
  const check = (code: string) =>
    writeFile(path.join(folder, "types/strict.ts"), code).then(() =>
      ran(folder, "npx", "tsc", "--project", "tsconfig.strict.json"),
    );
  const calling = (what: string) => `import { load } from "deeplight";
    const light = await (await load()).estimate(document.createElement("canvas"));
    export const value: ${what} = light.harmonics.condonShortley;`;
  await check(calling("Float32Array"));
  await expect(check(calling("string"))).rejects.toThrow();
});

test("the examples hold their types", () => ran(folder, "npx", "tsc"));

describe("gives Python's light within 2e-3, and asks nobody else for anything,", () => {
  const same = async (url: string): Promise<Opened> => {
    const opened = await open(url);
    const ours = await ballOn(opened.page);
    expect(farthest(ours, python)).toBeLessThan(2e-3);
    expect(
      farthest(
        ours.map((value) => value + 0.01),
        python,
      ),
    ).toBeGreaterThan(2e-3);
    return opened;
  };

  test("built by Vite", async () => {
    const { page, foreign } = await same(`${built.url}three.html`);
    expect(foreign).toEqual([]);
    await page.close();
  });

  test("served by Vite while one develops", async () => {
    const { createServer } = await import(
      path.join(folder, "node_modules/vite/dist/node/index.js")
    );
    const server = await createServer({ root: folder, logLevel: "error", server: { port: 0 } });
    await server.listen();
    const { page, foreign } = await same(`${server.resolvedUrls.local[0]}three.html`);
    expect(foreign).toEqual([]);
    await page.close();
    await server.close();
  });

  test("built by webpack", async () => {
    await ran(
      folder,
      "npm",
      "install",
      "--no-save",
      "--silent",
      "webpack@5.113.0",
      "webpack-cli@7.3.1",
    );
    await writeFile(
      path.join(folder, "webpacked.js"),
      `import { load } from "deeplight";
       window.lit = load().then(async (estimator) =>
         estimator.estimate(await (await fetch("/public/photo.jpg")).blob()));`,
    );
    await ran(folder, "npx", "webpack", "./webpacked.js", "--mode", "production", "-o", "packed");
    await writeFile(
      path.join(folder, "packed/index.html"),
      '<!doctype html><link rel="icon" href="data:,"><script src="main.js"></script>',
    );
    const site = await host(folder);
    const { page, foreign } = await same(`${site.url}packed/index.html`);
    expect(foreign).toEqual([]);
    await page.close();
    await site.stop();
  });

  test("as a plain module", async () => {
    await plain("plain.html", IMPORT);
    const site = await host(folder);
    const { page, foreign } = await same(`${site.url}plain.html`);
    expect(foreign).toEqual([]);
    expect(site.asked).toContain("/node_modules/deeplight/dist/deeplight.onnx");
    await page.close();
    await site.stop();
  });

  test("under a content policy without blob: workers", async () => {
    const policy =
      "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; worker-src 'self'";
    const head = `<meta http-equiv="Content-Security-Policy" content="${policy}">`;
    const worker = "new Worker('./node_modules/deeplight/dist/worker.js', { type: 'module' })";
    await plain("strict.html", `${IMPORT} window.options = { worker: () => ${worker} };`, head);
    const site = await host(folder);
    const { page } = await same(`${site.url}strict.html`);
    await page.close();
    await site.stop();
  });
});

test("library and network may lie on another host that allows it, and only then", async () => {
  const site = await host(folder);
  for (const shares of [true, false]) {
    const other = await host(folder, shares);
    const model = `${other.url}node_modules/deeplight/dist/deeplight.onnx`;
    await plain("model.html", `${IMPORT} window.options = { model: "${model}" };`);
    await plain("all.html", `import { load } from "${other.url}${MODULE}";`);
    const { page, foreign } = await open(`${site.url}model.html`);
    if (shares) {
      expect(farthest(await ballOn(page), python)).toBeLessThan(2e-3);
      expect(new Set(foreign)).toEqual(new Set([new URL(other.url).origin]));
      const all = await open(`${site.url}all.html`);
      expect(farthest(await ballOn(all.page), python)).toBeLessThan(2e-3);
      await all.page.close();
    } else {
      const kind = page.evaluate(() => window.lit.catch((error) => error.kind));
      expect(await kind).toBe("model-missing");
    }
    await page.close();
    await other.stop();
  }
  await site.stop();
});

test("takes whatever holds pixels, in any order, and gives each its own light", async () => {
  await plain("sources.html", `${IMPORT} window.load = load;`);
  const site = await host(folder);
  const { page } = await open(`${site.url}sources.html`);
  const sums = await page.evaluate(async () => {
    const estimator = await (window as unknown as { load: typeof import("deeplight").load }).load();
    const image = new Image();
    image.src = "./public/photo.jpg";
    await image.decode();
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
    const context = canvas.getContext("2d")!;
    context.drawImage(image, 0, 0);
    const pixels = context.getImageData(0, 0, canvas.width, canvas.height);
    const dark = new ImageData(canvas.width, canvas.height);
    dark.data.forEach((_, i) => {
      dark.data[i] = i % 4 === 3 ? 255 : 20;
    });
    const sources = [image, canvas, pixels, await createImageBitmap(image), dark];
    const lights = await Promise.all(sources.map((source) => estimator.estimate(source)));
    const empty = await estimator.estimate(new Image()).catch((error) => String(error));
    estimator.close();
    const late = await estimator.estimate(canvas).catch((error) => error.kind);
    return { sums: lights.map((light) => light.harmonics.allPositive[0]!), empty, late };
  });
  const [first, ...others] = sums.sums as [number, ...number[]];
  for (const other of others.slice(0, 3)) expect(other / first).toBeCloseTo(1, 3);
  expect(others[3]! / first).not.toBeCloseTo(1, 1);
  expect(sums.empty).toMatch(/Error/);
  expect(sums.late).toBe("closed");
  await page.close();
  await site.stop();
});

describe("a ball shows the light where it is in", () => {
  test.each([
    ["three.js", "three.html"],
    ["react-three-fiber", "react-three-fiber.html"],
    ["Babylon.js", "babylon.html"],
    ["Babylon.js, right-handed", "babylon.html?right-handed"],
    ["model-viewer", "model-viewer.html"],
    ["A-Frame", "aframe.html"],
  ])("%s", async (_, name) => {
    const { page, foreign } = await open(built.url + name);
    await page.evaluate(() => window.lit.then(() => {}));
    for (const lamp of LAMPS) {
      await page.evaluate((of) => window.showLamp(of), lamp);
      const distance = async () => apart((await seenOn(page)).highlight, mirrored(lamp));
      await expect.poll(distance, { timeout: 20_000 }).toBeLessThan(0.12);
    }
    // Most of a window as wide as a wall stays in the environment.
    await page.evaluate(([of, sharpness]) => window.showLamp(of, 1, sharpness), [
      WINDOW,
      SHARPNESS,
    ] as const);
    const want = brightSideOf(WINDOW, SHARPNESS);
    const way = async () => alike((await seenOn(page)).brightSide, want);
    await expect.poll(way, { timeout: 20_000 }).toBeGreaterThan(0.95);
    expect(alike((await seenOn(page)).brightSide, [-want[0], want[1]])).toBeLessThan(0.5);
    expect(foreign).toEqual([]);
    await page.close();
  });

  test("a plain element", async () => {
    const { page } = await open(`${built.url}element.html`);
    expect(farthest(await ballOn(page), python)).toBeLessThan(2e-3);
    const sides = await page.evaluate(
      async ([right, left]) => {
        const brightness = async (towards: readonly [number, number, number]) => {
          await window.showLamp(towards);
          const canvas = document
            .querySelector("deep-light")!
            .shadowRoot!.querySelectorAll("canvas")[2]!;
          const { data } = canvas.getContext("2d")!.getImageData(24, 16, 1, 1);
          return data[0]!;
        };
        return [await brightness(right), await brightness(left)];
      },
      [
        [0.8, 0, 0.6],
        [-0.8, 0, 0.6],
      ] as const,
    );
    expect(sides[0]).toBeGreaterThan(sides[1]! + 30);
    await page.close();
  });
});

test("its version is in its changelog", async () => {
  const read = (name: string) =>
    readFile(path.join(folder, "node_modules/deeplight", name), "utf8");
  const { version } = JSON.parse(await read("package.json"));
  expect(await read("CHANGELOG.md")).toContain(`## ${version}`);
  expect(await read("README.md")).toContain("npm install deeplight");
});

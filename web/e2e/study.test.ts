/** The page of `deeplight study make`, opened as a file, as people do who get it by mail. */
import { execFile } from "node:child_process";
import { mkdtemp, readdir, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import path from "node:path";
import { pathToFileURL } from "node:url";
import { promisify } from "node:util";
import type { Browser, Page } from "playwright-core";
import { afterAll, beforeAll, expect, test } from "vitest";
import { DESKTOP, launch, PHONE, visit } from "./browser.ts";
import { PROGRAM } from "./python.ts";

const PICTURES = `
import sys; import numpy as np; from deeplight.io.photos import write_png
for m, method in enumerate(("ours", "theirs", "third")):
    for scene in range(8):
        picture = np.full((1500, 1200, 3), (20 * scene, 80 * m, 128), np.uint8)
        write_png(f"{sys.argv[1]}/{method}/{scene}.png", picture)
`;
const SESSION = ["--session.pairs", "12", "--session.catches", "4", "--session.identical", "2"];
const METHODS = ["ours", "theirs", "third"];
const TOTAL = 18;

// The next pair is shown just now, however slow this machine is.
const PRESSED_AT_ONCE = `(async () => {
  while (shownAt === null) await new Promise(requestAnimationFrame);
  shownAt = performance.now();
  dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
})()`;

interface Trial {
  kind: string;
  scene: string;
  left: string;
  right: string;
  chosen?: string;
}

let browser: Browser;
let folder: string;
let url: string;

beforeAll(async () => {
  browser = await launch();
  folder = await mkdtemp(path.join(tmpdir(), "deeplight-study-"));
  await promisify(execFile)(path.join(path.dirname(PROGRAM), "python"), ["-c", PICTURES, folder]);
  const methods = METHODS.flatMap((name) => ["--method", `${name}=${folder}/${name}`]);
  const out = path.join(folder, "study");
  await promisify(execFile)(PROGRAM, ["study", "make", ...methods, "--out", out, ...SESSION]);
  url = pathToFileURL(path.join(out, "site", "index.html")).href;
});
afterAll(() => browser?.close());

async function answersOf(page: Page): Promise<string> {
  await page.waitForSelector("#save:visible");
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#save")]);
  return readFile(await download.path(), "utf8");
}

/** Until the pair `number` can be answered; faster answers are left out as not looked at. */
async function untilShown(page: Page, number: number): Promise<void> {
  await expect.poll(() => page.textContent("#progress")).toBe(`${number} of ${TOTAL}`);
  await page.waitForSelector("#choices:not(.waiting)");
  await page.waitForTimeout(600);
}

test("a keyboard alone does it, a reload loses nothing, and the file can be analysed", async () => {
  const { page, leave } = await visit(browser, url, { viewport: DESKTOP });
  page.on("dialog", (dialog) => dialog.accept());
  await page.keyboard.press("Tab");
  await page.keyboard.press("Enter");
  for (let number = 1; number <= TOTAL; number++) {
    await untilShown(page, number);
    if (number === 5) {
      await page.reload();
      await page.getByRole("button", { name: "Go on where you were" }).press("Enter");
      await untilShown(page, number);
    }
    const trial = await page.evaluate<Trial>("trials[state.answers.length]");
    const best = trial.left === "ruined" || (trial.kind === "pair" && trial.right === "c1");
    await page.keyboard.press(best ? "ArrowRight" : "ArrowLeft");
    // Too soon: no answer to the next one.
    if (number < TOTAL) await page.evaluate(PRESSED_AT_ONCE);
  }
  const content = await answersOf(page);
  expect(await page.inputValue("#plain")).toBe(content);
  const { answers, person, seed } = JSON.parse(content);
  expect(answers).toHaveLength(TOTAL);
  expect(
    answers.map(({ chosen, ms, stacked, ...trial }: Trial & Record<string, unknown>) => trial),
  ).toEqual(await page.evaluate(`plan(STUDY, ${seed})`));
  await writeFile(path.join(folder, `answers-${person}.json`), content);
  await leave();
  const study = path.join(folder, "study");
  const { stdout } = await promisify(execFile)(PROGRAM, [
    "study",
    "analyse",
    folder,
    "--study",
    study,
    "--out",
    path.join(folder, "results"),
  ]);
  expect(stdout).toContain("12 pairs by 1 people");
  const key = JSON.parse(await readFile(path.join(study, "key.json"), "utf8"));
  const results = JSON.parse(await readFile(path.join(folder, "results", "results.json"), "utf8"));
  expect(results.ranking[0].method).toBe(key.conditions.c1);
  expect(await readdir(path.join(folder, "results"))).toContain("report.html");
});

test("a phone does it by touch, with both pictures whole on the screen", async () => {
  const { page, leave } = await visit(browser, url, { viewport: PHONE, touch: true });
  await page.tap("#begin");
  for (let number = 1; number <= TOTAL; number++) {
    await untilShown(page, number);
    for (const side of ["left", "right"]) {
      const box = await page.locator(`[data-side="${side}"] img`).boundingBox();
      expect(box!.height).toBeGreaterThan(250);
      expect(box!.y + box!.height).toBeLessThanOrEqual(PHONE.height);
    }
    await page.tap('[data-side="left"]');
  }
  const { answers } = JSON.parse(await answersOf(page));
  expect(answers.every((answer: Trial & { stacked: boolean }) => answer.stacked)).toBe(true);
  await leave();
});

test("everybody gets every two methods equally often, on either side", async () => {
  const { page, leave } = await visit(browser, url);
  const sessions = await page.evaluate<Trial[][]>(
    "Array.from({ length: 200 }, (_, seed) => plan(STUDY, seed * 7919))",
  );
  for (const trials of sessions) {
    expect(trials).toHaveLength(TOTAL);
    expect(trials[0]!.kind).toBe("pair");
    const pairs = trials.filter(({ kind }) => kind === "pair");
    const count = (left: string, right: string): number =>
      pairs.filter((trial) => trial.left === left && trial.right === right).length;
    for (const [a, b] of [
      ["c1", "c2"],
      ["c1", "c3"],
      ["c2", "c3"],
    ] as const) {
      expect(count(a, b)).toBe(2);
      expect(count(b, a)).toBe(2);
    }
    const catches = trials.filter(({ kind }) => kind === "catch");
    expect(catches.filter(({ left }) => left === "ruined")).toHaveLength(2);
    expect(new Set(pairs.map(({ scene, left, right }) => scene + [left, right].sort())).size).toBe(
      12,
    );
  }
  expect(new Set(sessions.map((trials) => JSON.stringify(trials))).size).toBe(200);
  await leave();
});

test("nothing in the page names a method, and its policy forbids every connection", async () => {
  const text = await readFile(new URL(url), "utf8");
  for (const name of METHODS) expect(text).not.toContain(`"${name}"`);
  const { page } = await visit(browser, url);
  const refused = await page.evaluate(() =>
    fetch("https://example.org/").then(
      () => "sent",
      () => "refused",
    ),
  );
  expect(refused).toBe("refused");
  await page.context().close();
});

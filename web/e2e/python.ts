/** The Python side: the server of the built page, and the estimate that ours must equal. */
import { execFile, spawn } from "node:child_process";
import { mkdtemp, readFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";

const ROOT = fileURLToPath(new URL("../../", import.meta.url));
export const PROGRAM = process.env.DEEPLIGHT ?? path.join(ROOT, ".venv/bin/deeplight");

/** The interpreter that runs it. */
export const PYTHON = path.join(path.dirname(PROGRAM), "python");

export interface Site {
  readonly url: string;
  stop(): Promise<void>;
}

/** `deeplight demo`, with the content policy that users get. */
export function serve(): Promise<Site> {
  const server = spawn(PROGRAM, ["demo", "--port", "0"], { stdio: ["ignore", "pipe", "pipe"] });
  const stop = (): Promise<void> =>
    new Promise((stopped) => {
      if (server.exitCode !== null) return stopped();
      server.once("exit", () => stopped());
      server.kill("SIGINT");
    });
  return new Promise((ready, failed) => {
    let said = "";
    server.once("error", failed); // there is no such program
    server.once("exit", (code) => failed(new Error(`deeplight demo ended with ${code}: ${said}`)));
    server.stderr.on("data", (chunk: Buffer) => {
      said += chunk;
    });
    server.stdout.on("data", (chunk: Buffer) => {
      said += chunk;
      const url = /http:\/\/\S+/.exec(said)?.[0];
      if (url) ready({ url, stop });
    });
  });
}

/** What `deeplight estimate` writes for a photo: the lighting file, and the panorama as .hdr. */
export async function estimated(
  photo: string,
  ...options: string[]
): Promise<{ json: string; hdr: Buffer }> {
  const out = await mkdtemp(path.join(tmpdir(), "deeplight-"));
  await promisify(execFile)(PROGRAM, ["estimate", photo, "--hdr", ...options, "--out", out]);
  const stem = path.join(out, path.parse(photo).name);
  return { json: await readFile(`${stem}.json`, "utf8"), hdr: await readFile(`${stem}.hdr`) };
}

/** Log radiance from a lighting file, ours or the page's. */
export function ballOf(json: string): Float32Array {
  const { size, radiance } = JSON.parse(json).mirror_ball;
  const bytes = Uint8Array.from(Buffer.from(radiance, "base64"));
  const values = new Float32Array(bytes.buffer);
  if (values.length !== size * size * 3) throw new Error(`${values.length} values, size ${size}`);
  return values.map(Math.log);
}

/** Largest difference where both have light. */
export function farthest(a: Float32Array, b: Float32Array): number {
  return a.reduce((most, value, i) => {
    const both = Number.isFinite(value) || Number.isFinite(b[i]);
    return both ? Math.max(most, Math.abs(value - b[i]!)) : most;
  }, 0);
}

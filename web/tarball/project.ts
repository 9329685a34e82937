/** A bare project with the packed package in it, and servers for what it builds. */
import { execFile } from "node:child_process";
import { cp, mkdir, mkdtemp, readdir, readFile, writeFile } from "node:fs/promises";
import { createServer, type Server } from "node:http";
import type { AddressInfo } from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { ballGlb } from "./ball.ts";

export const PACKAGE = fileURLToPath(new URL("../packages/deeplight/", import.meta.url));
export const PHOTO = fileURLToPath(new URL("../../examples/photos/hall.jpg", import.meta.url));
const QUIET = ["--no-audit", "--no-fund", "--silent"];
const FRAME = "aframe@1.8.0"; // asks for a git repository when installed; its bundle does not

export async function ran(folder: string, program: string, ...args: string[]): Promise<string> {
  const { stdout } = await promisify(execFile)(program, args, {
    cwd: folder,
    env: { ...process.env, NODE_ENV: "" },
    maxBuffer: 1e8,
  });
  return stdout;
}

/** The examples as their README says to start them, with the tarball instead of the registry's. */
export async function bareProject(): Promise<string> {
  const folder = await mkdtemp(path.join(tmpdir(), "deeplight-bare-"));
  await ran(PACKAGE, "npm", "pack", "--workspaces=false", "--pack-destination", folder, "--silent");
  const packed = (await readdir(folder)).find((name) => name.endsWith(".tgz"))!;
  await cp(path.join(PACKAGE, "examples"), folder, { recursive: true });
  const public_ = path.join(folder, "public");
  await mkdir(public_);
  await cp(PHOTO, path.join(public_, "photo.jpg"));
  await writeFile(path.join(public_, "ball.glb"), ballGlb());
  const facts = JSON.parse(await readFile(path.join(folder, "package.json"), "utf8"));
  facts.dependencies.deeplight = `file:./${packed}`;
  await writeFile(path.join(folder, "package.json"), JSON.stringify(facts));
  await ran(folder, "npm", "install", ...QUIET);
  await ran(folder, "npm", "pack", FRAME, "--silent");
  await ran(
    folder,
    "tar",
    "xzf",
    `${FRAME.replace("@", "-")}.tgz`,
    "package/dist/aframe-master.min.js",
  );
  await cp(path.join(folder, "package/dist/aframe-master.min.js"), path.join(public_, "aframe.js"));
  return folder;
}

export interface Host {
  readonly url: string;
  /** Paths that were asked for. */
  readonly asked: string[];
  stop(): Promise<void>;
}

const TYPES: Record<string, string> = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".jpg": "image/jpeg",
};

/** A plain web host of a folder. @param shares lets other origins read it (CORS). */
export async function host(folder: string, shares = false): Promise<Host> {
  const asked: string[] = [];
  const server: Server = createServer((request, response) => {
    const name = decodeURIComponent(new URL(request.url!, "http://x").pathname);
    asked.push(name);
    if (shares) response.setHeader("Access-Control-Allow-Origin", "*");
    const type = TYPES[path.extname(name)] ?? "application/octet-stream";
    readFile(path.join(folder, path.normalize(name))).then(
      (body) => response.writeHead(200, { "Content-Type": type }).end(body),
      () => response.writeHead(404).end(),
    );
  });
  await new Promise<void>((ready) => server.listen(0, "127.0.0.1", ready));
  const { port } = server.address() as AddressInfo;
  return {
    url: `http://127.0.0.1:${port}/`,
    asked,
    stop: () =>
      new Promise((stopped) => {
        server.closeAllConnections();
        server.close(() => stopped());
      }),
  };
}

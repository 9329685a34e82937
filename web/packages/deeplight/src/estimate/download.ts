import { EstimateError } from "../errors.ts";

export type Progress = (done: number, all: number) => void;

/** The bytes of a file. `all` is 0 while the server does not say how many there are. */
export async function download(url: string, onProgress: Progress): Promise<Uint8Array> {
  const missing = (why: string) => new EstimateError("model-missing", `${url}: ${why}`);
  const response = await fetch(url).catch((error: unknown) => {
    throw missing(String(error));
  });
  if (!response.ok || !response.body) throw missing(`HTTP ${response.status}`);
  // Of a compressed answer the length says nothing about the file's.
  const isPlain = !response.headers.get("Content-Encoding");
  const all = isPlain ? Number(response.headers.get("Content-Length") ?? 0) : 0;
  const chunks: Uint8Array[] = [];
  let done = 0;
  const reader = response.body.getReader();
  for (;;) {
    const chunk = await reader.read().catch((error: unknown) => {
      throw missing(`cut after ${done} bytes: ${error}`);
    });
    if (chunk.done) break;
    chunks.push(chunk.value);
    done += chunk.value.length;
    onProgress(done, all);
  }
  if (all > 0 && done !== all) throw missing(`cut after ${done} of ${all} bytes`);
  return joined(chunks);
}

function joined(parts: readonly Uint8Array[]): Uint8Array {
  const result = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    result.set(part, at);
    at += part.length;
  }
  return result;
}

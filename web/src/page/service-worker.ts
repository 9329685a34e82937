/**
 * Keeps every file of the page for offline use.
 *
 * One cache, addressed by content: a new version fetches only what has changed, checks it against the
 * hash from the build, and takes over when the user asks or all tabs are closed. Nothing else is ever
 * stored; a file that another app shares to the installed page goes through memory, once.
 */
declare const __FILES__: readonly (readonly [path: string, hash: string])[];

const CACHE = "deeplight";
const worker = self as unknown as ServiceWorkerGlobalScope;
const scope = worker.registration.scope;

/** Where each address of the page is kept. */
const kept = new Map(__FILES__.map(([path, hash]) => [new URL(path, scope).href, hash] as const));
const key = (address: string, hash: string): string => `${address}?content=${hash}`;

const SHARE = new URL("share", scope).href; // as the manifest says
let shared: File | null = null;

worker.addEventListener("install", (event) => event.waitUntil(fetchMissing()));
worker.addEventListener("activate", (event) => event.waitUntil(takeOver()));
worker.addEventListener("message", (event) => {
  if (event.data === "take over") void worker.skipWaiting();
  if (event.data !== "shared") return;
  event.ports[0]?.postMessage(shared);
  shared = null;
});
worker.addEventListener("fetch", (event) => {
  if (event.request.method === "POST" && event.request.url === SHARE) {
    event.respondWith(received(event.request));
    return;
  }
  const address = addressOf(event.request);
  const hash = kept.get(address);
  if (event.request.method !== "GET" || !hash) return;
  event.respondWith(answer(event.request, key(address, hash)));
});

async function fetchMissing(): Promise<void> {
  const cache = await caches.open(CACHE);
  const there = new Set((await cache.keys()).map((request) => request.url));
  for (const [address, hash] of kept) {
    if (there.has(key(address, hash))) continue;
    const response = await fetch(address, { cache: "no-cache" });
    if (!response.ok) throw new Error(`${address}: ${response.status}`);
    if ((await sha256(response.clone())).slice(0, hash.length) !== hash) {
      throw new Error(`${address}: not the file of this version`);
    }
    await cache.put(key(address, hash), response);
  }
}

async function takeOver(): Promise<void> {
  const cache = await caches.open(CACHE);
  const wanted = new Set([...kept].map(([address, hash]) => key(address, hash)));
  for (const request of await cache.keys()) {
    if (!wanted.has(request.url)) await cache.delete(request);
  }
  await worker.clients.claim();
}

/** Holds a shared file until the page that opens for it asks. */
async function received(request: Request): Promise<Response> {
  const file = (await request.formData()).get("file");
  shared = file instanceof File ? file : null;
  return Response.redirect(new URL("./?shared", scope).href, 303);
}

async function answer(request: Request, where: string): Promise<Response> {
  const cache = await caches.open(CACHE);
  return (await cache.match(where)) ?? fetch(request);
}

/** The folder itself is its index.html; queries and fragments change nothing. */
function addressOf(request: Request): string {
  const url = new URL(request.url);
  const folder = url.pathname.endsWith("/") ? `${url.pathname}index.html` : url.pathname;
  return new URL(folder, url.origin).href;
}

async function sha256(response: Response): Promise<string> {
  const digest = await crypto.subtle.digest("SHA-256", await response.arrayBuffer());
  return [...new Uint8Array(digest)].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

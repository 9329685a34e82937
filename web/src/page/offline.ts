/** The page without a network: registers the service worker, and says when a new version waits. */
export async function keepOffline(onUpdate: (load: () => void) => void): Promise<void> {
  if (!import.meta.env.PROD || !("serviceWorker" in navigator)) return;
  const container = navigator.serviceWorker;
  const registration = await container.register(new URL("service-worker.js", document.baseURI));
  const offer = (worker: ServiceWorker): void => {
    if (!container.controller) return; // the first visit: there is no older version
    onUpdate(() => {
      container.addEventListener("controllerchange", () => location.reload());
      worker.postMessage("take over");
    });
  };
  if (registration.waiting) offer(registration.waiting);
  registration.addEventListener("updatefound", () => {
    const worker = registration.installing;
    worker?.addEventListener("statechange", () => {
      if (worker.state === "installed") offer(worker);
    });
  });
}

/** Starts the page. */

import { Failure } from "../failure.ts";
import { App } from "./app.ts";
import { Desk, followMotion } from "./desk.ts";
import { box, button, input } from "./elements.ts";
import { EXAMPLES } from "./examples.ts";
import { offerViewer } from "./hand-over.ts";
import { connectIntake } from "./intake.ts";
import { ModelLoader } from "./model-loader.ts";
import { Notice, offerUpdate } from "./notice.ts";
import { keepOffline } from "./offline.ts";

const PATIENCE_MS = 2000;
/** How long after the first light the page is kept for offline use, and after how long without any. */
const AFTER_MS = 1000;
const UNUSED_MS = 4000;

const notice = new Notice({
  camera: () => button("open-camera").click(),
  photo: () => input("photo-file").click(),
  reload: () => location.reload(),
  "model-file": () => input("model-file").click(),
  "session-file": () => input("session-file").click(),
});

function start(): void {
  history.replaceState(null, "");
  const model = new ModelLoader(notice); // first: it takes the longest
  const app = new App(notice, model);
  const desk = new Desk(app, notice);
  button("open-camera").addEventListener("click", () => {
    void followMotion(app);
    void app.openCamera();
  });
  button("open-photo").addEventListener("click", () => input("photo-file").click());
  connectIntake({
    photo: (file) => void app.openPhoto(file),
    model: (file) => void desk.openModel(file),
    session: (file) => void app.openSession(file),
  });
  void offerRoom(app, notice);
  showExamples(app);
  void desk.choose();
  // Starting the graphics blocks the page, so it happens when there is time, or when a picture is to be shown.
  void Promise.race([model.settled(), rest(PATIENCE_MS)]).then(() => app.stage.start());
  // Fetching everything once more must not hold up the first light.
  void Promise.race([app.firstLight, model.settled().then(() => rest(UNUSED_MS))])
    .then(() => rest(AFTER_MS))
    .then(() => keepOffline(offerUpdate))
    .catch((error: unknown) => {
      console.warn("not kept offline:", error);
    });
}

/** Where the browser can put the object into the real room, or another app of the phone. */
async function offerRoom(app: App, notice: Notice): Promise<void> {
  const asked = navigator.xr?.isSessionSupported("immersive-ar").catch(() => false);
  const hasRoom = (await asked) ?? false;
  offerViewer(app, notice, hasRoom);
  if (!hasRoom) return;
  await import("./room-view.ts"); // before the tap, which does not wait for long
  button("open-room").addEventListener("click", () => void app.openRoom());
  button("open-room").hidden = false;
}

function showExamples(app: App): void {
  for (const { name, url, tiltRad } of EXAMPLES) {
    const example = document.createElement("button");
    example.type = "button";
    const picture = document.createElement("img");
    Object.assign(picture, { src: url.href, alt: `Example: ${name}`, decoding: "async" });
    example.append(picture);
    example.addEventListener("click", () => void app.openPhoto(fetched(url), tiltRad));
    box("examples").append(example);
  }
}

async function fetched(url: URL): Promise<File> {
  const response = await fetch(url);
  if (!response.ok) throw new Failure("photo-unreadable", `${url}: ${response.status}`);
  return new File([await response.blob()], url.pathname.split("/").at(-1)!);
}

function rest(ms: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, ms));
}

addEventListener("unhandledrejection", (event) => notice.show(event.reason));
addEventListener("error", (event) => notice.show(event.error));
try {
  start();
} catch (error) {
  notice.show(error);
}

/** Starts the page. */
import { App } from "./app.ts";
import { Desk, followMotionUnasked } from "./desk.ts";
import { box, button, input } from "./elements.ts";
import { EXAMPLES } from "./examples.ts";
import { Failure } from "./failure.ts";
import { connectIntake } from "./intake.ts";
import { Notice, offerUpdate } from "./notice.ts";
import { keepOffline } from "./offline.ts";

const notice = new Notice({
  camera: () => button("open-camera").click(),
  photo: () => input("photo-file").click(),
  reload: () => location.reload(),
  "model-file": () => input("model-file").click(),
});

function start(): void {
  history.replaceState(null, "");
  const app = new App(notice);
  const desk = new Desk(app, notice);
  button("open-camera").addEventListener("click", () => {
    void followMotionUnasked(app);
    void app.openCamera();
  });
  button("open-photo").addEventListener("click", () => input("photo-file").click());
  connectIntake({
    photo: (file) => void app.openPhoto(file),
    model: (file) => void desk.openModel(file),
  });
  showExamples(app);
  void desk.choose();
  // Fetching everything once more must not hold up the first light.
  void app.model
    .settled()
    .then(() => keepOffline(offerUpdate))
    .catch((error: unknown) => {
      console.warn("not kept offline:", error);
    });
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

addEventListener("unhandledrejection", (event) => notice.show(event.reason));
addEventListener("error", (event) => notice.show(event.error));
try {
  start();
} catch (error) {
  notice.show(error);
}

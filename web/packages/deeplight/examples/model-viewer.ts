import "@google/model-viewer";
import { type ModelViewer, setEnvironmentImage } from "deeplight/model-viewer";
import { start } from "./show.ts";

const viewer = document.querySelector<HTMLElement & ModelViewer>("#view")!;
let forget = () => {};
start((light) => {
  const before = forget;
  forget = setEnvironmentImage(viewer, light);
  viewer.addEventListener("environment-change", () => before(), { once: true });
});

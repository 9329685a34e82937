/** "In your room" where another app of the phone shows it: Quick Look, Scene Viewer. */
import { Failure } from "../failure.ts";
import { isPublic, sceneViewerUrl, type Viewer, viewerOf } from "../handoff/which.ts";
import { headingOf } from "../sensors/pose.ts";
import type { App } from "./app.ts";
import { box, button } from "./elements.ts";
import type { Notice } from "./notice.ts";

/** The one thing that a user sees of it and would wonder about. */
const WHOSE_LIGHT: Readonly<Record<Viewer, string>> = {
  "quick-look":
    "Opens Quick Look with this light painted on; gloss and mirrors show Quick Look’s own.",
  "scene-viewer": "Opens Scene Viewer, which lights the object by itself.",
};

export function offerViewer(app: App, notice: Notice, hasRoom: boolean): void {
  const { relList } = document.createElement("a");
  const opensUsdz = relList?.supports?.("ar") ?? false;
  const viewer = viewerOf({ hasRoom, opensUsdz, userAgent: navigator.userAgent });
  if (!viewer) return;
  const failed = (error: unknown): void => notice.show(error);
  button("hand-over").addEventListener("click", () => {
    if (viewer === "quick-look") void quickLook(app).catch(failed);
    else sceneViewer(app, notice);
  });
  box("hand-over-light").textContent = WHOSE_LIGHT[viewer];
  button("hand-over").hidden = box("hand-over-light").hidden = false;
}

/** The object as it stands before the camera, which Quick Look takes for whoever looks at it. */
async function quickLook(app: App): Promise<void> {
  const { usdzOf, USDZ_TYPE } = await import("../handoff/usdz.ts"); // not before it is needed
  const { turnRad, sizeM } = app.hand;
  const stand = { turnRad: turnRad - headingOf(app.pose()), sizeM };
  const file = new Blob([await usdzOf(app.showroom.parts, stand)], { type: USDZ_TYPE });
  const url = URL.createObjectURL(file);
  follow(url, { rel: "ar", download: "deeplight.usdz" });
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

function sceneViewer({ showroom }: App, notice: Notice): void {
  const page = new URL(document.baseURI);
  const { chosen, material } = showroom;
  if (isPublic(page) && showroom.isBuiltIn) {
    const file = new URL(`objects/${chosen}-${material}.gltf`, page);
    follow(sceneViewerUrl(file, page, document.title));
  } else notice.show(new Failure("no-scene-viewer"));
}

/** Opens an address as a tap on its link does; Safari wants a picture in one that opens Quick Look. */
function follow(href: string, more: Partial<HTMLAnchorElement> = {}): void {
  const link = Object.assign(document.createElement("a"), { href, ...more });
  link.append(new Image());
  link.hidden = true;
  document.body.append(link);
  link.click();
  link.remove();
}

/** Which viewer of the phone takes the object where the browser itself has no augmented reality. */

export type Viewer = "quick-look" | "scene-viewer";

export interface Phone {
  /** WebXR's `immersive-ar`: then the page shows the object itself, in its own light. */
  readonly hasRoom: boolean;
  /** Whether links with `rel="ar"` open in Quick Look, as Safari says on iPhones and iPads. */
  readonly opensUsdz: boolean;
  readonly userAgent: string;
}

/** Null where there is none: on desktops, and where the page does better by itself. */
export function viewerOf({ hasRoom, opensUsdz, userAgent }: Phone): Viewer | null {
  if (hasRoom) return null;
  if (opensUsdz) return "quick-look";
  // No browser says whether Scene Viewer is there; Firefox opens no intents, headsets have no Google app.
  const isPhone = /Android/.test(userAgent) && !/Firefox|OculusBrowser/.test(userAgent);
  return isPhone ? "scene-viewer" : null;
}

/**
 * Whether another app on the phone can fetch files of a page: Scene Viewer takes https only, trusts no
 * certificate that we made ourselves, and looks names up in the public network.
 */
export function isPublic({ protocol, hostname }: URL): boolean {
  const isNumber = /^[\d.]+$|^\[/.test(hostname);
  const isLocal = /(^|\.)(localhost|local|lan|home|internal)$/.test(hostname);
  return protocol === "https:" && hostname.includes(".") && !isNumber && !isLocal;
}

/**
 * The address that opens Scene Viewer on Android.
 *
 * @param file of glTF, which Scene Viewer fetches by itself.
 * @param page to come back to where there is no Scene Viewer.
 */
export function sceneViewerUrl(file: URL, page: URL, title: string): string {
  const query = new URLSearchParams({ file: file.href, mode: "ar_preferred", title });
  const intent = [
    "scheme=https",
    "package=com.google.android.googlequicksearchbox",
    "action=android.intent.action.VIEW",
    `S.browser_fallback_url=${encodeURIComponent(page.href)}`,
    "end;",
  ];
  return `intent://arvr.google.com/scene-viewer/1.2?${query}#Intent;${intent.join(";")}`;
}

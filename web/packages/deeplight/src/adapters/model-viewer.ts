/** <model-viewer>: `deeplight/model-viewer`. */
import type { Light } from "../light.ts";

/** A `<model-viewer>` element, as far as it is used here. */
export interface ModelViewer {
  environmentImage: string | null;
}

/** Where its panoramas have the direction that its first view looks into, from the left edge. */
const VIEW_U = 0.25;

/** Lights what it shows, as its `environment-image`; the result frees the memory once another is set. */
export function setEnvironmentImage(viewer: ModelViewer, light: Light): () => void {
  const url = URL.createObjectURL(light.hdr(VIEW_U));
  viewer.environmentImage = `${url}#.hdr`; // it distinguishes the kinds of files by their endings
  return () => URL.revokeObjectURL(url);
}

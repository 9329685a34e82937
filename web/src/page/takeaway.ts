/** Files for the user: through the share sheet of a phone, as a download elsewhere. */
import type { Light } from "deeplight/core";
import { Failure } from "../failure.ts";
import { withPanoramaFacts } from "./panorama-facts.ts";
import { panoramaImage } from "./panorama-image.ts";

/** True when it was given away; false when the user closed the share sheet. */
export async function give(file: File): Promise<boolean> {
  if (sharesFiles() && navigator.canShare?.({ files: [file] })) {
    try {
      await navigator.share({ files: [file], title: file.name });
      return true;
    } catch (error) {
      if (error instanceof DOMException && error.name === "AbortError") return false;
      // Some browsers promise what they then refuse: fall through to a download.
    }
  }
  download(file);
  return true;
}

/** The picture as JPEG, or PNG where the browser writes no JPEG. */
export function pictureFile(canvas: HTMLCanvasElement, stem: string): Promise<File> {
  return new Promise((resolve, reject) => {
    canvas.toBlob(
      (blob) => {
        if (!blob) return reject(new Failure("cannot-save", "no memory for the picture"));
        const suffix = blob.type === "image/jpeg" ? "jpg" : "png";
        resolve(new File([blob], `${stem}.${suffix}`, { type: blob.type }));
      },
      "image/jpeg",
      0.93,
    );
  });
}

/** All around as one picture, exposed like the photo: the view in the middle. Viewers may turn it. */
export async function panoramaPicture(light: Light, stem: string): Promise<File> {
  const picture = panoramaImage(light, light.panorama?.height ?? 256);
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [picture.width, picture.height];
  canvas.getContext("2d")?.putImageData(picture, 0, 0);
  const file = await pictureFile(canvas, `${stem}-around`);
  const bytes = withPanoramaFacts(new Uint8Array(await file.arrayBuffer()), canvas);
  return new File([bytes], file.name, { type: file.type });
}

/** Desktop share sheets are a detour; a phone's is where pictures go. */
function sharesFiles(): boolean {
  return matchMedia("(pointer: coarse)").matches;
}

function download(file: File): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(file);
  link.download = file.name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

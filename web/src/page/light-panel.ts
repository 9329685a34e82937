/** The three spheres and the environment in the estimated light, as the camera would show them. */
import {
  IDENTITY,
  type Light,
  type Lighting,
  type Matrix3x3,
  SCENE_FILE,
  type SphereName,
  transposed,
} from "deeplight/core";
import { box, canvas } from "./elements.ts";
import { mirrorBall } from "./mirror-ball-image.ts";
import { panoramaImage } from "./panorama-image.ts";
import { prepareSpheres } from "./prepare-spheres.ts";

const BALLS: readonly (readonly [SphereName, string])[] = [
  ["matte_silver", "ball-silver"],
  ["diffuse", "ball-diffuse"],
];
/** Pixels of a fine screen. */
const MIRROR_SIZE = 112;
const PANORAMA_HEIGHT = 128;
/** Where nothing finer is known than the network's ball. */
const COARSE_HEIGHT = 64;
/** A drawing takes some milliseconds of the view's time, so a live one is not drawn for every frame. */
const REST_MS = 120;

/** A light and, where it is in the world's frame, how the camera is held in it. */
interface Shown {
  readonly light: Light;
  readonly worldFromCamera: Matrix3x3 | null;
}

export class LightPanel {
  /** Started only once there is light to show: it would hold up the first estimate. */
  private ready: Promise<void> | null = null;
  private latest: Shown | null = null;
  private drawn: Shown | null = null;
  private drawing = false;

  /** Shows the newest light as soon as there is time. */
  show(shown: Shown): void {
    this.latest = shown;
    if (!this.drawing && !box("light").hidden) void this.draw();
  }

  /** To be called when the panel has been opened. */
  refresh(): void {
    if (this.latest) this.show(this.latest);
  }

  clear(): void {
    this.latest = this.drawn = null;
  }

  private async draw(): Promise<void> {
    this.drawing = true;
    this.ready ??= prepareSpheres();
    await this.ready;
    while (this.latest && this.latest !== this.drawn) {
      const { light, worldFromCamera } = this.latest;
      this.drawn = this.latest;
      const { lighting: own } = light;
      const lighting = worldFromCamera ? own.turned(transposed(worldFromCamera)) : own;
      paint("ball-mirror", mirrorImage(light, lighting, worldFromCamera ?? IDENTITY));
      for (const [sphere, id] of BALLS) {
        paint(id, lighting.sphere(sphere));
        await rest(REST_MS / 4);
      }
      paint("panorama", panoramaAhead(light, worldFromCamera));
      box("panorama-text").textContent = `all around; the middle is ahead${invented(light)}`;
      await rest(REST_MS / 4);
    }
    this.drawing = false;
  }
}

function mirrorImage({ panorama }: Light, coarse: Lighting, worldFromCamera: Matrix3x3): ImageData {
  if (!panorama) return coarse.sphere("mirror");
  return new ImageData(mirrorBall(panorama, worldFromCamera, MIRROR_SIZE), MIRROR_SIZE);
}

function panoramaAhead(light: Light, worldFromCamera: Matrix3x3 | null): ImageData {
  const m = worldFromCamera;
  const heading = m ? Math.atan2(-m[2], m[8]) : 0;
  const rows = light.panorama ? PANORAMA_HEIGHT : COARSE_HEIGHT;
  return panoramaImage(light, rows, 0.5 - heading / (2 * Math.PI));
}

/** What is made up, where that is so. */
function invented({ panorama }: Light): string {
  const { detailOf } = panorama ?? {};
  return detailOf && detailOf !== SCENE_FILE.itself
    ? "; outside the photo, detail is invented"
    : "";
}

function paint(id: string, picture: ImageData): void {
  const onto = canvas(id);
  onto.width = picture.width;
  onto.height = picture.height;
  onto.getContext("2d")?.putImageData(picture, 0, 0);
}

function rest(ms: number): Promise<void> {
  return new Promise((resolve) => setTimeout(resolve, ms));
}

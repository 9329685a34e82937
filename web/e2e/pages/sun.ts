/** The page's own stage with a .glb on a plain grey picture, lit by one lamp and an even sky. */
import { addLamps, IDENTITY, type Lamp, Light } from "deeplight/core";
import type { Picture } from "../../src/camera/picture.ts";
import { worldFromCamera } from "../../src/sensors/pose.ts";
import { verticalFov } from "../../src/view/fit.ts";
import { OwnObject } from "../../src/view/glb.ts";
import type { Viewpoint } from "../../src/view/ground.ts";
import { Stage } from "../../src/view/stage.ts";

const SIZE = { width: 960, height: 720 };
const GREY = 200;
const PITCH_RAD = -0.6;
const SIZE_M = 0.5;

export interface Shown {
  /** Of the whole picture. */
  readonly view: Viewpoint;
  readonly width: number;
  readonly height: number;
  /** Green pixel values, one byte each, rows from the top, base64. */
  readonly green: string;
  /** That of the picture without an object. */
  readonly plain: number;
  /** Where the object stands; its longest side. */
  readonly foot: readonly number[];
  readonly sizeM: number;
}

const stage = new Stage(document.querySelector("canvas")!);

/**
 * Shows a .glb file.
 *
 * @param sky radiance from everywhere.
 * @param rows of the panorama that holds both.
 * @param isKnown names the lamp, as a photo's light does; a film's does not.
 */
async function sunlit(
  glb: string,
  lamp: Lamp,
  sky: number,
  rows: number,
  isKnown: boolean,
): Promise<Shown> {
  const bytes = Uint8Array.from(atob(glb), (letter) => letter.charCodeAt(0));
  const radiance = new Float32Array(6 * rows * rows).fill(sky);
  addLamps(radiance, [lamp], rows);
  const seen = new Float32Array(2 * rows * rows);
  stage.show(plainPicture());
  stage.setPose(worldFromCamera(0, PITCH_RAD));
  stage.standAt(0.5, 0.5);
  stage.anchor.scale.setScalar(SIZE_M);
  stage.exhibitNow(await OwnObject.open(new Blob([bytes])));
  stage.setLight(Light.of({ radiance, seen, height: rows }, null, isKnown ? [lamp] : []), IDENTITY);
  const verticalFovRad = verticalFov(SIZE, stage.longSideFovRad);
  return {
    view: { ...stage.viewpoint, verticalFovRad, aspect: SIZE.width / SIZE.height },
    ...SIZE,
    green: greenOf(stage.snapshot()),
    plain: GREY,
    foot: stage.anchor.position.toArray(),
    sizeM: SIZE_M,
  };
}

function plainPicture(): Picture {
  const source = Object.assign(document.createElement("canvas"), SIZE);
  const context = source.getContext("2d")!;
  context.fillStyle = `rgb(${GREY} ${GREY} ${GREY})`;
  context.fillRect(0, 0, SIZE.width, SIZE.height);
  const grab = () => createImageBitmap(source);
  const atFullSize = <T>(act: () => Promise<T>) => act();
  const nothing = { file: null, verticalFovRad: undefined, up: null, close() {} };
  return { kind: "photo", ...SIZE, source, grab, atFullSize, ...nothing };
}

function greenOf(picture: HTMLCanvasElement): string {
  const { data } = picture.getContext("2d")!.getImageData(0, 0, picture.width, picture.height);
  let text = "";
  for (let i = 1; i < data.length; i += 4) text += String.fromCharCode(data[i]!);
  return btoa(text);
}

declare global {
  interface Window {
    sunlit: typeof sunlit;
  }
}
window.sunlit = sunlit;

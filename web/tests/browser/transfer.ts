/** What the browser test of transfer runs: a small picture of the golden object, as bytes. */
import { Color, LinearSRGBColorSpace, PerspectiveCamera, Scene, WebGLRenderer } from "three";
import { makeGroundShadow, makeTransferObject, parseTransfer } from "../../src/transfer/index.ts";

export interface Shot {
  readonly file: string;
  readonly light: readonly number[];
  readonly show: "diffuse" | "glossy" | "ground";
  readonly eye: {
    place: [number, number, number];
    target: [number, number, number];
    fov_rad: number;
  };
  readonly size: number;
  readonly backdrop: number;
}

/** RGBA rows from the top. */
export function draw(shot: Shot): number[] {
  const { size, eye } = shot;
  const bytes = Uint8Array.from(atob(shot.file), (letter) => letter.charCodeAt(0));
  const transfer = parseTransfer(bytes.buffer);
  const object =
    shot.show === "ground" ? makeGroundShadow(transfer) : makeTransferObject(transfer, shot.show);
  object.setLight(Float32Array.from(shot.light));
  const canvas = document.createElement("canvas");
  const renderer = new WebGLRenderer({ canvas, preserveDrawingBuffer: true });
  renderer.outputColorSpace = LinearSRGBColorSpace;
  renderer.setSize(size, size, false);
  const scene = new Scene();
  scene.background = new Color(shot.backdrop, shot.backdrop, shot.backdrop);
  // Turned and moved as a whole, like an object that the user has placed: the picture stays the same.
  object.rotation.y = 0.8;
  object.position.set(3, 0, -2);
  object.scale.setScalar(2);
  scene.add(object);
  const camera = new PerspectiveCamera((eye.fov_rad * 180) / Math.PI, 1, 0.1, 100);
  object.updateMatrixWorld();
  camera.position.set(...eye.place).applyMatrix4(object.matrixWorld);
  const target = camera.position
    .clone()
    .set(...eye.target)
    .applyMatrix4(object.matrixWorld);
  camera.lookAt(target);
  renderer.render(scene, camera);
  const flat = document.createElement("canvas");
  flat.width = flat.height = size;
  const context = flat.getContext("2d")!;
  context.drawImage(canvas, 0, 0);
  object.dispose();
  renderer.dispose();
  return Array.from(context.getImageData(0, 0, size, size).data);
}

Object.assign(globalThis, { drawTransfer: draw });

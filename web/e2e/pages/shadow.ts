/** Draws the floor under a box that floats at height 1, as the page does. */
import { IDENTITY, Light, Lighting } from "deeplight/core";
import {
  BoxGeometry,
  FloatType,
  Mesh,
  MeshBasicMaterial,
  OrthographicCamera,
  PlaneGeometry,
  Scene,
  WebGLRenderer,
  WebGLRenderTarget,
} from "three";
import { FloorShadow } from "../../src/view/floor-shadow.ts";

const SIZE = 16;

/**
 * Pixel value of a white floor in the middle of the shadow of boxes, one inside the other.
 *
 * @param radiance of the mirror ball, RGB.
 */
function left(radiance: readonly number[], boxes: number): number {
  const box = new Mesh(new BoxGeometry(1, 0.5, 1).translate(0, 1.25, 0));
  for (let i = 1; i < boxes; i++) box.add(new Mesh(box.geometry));
  const shadow = new FloorShadow(box, 12 * boxes);
  const lighting = Lighting.fromRadiance(Float32Array.from(radiance));
  shadow.setLight(new Light(lighting, null), IDENTITY);
  const white = new Mesh(new PlaneGeometry(9, 9).rotateX(-Math.PI / 2), new MeshBasicMaterial());
  white.position.y = -1;
  const scene = new Scene().add(white, shadow.mesh);
  const camera = new OrthographicCamera(-0.2, 0.2, 0.2, -0.2, 0.1, 20);
  camera.position.y = 5;
  camera.lookAt(0, 0, 0);
  const renderer = new WebGLRenderer();
  const target = new WebGLRenderTarget(SIZE, SIZE, { type: FloatType });
  for (let frame = 0; frame < 2; frame++) {
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
  }
  const values = new Float32Array(4 * SIZE * SIZE);
  renderer.readRenderTargetPixels(target, 0, 0, SIZE, SIZE, values);
  renderer.dispose();
  shadow.dispose();
  return values[4 * (SIZE * (SIZE / 2) + SIZE / 2)]!;
}

declare global {
  interface Window {
    left: typeof left;
  }
}
window.left = left;

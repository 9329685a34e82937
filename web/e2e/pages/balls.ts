/** Draws a ball as the page would, seen from far away, so that a mirror one shows the light's own mapping. */
import {
  FloatType,
  type Material,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  OrthographicCamera,
  Scene,
  SphereGeometry,
  WebGLRenderer,
  WebGLRenderTarget,
} from "three";
import { cubeTexture } from "../../packages/deeplight/src/adapters/three.ts";
import { Lighting } from "../../packages/deeplight/src/light/lighting.ts";
import type { Matrix3x3 } from "../../packages/deeplight/src/light/matrix.ts";
import { Light } from "../../packages/deeplight/src/light.ts";
import { worldFromCamera } from "../../src/sensors/pose.ts";
import { BallLight } from "../../src/view/ball-light.ts";
import { standardMaterial } from "../../src/view/material.ts";

const SIZE = 32;
const FINER = 4;
const renderer = new WebGLRenderer();
const light = new BallLight();

/** "cube" is a mirror in the package's cube texture. */
type Kind = "mirror" | "diffuse" | "silver" | "glossy" | "cube";

function materialOf(kind: Kind, lighting: Light): Material {
  if (kind === "cube") return new MeshBasicMaterial({ envMap: cubeTexture(lighting) });
  if (kind === "mirror") return light.mirror();
  const material = light.lights(standardMaterial(kind));
  if (kind === "glossy") Object.assign(material, { roughness: 0, metalness: 1 }); // sharp
  return material;
}

/** Linear radiance, rows from the top, RGB, of a ball of a material seen by a camera held like that. */
function ball(
  kind: Kind,
  logRadiance: readonly number[],
  [yaw, pitch, roll]: readonly [number, number, number],
): number[] {
  const pose = worldFromCamera(yaw, pitch, roll);
  const estimated = new Light(new Lighting(Float32Array.from(logRadiance)), null);
  const scene = new Scene();
  light.set(estimated, pose);
  scene.add(new Mesh(new SphereGeometry(1, 192, 96), materialOf(kind, estimated.turned(pose))));
  const pixels = SIZE * FINER;
  const target = new WebGLRenderTarget(pixels, pixels, { type: FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, held(pose));
  const values = new Float32Array(4 * pixels * pixels);
  renderer.readRenderTargetPixels(target, 0, 0, pixels, pixels, values);
  return averaged(values);
}

function held([a, b, c, d, e, f, g, h, i]: Matrix3x3): OrthographicCamera {
  const camera = new OrthographicCamera(-1, 1, 1, -1, 0.1, 20);
  const turn = new Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1);
  camera.quaternion.setFromRotationMatrix(turn);
  camera.position.set(c, f, i).multiplyScalar(10); // it looks along its -Z
  return camera;
}

/** Boxes of FINER x FINER, and the rows from the top. */
function averaged(values: Float32Array): number[] {
  const result = new Array<number>(3 * SIZE * SIZE).fill(0);
  values.forEach((value, at) => {
    const [channel, pixel] = [at % 4, Math.floor(at / 4)];
    if (channel === 3) return;
    const column = Math.floor((pixel % (SIZE * FINER)) / FINER);
    const row = SIZE - 1 - Math.floor(pixel / (SIZE * FINER) / FINER);
    result[3 * (row * SIZE + column) + channel]! += value / FINER ** 2;
  });
  return result;
}

declare global {
  interface Window {
    ball: typeof ball;
  }
}
window.ball = ball;

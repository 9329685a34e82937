import { DeepLightEstimatedLight } from "deeplight/three";
import {
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  Scene,
  SphereGeometry,
  WebGLRenderer,
} from "three";
import { start } from "./show.ts";

const canvas = document.querySelector<HTMLCanvasElement>("#view")!;
const renderer = new WebGLRenderer({ canvas, preserveDrawingBuffer: true });
renderer.setSize(400, 400, false);
const scene = new Scene();
const camera = new PerspectiveCamera(20, 1);
camera.position.z = 10;
const material = new MeshStandardMaterial({ metalness: 1, roughness: 0.2 });
scene.add(new Mesh(new SphereGeometry(1, 64, 32), material));

const estimated = new DeepLightEstimatedLight(renderer);
scene.add(estimated);

start((light) => {
  estimated.setLight(light, camera);
  scene.environment = estimated.environment;
  renderer.render(scene, camera);
});

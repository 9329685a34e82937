import {
  Color3,
  Color4,
  DirectionalLight,
  Engine,
  FreeCamera,
  HDRCubeTexture,
  MeshBuilder,
  PBRMaterial,
  Scene,
  Vector3,
} from "@babylonjs/core";
import { type BabylonLight, lightBabylonScene } from "deeplight/babylon";
import { start } from "./show.ts";

const canvas = document.querySelector<HTMLCanvasElement>("#view")!;
const engine = new Engine(canvas, true, { preserveDrawingBuffer: true });
const scene = new Scene(engine);
scene.useRightHandedSystem = new URLSearchParams(location.search).has("right-handed");
scene.clearColor = new Color4(0, 0, 0, 1);
const away = scene.useRightHandedSystem ? 10 : -10;
const camera = new FreeCamera("camera", new Vector3(0, 0, away), scene);
camera.setTarget(Vector3.Zero());
camera.fov = (20 * Math.PI) / 180;
const ball = MeshBuilder.CreateSphere("ball", { diameter: 2, segments: 32 }, scene);
const material = new PBRMaterial("metal", scene);
Object.assign(material, { metallic: 1, roughness: 0.2 });
ball.material = material;

let shown: BabylonLight<HDRCubeTexture, DirectionalLight> | undefined;
start(async (light) => {
  const parts = { HDRCubeTexture, DirectionalLight, Vector3, Color3 };
  const before = shown;
  shown = await lightBabylonScene(parts, scene, light);
  before?.dispose();
  await scene.whenReadyAsync();
  scene.render();
});

// Two balls in Babylon.js, in a browser without a screen, under a glTF that deeplight exported.
//
// node babylon_balls.mjs LIGHT.gltf OUT_FOLDER SIZE name=albedo...
// Writes OUT/name.f32: float32 RGBA, rows from the top. DEEPLIGHT_NODE_MODULES holds babylonjs,
// babylonjs-loaders and playwright-core; DEEPLIGHT_CHROMIUM is the browser.
import { createRequire } from 'node:module';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';

const [light, out, size, ...materials] = process.argv.slice(2);
const modules = process.env.DEEPLIGHT_NODE_MODULES;
const { chromium } = createRequire(path.join(modules, 'x.js'))('playwright-core');

const browser = await chromium.launch({
  executablePath: process.env.DEEPLIGHT_CHROMIUM ?? '/usr/bin/chromium',
  args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist',
    '--disable-gpu-watchdog'], // which ends the graphics where a busy machine draws slowly
  timeout: 0, // the test has its own limit
});
try {
  const tab = await browser.newPage();
  tab.setDefaultTimeout(0);
  tab.on('console', (message) => console.log(message.text()));
  for (const script of ['babylonjs/babylon.js', 'babylonjs-loaders/babylonjs.loaders.js'])
    await tab.addScriptTag({ path: path.join(modules, script) });
  const document = (await readFile(light)).toString('utf8');
  for (const text of materials) {
    const [name, albedo] = text.split('=');
    const values = await tab.evaluate(drawn, { document, name, albedo: +albedo, size: +size });
    await writeFile(path.join(out, `${name}.f32`), Buffer.from(values, 'base64'));
  }
} finally {
  await browser.close();
}

// Runs in the browser.
async function drawn({ document: text, name, albedo, size }) {
  const canvas = document.createElement('canvas');
  const engine = new BABYLON.Engine(canvas, false);
  const scene = new BABYLON.Scene(engine);
  scene.imageProcessingConfiguration.applyByPostProcess = true; // materials write linear radiance
  await BABYLON.SceneLoader.AppendAsync('', `data:${text}`, scene, undefined, '.gltf');
  scene.environmentTexture.gammaSpace = false; // else 9.34 decodes the faces' gamma twice
  const ball = BABYLON.MeshBuilder.CreateSphere('ball', { diameter: 2, segments: 128 }, scene);
  const material = new BABYLON.PBRMaterial('material', scene);
  material.albedoColor = new BABYLON.Color3(albedo, albedo, albedo);
  material.metallic = name === 'diffuse' ? 0 : 1;
  material.roughness = name === 'diffuse' ? 1 : 0;
  if (name === 'diffuse') material.metallicF0Factor = 0; // no specular on the grey ball
  ball.material = material;
  const camera = new BABYLON.FreeCamera('camera', new BABYLON.Vector3(0, 0, 5), scene);
  camera.setTarget(BABYLON.Vector3.Zero()); // looks along -Z
  camera.mode = BABYLON.Camera.ORTHOGRAPHIC_CAMERA;
  [camera.orthoLeft, camera.orthoRight, camera.orthoTop, camera.orthoBottom] = [-1, 1, 1, -1];
  const target = new BABYLON.RenderTargetTexture('out', size, scene, { type: BABYLON.Constants.TEXTURETYPE_FLOAT, generateMipMaps: false });
  target.renderList = [ball];
  target.activeCamera = camera;
  scene.customRenderTargets.push(target);
  scene.activeCamera = camera;
  await scene.whenReadyAsync();
  scene.render();
  scene.render();
  const pixels = await target.readPixels();
  const upright = new Float32Array(size * size * 4);
  for (let row = 0; row < size; row++)
    upright.set(pixels.slice((size - 1 - row) * size * 4, (size - row) * size * 4), row * size * 4);
  let binary = '';
  for (const byte of new Uint8Array(upright.buffer)) binary += String.fromCharCode(byte);
  engine.dispose();
  return btoa(binary);
}

// Two balls in three.js, in a real browser without a screen, under a light that deeplight exported.
//
// node three_balls.mjs LIGHT.js OUT_FOLDER SIZE WAY name=albedo...
// WAY: environment (scene.environment), lights (harmonics and a directional light), cube (six faces
// LIGHT_px.exr ... as CubeTexture) or gain-map (LIGHT.jpg). Writes OUT/name.f32: float32 RGBA, rows
// from the top. DEEPLIGHT_NODE_MODULES holds three and playwright-core; DEEPLIGHT_CHROMIUM the browser.
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';

const [light, out, size, way, ...materials] = process.argv.slice(2);
const modules = process.env.DEEPLIGHT_NODE_MODULES;
const { chromium } = createRequire(path.join(modules, 'x.js'))('playwright-core');

const kinds = { '.js': 'text/javascript', '.mjs': 'text/javascript', '.html': 'text/html' };
const page = `<!doctype html><script type="importmap">{"imports": {
  "three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}</script>`;

// Serves the page, three.js and the files next to LIGHT; nothing comes from outside.
const server = createServer(async (request, response) => {
  const url = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
  try {
    const file = url.startsWith('/three/') ? path.join(modules, url) : path.join(path.dirname(light), url);
    const content = url === '/' ? page : await readFile(file);
    response.writeHead(200, { 'content-type': url === '/' ? 'text/html' : kinds[path.extname(url)] ?? 'application/octet-stream' });
    response.end(content);
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise((done) => server.listen(0, '127.0.0.1', done));

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
  await tab.goto(`http://127.0.0.1:${server.address().port}/`);
  for (const text of materials) {
    const [name, albedo] = text.split('=');
    const values = await tab.evaluate(drawn, { stem: path.basename(light, '.js'), name, albedo: +albedo, size: +size, way });
    await writeFile(path.join(out, `${name}.f32`), Buffer.from(values, 'base64'));
  }
} finally {
  await browser.close();
  server.close();
}

// Runs in the browser.
async function drawn({ stem, name, albedo, size, way }) {
  const THREE = await import('three');
  const exported = await import(`/${stem}.js`);
  const renderer = new THREE.WebGLRenderer();
  renderer.toneMapping = THREE.NoToneMapping;
  const scene = new THREE.Scene();
  const grey = new THREE.Color().setRGB(albedo, albedo, albedo);
  // No specular on the grey ball: the standard material adds 4 % of it.
  const material = name === 'diffuse'
    ? new THREE.MeshPhysicalMaterial({ color: grey, roughness: 1, metalness: 0, specularIntensity: 0 })
    : new THREE.MeshStandardMaterial({ color: grey, roughness: 0, metalness: 1 });
  if (way === 'environment') await exported.addEnvironment(scene);
  if (way === 'lights') exported.addLights(scene, { castShadow: false });
  if (way === 'gain-map') {
    const { UltraHDRLoader } = await import('three/addons/loaders/UltraHDRLoader.js');
    const texture = await new UltraHDRLoader().loadAsync(`/${stem}.jpg`);
    texture.mapping = THREE.EquirectangularReflectionMapping;
    scene.environment = texture;
  }
  if (way === 'cube') {
    const { EXRLoader } = await import('three/addons/loaders/EXRLoader.js');
    const loader = new EXRLoader();
    const faces = [];
    for (const face of ['px', 'nx', 'py', 'ny', 'pz', 'nz']) {
      // Cube faces are stored from the top; the EXR loader gives rows from the bottom.
      const texture = await loader.loadAsync(`/${stem}_${face}.exr`);
      const { data, width, height } = texture.image;
      const rows = Array.from({ length: height }, (_, row) => data.slice(row * width * 4, (row + 1) * width * 4));
      const upright = new data.constructor(data.length);
      rows.reverse().forEach((row, i) => upright.set(row, i * width * 4));
      faces.push(new THREE.DataTexture(upright, width, height, texture.format, texture.type));
    }
    const cube = new THREE.CubeTexture(faces);
    cube.format = faces[0].format;
    cube.type = faces[0].type;
    cube.needsUpdate = true;
    scene.environment = cube;
  }
  scene.add(new THREE.Mesh(new THREE.SphereGeometry(1, 256, 128), material));
  const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 10);
  camera.position.z = 5; // looks along -Z
  const fine = 4 * size; // averaged below, as a box filter
  const target = new THREE.WebGLRenderTarget(fine, fine, { type: THREE.FloatType });
  renderer.setRenderTarget(target);
  renderer.render(scene, camera);
  const pixels = new Float32Array(fine * fine * 4);
  renderer.readRenderTargetPixels(target, 0, 0, fine, fine, pixels);
  const small = new Float32Array(size * size * 4);
  for (let i = 0; i < pixels.length; i++) {
    const channel = i % 4, column = Math.floor(i / 4) % fine, row = fine - 1 - Math.floor(i / 4 / fine);
    small[(Math.floor(row / 4) * size + Math.floor(column / 4)) * 4 + channel] += pixels[i] / 16;
  }
  let text = '';
  for (const byte of new Uint8Array(small.buffer)) text += String.fromCharCode(byte);
  return btoa(text);
}

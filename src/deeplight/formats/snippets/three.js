// The light of @NAME@ for three.js (r163 or newer). Made by deeplight convert.
//
//   import { addEnvironment } from './@NAME@.js';
//   await addEnvironment(scene);
//
// Directions are the photo's: a camera that looks along -Z, three.js's default, sees the light
// where the photo saw it. Radiance 1.0 is the photo's white: use renderer.toneMapping =
// NoToneMapping (or LinearToneMapping, exposure 1) to match the photo.
import * as THREE from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';

// The environment is already turned for three.js: no rotation is needed.
export const environmentUrl = new URL(@EXR@, import.meta.url).href;

// Unit vector towards the main light, its irradiance (RGB) and its angular radius in radians.
export const mainLight = @MAIN_LIGHT@;

// Radiance without the main light, all-positive sign, order 00 1-1 10 11 2-2 2-1 20 21 22.
export const sphericalHarmonics = @HARMONICS@;

/** Light the scene by the whole environment. */
export async function addEnvironment(scene, { url = environmentUrl, background = false } = {}) {
  const texture = await new EXRLoader().loadAsync(url);
  texture.mapping = THREE.EquirectangularReflectionMapping;
  scene.environment = texture;
  if (background) scene.background = texture;
  return texture;
}

/** The cheap way, with shadows: harmonics and one directional light add up to the same light. */
export function addLights(scene, { distance = 10, castShadow = true } = {}) {
  const probe = new THREE.LightProbe();
  probe.sh.coefficients.forEach((to, i) => to.fromArray(sphericalHarmonics[i]));
  const [r, g, b] = mainLight.irradiance;
  const strength = Math.max(r, g, b);
  const sun = new THREE.DirectionalLight(0xffffff, strength);
  if (strength > 0) sun.color.setRGB(r / strength, g / strength, b / strength);
  sun.position.fromArray(mainLight.direction).multiplyScalar(distance);
  sun.castShadow = castShadow;
  scene.add(probe, sun, sun.target);
  return { probe, sun };
}

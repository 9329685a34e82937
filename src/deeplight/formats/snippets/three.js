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
export const environmentUrl = new URL(@PICTURE@, import.meta.url).href;

// Unit vector towards the main light, its irradiance (RGB) and its angular radius in radians.
export const mainLight = @MAIN_LIGHT@;

// All compact lights, the main light first.
export const lights = @LIGHTS@;

// Whether the environment was written without them; then addEnvironment adds them.
export const lightsApart = @APART@;

// Radiance without the lights, all-positive sign, order 00 1-1 10 11 2-2 2-1 20 21 22.
export const sphericalHarmonics = @HARMONICS@;

/** Light the scene by the whole environment; compact lights that are not in it are added. */
export async function addEnvironment(scene, { url = environmentUrl, background = false } = {}) {
  const texture = await new EXRLoader().loadAsync(url);
  texture.mapping = THREE.EquirectangularReflectionMapping;
  scene.environment = texture;
  if (background) scene.background = texture;
  if (lightsApart) addSuns(scene);
  return texture;
}

/** The cheap way, with shadows: harmonics and directional lights add up to the same light. */
export function addLights(scene, options = {}) {
  const probe = new THREE.LightProbe();
  probe.sh.coefficients.forEach((to, i) => to.fromArray(sphericalHarmonics[i]));
  scene.add(probe);
  const suns = addSuns(scene, options);
  return { probe, sun: suns[0], suns };
}

/** Each compact light as a directional light. */
export function addSuns(scene, { distance = 10, castShadow = true } = {}) {
  return lights.map(({ direction, irradiance: [r, g, b] }) => {
    const strength = Math.max(r, g, b);
    const sun = new THREE.DirectionalLight(0xffffff, strength);
    if (strength > 0) sun.color.setRGB(r / strength, g / strength, b / strength);
    sun.position.fromArray(direction).multiplyScalar(distance);
    sun.castShadow = castShadow;
    scene.add(sun, sun.target);
    return sun;
  });
}

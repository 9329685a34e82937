/** A made-up light, to see whether a scene shows it where it is: one lamp in even, dim light. */
import { Light, Lighting, type Vector3 } from "deeplight";

const SIZE = 32;

/**
 * @param towards the lamp: unit vector, +X right, +Y up, +Z towards the camera.
 * @param sharpness 60 is a lamp, 3 a window as wide as a wall.
 */
export function lampLight(towards: Vector3, brightness = 30, sharpness = 60): Light {
  const radiance = new Float32Array(3 * SIZE * SIZE);
  for (let pixel = 0; pixel < SIZE * SIZE; pixel++) {
    const direction = directionOf(pixel);
    const cosine = direction.reduce((sum, value, k) => sum + value * towards[k]!, 0);
    radiance.fill(0.2 + brightness * Math.exp(sharpness * (cosine - 1)), 3 * pixel, 3 * pixel + 3);
  }
  return new Light(Lighting.fromRadiance(radiance), null);
}

/** Where a pixel of the mirror ball looks. */
function directionOf(pixel: number): Vector3 {
  const u = (2 * ((pixel % SIZE) + 0.5)) / SIZE - 1;
  const v = 1 - (2 * (Math.floor(pixel / SIZE) + 0.5)) / SIZE;
  const radius = Math.max(Math.hypot(u, v), 1);
  const z = Math.sqrt(Math.max(1 - (u * u + v * v) / radius ** 2, 0));
  return [(2 * z * u) / radius, (2 * z * v) / radius, 2 * z * z - 1];
}

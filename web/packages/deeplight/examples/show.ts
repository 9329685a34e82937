/** What all examples share: they light a ball with the photo's light, or with any other. */
import { type Light, load } from "deeplight";
import { lampLight } from "./lamp.ts";

declare global {
  interface Window {
    /** Lights the ball with a lamp instead. */
    showLamp(...lamp: Parameters<typeof lampLight>): Promise<void>;
    /** Once the photo's light is there. */
    lit: Promise<Light>;
  }
}

export function start(show: (light: Light) => void | Promise<void>): void {
  window.showLamp = async (...lamp) => show(lampLight(...lamp));
  window.lit = fromPhoto(show);
  window.lit.catch((error: unknown) => console.error(error));
}

async function fromPhoto(show: (light: Light) => void | Promise<void>): Promise<Light> {
  const estimator = await load();
  const photo = await fetch("./photo.jpg");
  const light = await estimator.estimate(await photo.blob());
  await show(light);
  return light;
}

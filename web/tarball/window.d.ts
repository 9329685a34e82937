/** What the pages under test have: examples/show.ts. */
import type { Light, Vector3 } from "deeplight";

declare global {
  interface Window {
    showLamp(towards: Vector3, brightness?: number, sharpness?: number): Promise<void>;
    lit: Promise<Light>;
  }
}

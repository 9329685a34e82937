/** A light's panorama as the camera would show it. */
import { type Light, pixelFromRadiance } from "deeplight/core";

/** @param viewU where the view stands, 0 to 1 from the left edge. */
export function panoramaImage(light: Light, height: number, viewU?: number): ImageData {
  const radiance = light.environment(height, viewU);
  const picture = new ImageData(2 * height, height);
  for (let i = 0; i < 2 * height ** 2; i++) {
    for (let c = 0; c < 3; c++) {
      picture.data[4 * i + c] = 255 * pixelFromRadiance(radiance[3 * i + c]!);
    }
    picture.data[4 * i + 3] = 255;
  }
  return picture;
}

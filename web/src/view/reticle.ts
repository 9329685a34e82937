/** The ring on the floor that shows where a tap would place the object. */
import { Mesh, MeshBasicMaterial, RingGeometry } from "three";

/** Of an object of size 1: as wide as what stands in it. */
const RADIUS = 0.5;

export function makeReticle(): Mesh {
  const ring = new RingGeometry(0.9 * RADIUS, RADIUS, 64).rotateX(-Math.PI / 2);
  const material = new MeshBasicMaterial({
    color: 0xffffff,
    opacity: 0.75,
    transparent: true,
    depthTest: false,
    toneMapped: false,
  });
  const reticle = new Mesh(ring, material);
  reticle.renderOrder = 2;
  reticle.visible = false;
  return reticle;
}

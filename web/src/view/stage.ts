/** The view: the camera's picture, and in it an object with its shadow, drawn when something changed. */

import { ASSUMED_LONG_SIDE_FOV_RAD, IDENTITY, type Light, type Matrix3x3 } from "deeplight/core";
import { Box3, Group, Mesh, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import type { Picture } from "../camera/picture.ts";
import { Failure } from "../failure.ts";
import { rotation } from "../sensors/pose.ts";
import { Backdrop } from "./backdrop.ts";
import { movedClear, type ScreenBox } from "./clearance.ts";
import type { Exhibit } from "./exhibit.ts";
import { type Fit, fitOn, focalLength, type Size, verticalFov } from "./fit.ts";
import { SHADOW_NAME } from "./floor-shadow.ts";
import { groundPoint, showsGround, type Viewpoint } from "./ground.ts";
import { useCameraResponse } from "./response.ts";
import { makeReticle } from "./reticle.ts";

/** Sharper than this no eye sees, and old phones would slow down. */
const MOST_PIXEL_RATIO = 2;
const LONGEST_SNAPSHOT = 4096;
const PATIENCE_MS = 3000;

interface LightInWorld {
  readonly light: Light;
  readonly worldFromCamera: Matrix3x3;
}

export class Stage {
  /** The camera, in metres above the plane y = 0. */
  heightM = 1.4;
  longSideFovRad: number = ASSUMED_LONG_SIDE_FOV_RAD;
  readonly anchor = new Group();
  /** Called when the graphics are gone and do not come back by themselves. */
  onLost: () => void = () => {};
  private made: WebGLRenderer | null = null;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(60, 1, 0.01, 100);
  private readonly backdrop = new Backdrop();
  private readonly reticle = makeReticle();
  private worldFromCamera: Matrix3x3 = IDENTITY;
  private picture: Picture | null = null;
  private exhibit: Exhibit | null = null;
  private light: LightInWorld | null = null;
  private scheduled = false;
  /** In a room: the object stands somewhere. */
  isPlaced = false;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.camera.rotation.order = "YXZ";
    this.scene.add(this.backdrop.mesh, this.anchor, this.reticle);
    canvas.addEventListener("webglcontextlost", () => {
      setTimeout(() => this.renderer.getContext().isContextLost() && this.onLost(), PATIENCE_MS);
    });
    canvas.addEventListener("webglcontextrestored", () => this.invalidate());
  }

  /** Starts the graphics, which blocks the page for a while; else `show` does it. @throws Failure `no-webgl`. */
  start(): void {
    if (this.made) return;
    try {
      this.made = new WebGLRenderer({ canvas: this.canvas, antialias: true });
    } catch (error) {
      throw new Failure("no-webgl", String(error));
    }
    useCameraResponse(this.made);
  }

  show(picture: Picture): void {
    this.picture = picture;
    this.backdrop.show(picture.source);
    this.layOut();
  }

  clear(): void {
    this.picture = null;
    this.light = null;
    this.backdrop.hide();
    this.invalidate();
  }

  /** Takes the place of what stood there; the caller disposes of that. */
  exhibitNow(exhibit: Exhibit): void {
    if (this.exhibit) this.anchor.remove(this.exhibit.object);
    this.exhibit = exhibit;
    this.anchor.add(exhibit.object);
    this.relight();
  }

  /** To be called when screen, picture or field of view have changed. */
  layOut(): void {
    const fit = this.fit();
    if (!fit) return;
    const { style } = this.canvas;
    style.left = `${fit.left}px`;
    style.top = `${fit.top}px`;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, MOST_PIXEL_RATIO));
    this.renderer.setSize(fit.width, fit.height);
    this.aim(fit);
    this.invalidate();
  }

  setPose(worldFromCamera: Matrix3x3): void {
    this.worldFromCamera = worldFromCamera;
    this.invalidate();
  }

  /** New light, in the frame of a camera held like `worldFromCamera`. */
  setLight(light: Light, worldFromCamera: Matrix3x3): void {
    this.light = { light, worldFromCamera };
    this.relight();
  }

  /** To be called when the object was turned, moved or changed its material. */
  relight(): void {
    if (this.light && this.exhibit) {
      const { light, worldFromCamera } = this.light;
      const objectFromWorld = rotation("y", -this.anchor.rotation.y);
      this.exhibit.setLight(light, worldFromCamera, objectFromWorld);
    }
    this.invalidate();
  }

  get viewpoint(): Viewpoint {
    const { worldFromCamera, heightM, camera } = this;
    const verticalFovRad = (camera.fov * Math.PI) / 180;
    return { worldFromCamera, heightM, verticalFovRad, aspect: camera.aspect };
  }

  /** Where the object's foot is seen, in shares of the view's width and height. */
  place(): readonly [number, number] {
    this.holdCamera();
    this.camera.updateMatrixWorld();
    const seen = this.anchor.position.clone().project(this.camera);
    return [(seen.x + 1) / 2, (1 - seen.y) / 2];
  }

  standAt(x: number, y: number): void {
    this.anchor.position.set(...groundPoint(this.viewpoint, x, y));
    this.invalidate();
  }

  /** A ring on the floor where the object would stand; nothing where there is no floor. */
  aimAt(place: readonly [number, number] | null): void {
    const is = place !== null && this.light !== null && showsGround(this.viewpoint, ...place);
    if (is) {
      this.reticle.position.set(...groundPoint(this.viewpoint, ...place));
      this.reticle.scale.setScalar(this.anchor.scale.x);
    }
    if (is || this.reticle.visible) this.invalidate();
    this.reticle.visible = is;
  }

  /** The same at a point in a room; null where there is no surface. */
  aimAtPoint(point: Vector3 | null): void {
    this.reticle.visible = point !== null;
    if (!point) return;
    this.reticle.position.copy(point);
    this.reticle.scale.setScalar(this.anchor.scale.x);
  }

  /** Where the reticle is; null where it is not. */
  get target(): Vector3 | null {
    return this.reticle.visible ? this.reticle.position : null;
  }

  /** Where the camera was in the frame drawn last. */
  viewer(): Vector3 {
    return new Vector3().setFromMatrixPosition(this.camera.matrixWorld);
  }

  get gl(): WebGL2RenderingContext {
    return this.renderer.getContext() as WebGL2RenderingContext;
  }

  /**
   * Draws into a WebXR session, over the camera's picture that the device itself shows, until it ends.
   *
   * @param before is called in each of its frames.
   */
  async present(
    session: XRSession,
    before: (frame: XRFrame, space: XRReferenceSpace) => void,
  ): Promise<void> {
    const { renderer } = this;
    const { xr } = renderer;
    this.isPlaced = false;
    session.addEventListener("end", () => {
      renderer.setAnimationLoop(null);
      xr.enabled = false;
      this.light = null;
      this.aimAtPoint(null);
      this.layOut();
    });
    xr.enabled = true;
    xr.setReferenceSpaceType("local");
    renderer.setAnimationLoop((_, frame) => {
      const space = xr.getReferenceSpace();
      if (!frame || !space) return;
      before(frame, space);
      this.anchor.visible = this.isPlaced && this.light !== null;
      renderer.render(this.scene, this.camera);
    });
    await xr.setSession(session);
  }

  /** Moves the view until a panel of the screen does not cover the object; null moves it back. */
  keepClearOf(panel: ScreenBox | null): void {
    const { style, offsetLeft, offsetTop, offsetWidth, offsetHeight } = this.canvas;
    const [right, bottom] = [offsetLeft + offsetWidth, offsetTop + offsetHeight];
    const view = { left: offsetLeft, top: offsetTop, right, bottom };
    const object = panel && this.picture && this.objectOn(view);
    const [left, up] = object ? movedClear(object, panel, view) : [0, 0];
    style.transform = left || up ? `translate(${-Math.round(left)}px, ${-Math.round(up)}px)` : "";
  }

  /** Draws in the next frame, once, however often it is called. */
  invalidate(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      if (this.picture) this.draw();
    });
  }

  /** The whole picture with the object in it, at the picture's own size. */
  snapshot(): HTMLCanvasElement {
    const picture = this.picture;
    if (!picture) throw new Failure("cannot-save", "nothing is shown");
    const scale = Math.min(1, LONGEST_SNAPSHOT / Math.max(picture.width, picture.height));
    const [width, height] = [picture.width * scale, picture.height * scale].map(Math.round);
    const copy = document.createElement("canvas");
    copy.width = width!;
    copy.height = height!;
    this.renderer.setPixelRatio(1);
    this.renderer.setSize(copy.width, copy.height, false);
    this.aim(fitOn(copy, picture, this.focalPx(picture)));
    this.reticle.visible = false;
    this.draw();
    copy.getContext("2d")?.drawImage(this.canvas, 0, 0);
    this.layOut();
    return copy;
  }

  /** Where the object is seen. */
  private objectOn({ left, top, right, bottom }: ScreenBox): ScreenBox | null {
    const bounds = new Box3();
    this.anchor.updateWorldMatrix(false, true);
    this.exhibit?.object.traverse((part) => {
      if (part instanceof Mesh && part.name !== SHADOW_NAME) bounds.expandByObject(part);
    });
    if (bounds.isEmpty()) return null;
    this.holdCamera();
    this.camera.updateMatrixWorld();
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => {
      const [x, y, z] = [i & 1, i & 2, i & 4].map((is) => (is ? bounds.max : bounds.min));
      return new Vector3(x!.x, y!.y, z!.z).project(this.camera);
    });
    const across = corners.map(({ x }) => left + ((x + 1) / 2) * (right - left));
    const down = corners.map(({ y }) => top + ((1 - y) / 2) * (bottom - top));
    return {
      left: Math.min(...across),
      top: Math.min(...down),
      right: Math.max(...across),
      bottom: Math.max(...down),
    };
  }

  private get renderer(): WebGLRenderer {
    this.start();
    return this.made!;
  }

  private draw(): void {
    this.anchor.visible = this.light !== null;
    this.holdCamera();
    this.renderer.render(this.scene, this.camera);
  }

  private holdCamera(): void {
    const [a, b, c, d, e, f, g, h, i] = this.worldFromCamera;
    this.camera.matrix.set(a, b, c, 0, d, e, f, this.heightM, g, h, i, 0, 0, 0, 0, 1);
    this.camera.matrix.decompose(this.camera.position, this.camera.quaternion, this.camera.scale);
  }

  private fit(): Fit | null {
    const { picture } = this;
    if (!picture?.width) return null;
    const screen: Size = { width: innerWidth, height: innerHeight };
    return fitOn(screen, picture, this.focalPx(picture));
  }

  private focalPx(picture: Picture): number {
    const fov = picture.verticalFovRad ?? verticalFov(picture, this.longSideFovRad);
    return focalLength(picture.height, fov);
  }

  private aim(fit: Fit): void {
    this.backdrop.crop(fit.share);
    this.camera.fov = (fit.verticalFovRad * 180) / Math.PI;
    this.camera.aspect = fit.width / fit.height;
    this.camera.updateProjectionMatrix();
  }
}

/**
 * The shadow of any object on the floor, under the light of the whole sky.
 *
 * Directions are drawn from the lighting in proportion to what they give the floor, so a lamp gets many
 * and its penumbra is as wide as it is. The object is flattened along each onto the floor, all in one
 * instanced draw: each instance lies nearer than those before and only draws where it is nearest of
 * its own kind, so an object blocks a direction once, however many triangles lie behind each other.
 * What is blocked is added up; the floor then multiplies the picture by what is left.
 */

import { GAMMA, type Light, type Matrix3x3 } from "deeplight/core";
import {
  AddEquation,
  CustomBlending,
  DoubleSide,
  HalfFloatType,
  InstancedBufferAttribute,
  InstancedBufferGeometry,
  LessDepth,
  Mesh,
  type Object3D,
  OneFactor,
  OrthographicCamera,
  PlaneGeometry,
  Scene,
  ShaderMaterial,
  SrcColorFactor,
  type WebGLRenderer,
  WebGLRenderTarget,
  ZeroFactor,
} from "three";
import { floorRays } from "./floor-rays.ts";

const PIXELS = 1024;
/** Half the side of the floor that can be in shadow, for an object of size 1. */
const REACH = 3.5;
const MOST_RAYS = 96;
const LEAST_RAYS = 16;
const MOST_TRIANGLES_DRAWN = 6e6;

const FLATTEN = `
  attribute vec3 toLight;
  attribute vec3 power;
  varying vec3 blocked;
  void main() {
    vec3 at = (modelMatrix * vec4(position, 1.0)).xyz;
    vec2 floorAt = at.xz - toLight.xz * (max(at.y, 0.0) / toLight.y);
    float nearer = 1.0 - 2.0 * (float(gl_InstanceID) + 1.0) / ${(MOST_RAYS + 1).toFixed(1)};
    gl_Position = vec4(floorAt / ${REACH.toFixed(3)}, nearer, 1.0);
    blocked = power;
  }`;
const ADD_UP = `
  varying vec3 blocked;
  void main() { gl_FragColor = vec4(blocked, 1.0); }`;
const FLOOR = `
  varying vec2 at;
  void main() {
    at = position.xz / ${REACH.toFixed(3)};
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  }`;
const MULTIPLY = `
  uniform sampler2D blocked;
  varying vec2 at;
  void main() {
    vec2 texel = vec2(1.2 / ${PIXELS.toFixed(1)}, 0.0);
    vec2 uv = 0.5 + 0.5 * at;
    vec3 share = 0.25 * (texture2D(blocked, uv + texel.xy).rgb + texture2D(blocked, uv - texel.xy).rgb
      + texture2D(blocked, uv + texel.yx).rgb + texture2D(blocked, uv - texel.yx).rgb);
    float fade = 1.0 - smoothstep(0.75, 1.0, length(at));
    gl_FragColor = vec4(pow(clamp(1.0 - fade * share, 0.0, 1.0), vec3(${(1 / GAMMA).toFixed(6)})), 1.0);
  }`;

/** What lies on the floor around the object is no part of it. */
export const SHADOW_NAME = "shadow";

export class FloorShadow {
  /** To be added to the object's own frame. */
  readonly mesh: Mesh;
  private readonly toLight: InstancedBufferAttribute;
  private readonly power: InstancedBufferAttribute;
  private readonly silhouettes = new Scene();
  private readonly target = new WebGLRenderTarget(PIXELS, PIXELS, { type: HalfFloatType });
  private readonly camera = new OrthographicCamera(-1, 1, 1, -1, -1, 1);
  private isOld = false;

  /** @param object stands on y = 0 and does not change its shape. */
  constructor(object: Object3D, triangles: number) {
    const rays = Math.floor(MOST_TRIANGLES_DRAWN / Math.max(triangles, 1));
    const count = Math.min(MOST_RAYS, Math.max(LEAST_RAYS, rays));
    this.toLight = new InstancedBufferAttribute(new Float32Array(3 * count), 3);
    this.power = new InstancedBufferAttribute(new Float32Array(3 * count), 3);
    this.addSilhouettes(object);
    this.mesh = this.madeFloor();
  }

  /** New light in a camera's frame; `objectFromCamera` turns its directions. */
  setLight(light: Light, objectFromCamera: Matrix3x3): void {
    const count = this.toLight.count;
    const { toLight, power } = floorRays(light, objectFromCamera, count);
    this.toLight.copyArray(toLight).needsUpdate = true;
    this.power.copyArray(power).needsUpdate = true;
    this.isOld = true;
  }

  dispose(): void {
    this.target.dispose();
  }

  private madeFloor(): Mesh {
    const plane = new PlaneGeometry(2 * REACH, 2 * REACH).rotateX(-Math.PI / 2);
    const material = new ShaderMaterial({
      vertexShader: FLOOR,
      fragmentShader: MULTIPLY,
      uniforms: { blocked: { value: this.target.texture } },
      blending: CustomBlending,
      blendSrc: ZeroFactor,
      blendDst: SrcColorFactor,
      depthWrite: false,
      transparent: true,
      polygonOffset: true, // what lies flat on the floor is seen, not its shadow
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
    const floor = new Mesh(plane, material);
    floor.name = SHADOW_NAME;
    floor.onBeforeRender = (renderer) => this.refresh(renderer);
    return floor;
  }

  private addSilhouettes(object: Object3D): void {
    const material = new ShaderMaterial({
      vertexShader: FLATTEN,
      fragmentShader: ADD_UP,
      side: DoubleSide,
      blending: CustomBlending,
      blendEquation: AddEquation,
      blendSrc: OneFactor,
      blendDst: OneFactor,
      transparent: true,
      depthFunc: LessDepth, // what lies behind in the same direction blocks nothing more
    });
    object.updateMatrixWorld(true);
    object.traverse((part) => {
      if (!(part instanceof Mesh)) return;
      const flat = new InstancedBufferGeometry();
      flat.index = part.geometry.index;
      flat.setAttribute("position", part.geometry.attributes.position);
      flat.setAttribute("toLight", this.toLight);
      flat.setAttribute("power", this.power);
      flat.instanceCount = this.toLight.count;
      const silhouette = new Mesh(flat, material);
      silhouette.matrixAutoUpdate = false;
      silhouette.matrix.copy(part.matrixWorld);
      silhouette.frustumCulled = false;
      this.silhouettes.add(silhouette);
    });
  }

  private refresh(renderer: WebGLRenderer): void {
    if (!this.isOld) return;
    this.isOld = false;
    const before = renderer.getRenderTarget();
    renderer.setRenderTarget(this.target);
    renderer.setClearColor(0x000000, 0);
    renderer.clear();
    renderer.render(this.silhouettes, this.camera);
    renderer.setRenderTarget(before);
  }
}

/** The camera's picture behind everything, byte for byte: no tone mapping, no mirroring. */
import {
  CanvasTexture,
  LinearFilter,
  Mesh,
  NoColorSpace,
  PlaneGeometry,
  ShaderMaterial,
  type Texture,
  Vector2,
  VideoTexture,
} from "three";
import type { Size } from "./fit.ts";

const VERTEX = `
  uniform vec2 share;
  varying vec2 at;
  void main() {
    at = 0.5 + share * 0.5 * position.xy;
    gl_Position = vec4(position.xy, 0.0, 1.0);
  }`;
const FRAGMENT = `
  uniform sampler2D picture;
  varying vec2 at;
  void main() { gl_FragColor = vec4(texture2D(picture, at).rgb, 1.0); }`;

export class Backdrop {
  readonly mesh: Mesh;
  private readonly material = new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: { picture: { value: null }, share: { value: new Vector2(1, 1) } },
    depthTest: false,
    depthWrite: false,
  });
  private texture: Texture | null = null;

  constructor() {
    this.mesh = new Mesh(new PlaneGeometry(2, 2), this.material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = -1;
    this.mesh.visible = false;
  }

  show(source: HTMLVideoElement | HTMLCanvasElement): void {
    this.texture?.dispose();
    const isVideo = source instanceof HTMLVideoElement;
    this.texture = isVideo ? new VideoTexture(source) : new CanvasTexture(source);
    this.texture.colorSpace = NoColorSpace;
    this.texture.minFilter = LinearFilter;
    this.texture.generateMipmaps = false;
    this.material.uniforms.picture!.value = this.texture;
    this.mesh.visible = true;
  }

  /** Which share of the picture is visible, around its centre. */
  crop(share: Size): void {
    this.material.uniforms.share!.value.set(share.width, share.height);
  }

  hide(): void {
    this.texture?.dispose();
    this.texture = null;
    this.mesh.visible = false;
  }
}

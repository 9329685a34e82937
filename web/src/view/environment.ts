/** The light as three.js wants it: an environment prefiltered for every roughness. */
import {
  DataTexture,
  DataUtils,
  EquirectangularReflectionMapping,
  HalfFloatType,
  LinearFilter,
  Matrix4,
  PMREMGenerator,
  type Scene,
  type WebGLCubeRenderTarget,
  type WebGLRenderer,
  type WebGLRenderTarget,
} from "three";
import type { Lighting } from "../light/lighting.ts";
import type { Matrix3x3 } from "../light/matrix.ts";

/** 64 pixels a cube face: 1.4 degrees, where the estimate's own pixels span 10. */
const HEIGHT = 128;
const WIDTH = 2 * HEIGHT;
const LARGEST_HALF = 65504;

export class Environment {
  private readonly generator: PMREMGenerator;
  private readonly texels = new Uint16Array(WIDTH * HEIGHT * 4);
  private readonly panorama = new DataTexture(this.texels, WIDTH, HEIGHT);
  private target: WebGLRenderTarget | null = null;

  constructor(renderer: WebGLRenderer) {
    this.generator = new PMREMGenerator(renderer);
    this.panorama.type = HalfFloatType;
    this.panorama.mapping = EquirectangularReflectionMapping;
    this.panorama.minFilter = this.panorama.magFilter = LinearFilter;
  }

  /** Lights `scene`. The light stays in its camera's frame; the pose turns the environment instead. */
  light(scene: Scene, lighting: Lighting, worldFromCamera: Matrix3x3): void {
    writeForThree(this.texels, lighting.quickEquirect(HEIGHT));
    this.panorama.needsUpdate = true;
    // The types ask for a cube; the generator makes, and takes again, its own flat target.
    const again = this.target as WebGLCubeRenderTarget | null;
    this.target = this.generator.fromEquirectangular(this.panorama, again);
    scene.environment = this.target.texture;
    this.turn(scene, worldFromCamera);
  }

  /** Turns the light of before into another pose. */
  turn(scene: Scene, worldFromCamera: Matrix3x3): void {
    const [a, b, c, d, e, f, g, h, i] = worldFromCamera;
    const matrix = new Matrix4().set(a, b, c, 0, d, e, f, 0, g, h, i, 0, 0, 0, 0, 1);
    scene.environmentRotation.setFromRotationMatrix(matrix);
  }
}

/**
 * Our equirectangular light (centre column -Z, top row first, RGB) in three.js's texels (RGBA, half floats,
 * bottom row first): three.js has +X in the centre column, a quarter turn to the right of ours.
 */
function writeForThree(texels: Uint16Array, ours: Float32Array): void {
  const one = DataUtils.toHalfFloat(1);
  for (let row = 0; row < HEIGHT; row++) {
    for (let column = 0; column < WIDTH; column++) {
      const from = 3 * ((HEIGHT - 1 - row) * WIDTH + ((column + WIDTH / 4) % WIDTH));
      const to = 4 * (row * WIDTH + column);
      for (let channel = 0; channel < 3; channel++) {
        const radiance = Math.min(ours[from + channel]!, LARGEST_HALF);
        texels[to + channel] = DataUtils.toHalfFloat(radiance);
      }
      texels[to + 3] = one;
    }
  }
}

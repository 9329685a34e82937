/**
 * The light as three.js's materials get it here: the estimate's own mirror ball as a texture.
 *
 * Reflections look the ball up at a level as coarse as the surface is rough; even illumination comes
 * from harmonics. Both take effect at once. three.js's own way, a prefiltered cube (PMREM), costs a
 * thousand times more for each new light and shows no more of a ball of 32 x 32 pixels.
 */

import {
  irradianceCoefficients,
  LIGHTING_SIZE,
  type Lighting,
  type Matrix3x3,
  REFLECTIVITY,
} from "deeplight/core";
import {
  DataTexture,
  DataUtils,
  DoubleSide,
  HalfFloatType,
  LinearFilter,
  LinearMipmapLinearFilter,
  Matrix3,
  type MeshStandardMaterial,
  ShaderMaterial,
  Vector3,
} from "three";
import { ballLevels } from "./ball-levels.ts";
import { LOOK_UP, MIRROR_FRAGMENT, MIRROR_VERTEX, WITHOUT_MAPS } from "./ball-shader.ts";

const LARGEST_HALF = 65504;
const HARMONICS = 9;

export class BallLight {
  private readonly ball = new DataTexture(null, LIGHTING_SIZE, LIGHTING_SIZE);
  private readonly uniforms = {
    ball: { value: this.ball },
    cameraFromWorld: { value: new Matrix3() },
    irradianceOf: { value: Array.from({ length: HARMONICS }, () => new Vector3()) },
  };

  constructor() {
    this.ball.type = HalfFloatType;
    this.ball.magFilter = LinearFilter;
    this.ball.minFilter = LinearMipmapLinearFilter;
    this.ball.generateMipmaps = false; // old phones cannot make them of half floats
  }

  /** New light, in the frame of a camera held like `worldFromCamera`. */
  set(lighting: Lighting, worldFromCamera: Matrix3x3): void {
    this.ball.mipmaps = ballLevels(lighting.radiance(), LIGHTING_SIZE).map(({ size, rgb }) => ({
      data: halfFloats(rgb),
      width: size,
      height: size,
    }));
    this.ball.image = this.ball.mipmaps[0] as { data: Uint16Array; width: number; height: number };
    this.ball.needsUpdate = true;
    this.uniforms.cameraFromWorld.value.set(...worldFromCamera).transpose();
    const coefficients = irradianceCoefficients(lighting.harmonics(2));
    this.uniforms.irradianceOf.value.forEach((value, i) => {
      value.fromArray(coefficients, 3 * i);
    });
  }

  /** Lets it light a material of three.js, instead of an environment. */
  lights<M extends MeshStandardMaterial>(material: M): M {
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.uniforms);
      shader.fragmentShader = shader.fragmentShader
        .replace("#include <lights_physical_pars_fragment>", `$&\n${LOOK_UP}`)
        .replace("#include <lights_fragment_maps>", WITHOUT_MAPS);
    };
    material.customProgramCacheKey = () => "ball light";
    return material;
  }

  /** A perfect mirror of the paper's reflectivity, the same at every angle. */
  mirror(): ShaderMaterial {
    return new ShaderMaterial({
      vertexShader: MIRROR_VERTEX,
      fragmentShader: MIRROR_FRAGMENT,
      uniforms: { ...this.uniforms, reflectivity: { value: REFLECTIVITY.mirror } },
      side: DoubleSide,
    });
  }

  dispose(): void {
    this.ball.dispose();
  }
}

function halfFloats(rgb: Float32Array): Uint16Array {
  const texels = new Uint16Array((rgb.length / 3) * 4);
  rgb.forEach((value, i) => {
    const at = 4 * Math.floor(i / 3) + (i % 3);
    texels[at] = DataUtils.toHalfFloat(Math.min(value, LARGEST_HALF));
  });
  return texels;
}

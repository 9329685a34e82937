/**
 * The light as three.js's materials get it here: its panorama and its mirror ball as textures.
 *
 * Sharp reflections look the panorama up, so mirrors show the photo itself; rough ones the ball, at a
 * level as coarse as the surface. Even illumination comes from harmonics. All take effect at once. three.js's own way, a prefiltered cube (PMREM), costs a
 * thousand times more for each new light and shows no more of a ball of 32 x 32 pixels.
 */

import {
  type Environment,
  irradianceCoefficients,
  LIGHTING_SIZE,
  type Light,
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
  RepeatWrapping,
  ShaderMaterial,
  Vector3,
} from "three";
import { ballLevels, type Level } from "./ball-levels.ts";
import { LOOK_UP, MIRROR_FRAGMENT, MIRROR_VERTEX, WITHOUT_MAPS } from "./ball-shader.ts";
import { panoramaLevels } from "./panorama-levels.ts";

const LARGEST_HALF = 65504;
const HARMONICS = 9;

export class BallLight {
  /** What the panorama's texture shows. */
  private shown: Environment | null = null;
  private readonly ball = smooth(new DataTexture(null, LIGHTING_SIZE, LIGHTING_SIZE));
  private readonly uniforms = {
    ball: { value: this.ball },
    panorama: { value: this.ball }, // until there is one
    panoramaRows: { value: 0 },
    cameraFromWorld: { value: new Matrix3() },
    irradianceOf: { value: Array.from({ length: HARMONICS }, () => new Vector3()) },
  };

  /** New light, in the frame of a camera held like `worldFromCamera`. */
  set({ lighting, panorama }: Light, worldFromCamera: Matrix3x3): void {
    fill(this.ball, ballLevels(lighting.radiance(), LIGHTING_SIZE), 1);
    this.setPanorama(panorama);
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
    this.uniforms.panorama.value.dispose();
  }

  private setPanorama(panorama: Environment | null): void {
    if (panorama === this.shown) return; // only the object was turned
    this.shown = panorama;
    const { panorama: texture, panoramaRows } = this.uniforms;
    if (panorama && panoramaRows.value !== panorama.height) {
      if (texture.value !== this.ball) texture.value.dispose(); // its size is fixed
      texture.value = smooth(new DataTexture(null, 2 * panorama.height, panorama.height));
      texture.value.wrapS = RepeatWrapping; // around the back
    }
    panoramaRows.value = panorama?.height ?? 0;
    if (panorama) fill(texture.value, panoramaLevels(panorama), 2);
  }
}

function smooth(texture: DataTexture): DataTexture {
  texture.type = HalfFloatType;
  texture.magFilter = LinearFilter;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.generateMipmaps = false; // old phones cannot make them of half floats
  return texture;
}

/** @param aspect width over height. */
function fill(texture: DataTexture, levels: readonly Level[], aspect: number): void {
  texture.mipmaps = levels.map(({ size, rgb }) => ({
    data: halfFloats(rgb),
    width: aspect * size,
    height: size,
  }));
  texture.image = texture.mipmaps[0] as { data: Uint16Array; width: number; height: number };
  texture.needsUpdate = true;
}

function halfFloats(rgb: Float32Array): Uint16Array {
  const texels = new Uint16Array((rgb.length / 3) * 4);
  for (let from = 0, to = 0; from < rgb.length; from += 3, to += 4) {
    for (let c = 0; c < 3; c++) {
      texels[to + c] = DataUtils.toHalfFloat(Math.min(rgb[from + c]!, LARGEST_HALF));
    }
  }
  return texels;
}

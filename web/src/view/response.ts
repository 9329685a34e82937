/** Radiance to pixels as the phone's camera does it: clipped at its white, gamma 2.2 (equation 3). */

import { GAMMA, SOFT_CLIP_N } from "deeplight/core";
import { CustomToneMapping, LinearSRGBColorSpace, ShaderChunk, type WebGLRenderer } from "three";

const IDENTITY = "vec3 CustomToneMapping( vec3 color ) { return color; }";

/** Every material of three.js and every shader with its tone mapping chunk draws in the photo's units. */
export function useCameraResponse(renderer: WebGLRenderer): void {
  ShaderChunk.tonemapping_pars_fragment = ShaderChunk.tonemapping_pars_fragment.replace(
    IDENTITY,
    `vec3 CustomToneMapping( vec3 color ) {
      vec3 over = ${SOFT_CLIP_N.toFixed(1)} * ( 1.0 - color );
      vec3 softplus = max( over, 0.0 ) + log( 1.0 + exp( -abs( over ) ) );
      vec3 clipped = max( 1.0 - softplus / ${SOFT_CLIP_N.toFixed(1)}, 0.0 );
      return pow( clipped, vec3( ${(1 / GAMMA).toFixed(9)} ) );
    }`,
  );
  renderer.toneMapping = CustomToneMapping;
  renderer.outputColorSpace = LinearSRGBColorSpace; // the gamma is in the response already
}

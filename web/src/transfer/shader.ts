/** The shaders of transfer, for three.js in GLSL ES 3.00. */
import { GAMMA, norm, SOFT_CLIP_N } from "deeplight/core";

/** Texels in a row of the textures that hold numbers of vertices. */
export const TEXTURE_WIDTH = 2048;

const FETCH = `
vec4 fetched( highp sampler2D numbers, int at ) {
  return texelFetch( numbers, ivec2( at % ${TEXTURE_WIDTH}, at / ${TEXTURE_WIDTH} ), 0 );
}`;

const PLACED = "gl_Position = projectionMatrix * modelViewMatrix * vec4( position, 1.0 );";

/** What leaves each vertex in every direction: its coefficients times the light's. */
export function diffuseVertex(coefficients: number): string {
  const texels = Math.ceil(coefficients / 4);
  return `
uniform highp sampler2D transfer;
uniform vec3 light[${4 * texels}];
out vec3 radiance;
#ifdef COLOURED
in vec3 tint;
#else
uniform vec3 tint;
#endif
${FETCH}
void main() {
  vec3 sum = vec3( 0.0 );
  for ( int i = 0; i < ${texels}; i ++ ) {
    vec4 part = fetched( transfer, gl_VertexID * ${texels} + i );
    sum += part.x * light[ 4 * i ] + part.y * light[ 4 * i + 1 ] + part.z * light[ 4 * i + 2 ] + part.w * light[ 4 * i + 3 ];
  }
  radiance = tint * max( sum, 0.0 );
  ${PLACED}
}`;
}

/**
 * What leaves each vertex towards the eye: harmonics of the eye's mirror direction about the normal, each with the
 * light that the vertex's matrix has made of the arriving light. `transfer` holds cluster and weights.
 */
export function glossyVertex(order: number, components: number): string {
  const coefficients = (order + 1) ** 2;
  const texels = Math.ceil((components + 1) / 4);
  return `
uniform highp sampler2D transfer;
uniform highp sampler2D met;
uniform vec3 tint;
out vec3 radiance;
${FETCH}
int first;
float weights[${4 * texels}];
vec3 sent( int leaving ) {
  vec3 sum = fetched( met, first + leaving ).rgb;
  for ( int i = 1; i <= ${components}; i ++ ) sum += weights[ i ] * fetched( met, first + i * ${coefficients} + leaving ).rgb;
  return sum;
}
void main() {
  for ( int i = 0; i < ${texels}; i ++ ) {
    vec4 part = fetched( transfer, gl_VertexID * ${texels} + i );
    weights[ 4 * i ] = part.x; weights[ 4 * i + 1 ] = part.y; weights[ 4 * i + 2 ] = part.z; weights[ 4 * i + 3 ] = part.w;
  }
  first = int( weights[ 0 ] + 0.5 ) * ${(components + 1) * coefficients};
  vec3 eye = normalize( ( inverse( modelMatrix ) * vec4( cameraPosition, 1.0 ) ).xyz - position );
  vec3 seen = normalize( 2.0 * dot( eye, normal ) * normal - eye );
  vec3 sum = vec3( 0.0 );
  vec2 around = vec2( 1.0, 0.0 ); // cosine and sine of m phi, times sin( theta )^m
${harmonicsOf(order)}
  radiance = tint * max( sum, 0.0 );
  ${PLACED}
}`;
}

/** Adds every harmonic of \`seen\` times what is sent; the recurrence of `basis`, written out. */
function harmonicsOf(order: number): string {
  const lines: string[] = [];
  let start = 1;
  for (let m = 0; m <= order; m++) {
    lines.push("{", `float below = 0.0, here = ${start.toFixed(1)}, above;`);
    for (let degree = m; degree <= order; degree++) {
      const scaled = `here * ${norm(degree, m).toFixed(9)}`;
      const middle = degree * (degree + 1);
      lines.push(`sum += ${scaled} * around.x * sent( ${middle + m} );`);
      if (m) lines.push(`sum += ${scaled} * around.y * sent( ${middle - m} );`);
      const [z, less] = [
        `${(2 * degree + 1).toFixed(1)} * seen.z`,
        `${(degree + m).toFixed(1)} * below`,
      ];
      lines.push(
        `above = ( ${z} * here - ${less} ) / ${(degree + 1 - m).toFixed(1)}; below = here; here = above;`,
      );
    }
    lines.push("}");
    lines.push(
      "around = vec2( around.x * seen.x - around.y * seen.y, around.x * seen.y + around.y * seen.x );",
    );
    start *= 2 * m + 1;
  }
  return lines.join("\n");
}

/** Radiance as the camera's pixels: exposure, soft clip (equation 3), gamma. */
export const PIXEL_FRAGMENT = `
precision highp float;
uniform float exposure;
in vec3 radiance;
out vec4 pixel;
void main() {
  vec3 over = ${SOFT_CLIP_N.toFixed(1)} * ( 1.0 - radiance * exposure );
  vec3 softplus = max( over, 0.0 ) + log( 1.0 + exp( - abs( over ) ) );
  pixel = vec4( pow( max( 1.0 - softplus / ${SOFT_CLIP_N.toFixed(1)}, 0.0 ), vec3( ${(1 / GAMMA).toFixed(9)} ) ), 1.0 );
}`;

export const SHADOW_VERTEX = `
in vec3 ratio;
in float reach;
out vec3 darkened;
out float kept;
void main() {
  darkened = ratio;
  kept = 1.0 - smoothstep( 0.7, 1.0, reach );
  ${PLACED}
}`;

/** A factor on encoded pixels that is a factor on radiance. */
export const SHADOW_FRAGMENT = `
precision highp float;
in vec3 darkened;
in float kept;
uniform float strength;
out vec4 pixel;
void main() {
  vec3 ratio = mix( vec3( 1.0 ), min( darkened, 1.0 ), kept * strength );
  pixel = vec4( pow( ratio, vec3( ${(1 / GAMMA).toFixed(9)} ) ), 1.0 );
}`;

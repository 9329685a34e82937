/** The shaders of `BallLight`, GLSL. */

/** Row 0 of the texture is the ball's top, so its v points down. */
const ON_BALL = `
  uniform sampler2D ball;
  uniform mat3 cameraFromWorld;
  vec2 onBall(vec3 worldDirection) {
    vec3 d = cameraFromWorld * worldDirection;
    vec2 uv = d.xy * inversesqrt(max(2.0 + 2.0 * d.z, 1e-6));
    return vec2(0.5 + 0.5 * uv.x, 0.5 - 0.5 * uv.y);
  }
  uniform sampler2D panorama;
  uniform float panoramaRows;
  // What surroundings look like from a surface that spreads light over an angle, in radians: from the
  // panorama, or from the ball where that is as coarse as it is anyway. A pixel of the ball spans 10
  // degrees, and twice that on each coarser level.
  vec3 surroundings(vec3 worldDirection, float angle) {
    vec3 onTheBall = textureLod(ball, onBall(worldDirection), log2(max(1.0, 8.0 * angle))).rgb;
    if (panoramaRows == 0.0) return onTheBall;
    vec3 d = normalize(cameraFromWorld * worldDirection);
    vec2 at = vec2(0.5 + atan(d.x, -d.z) / 6.28318531, acos(clamp(d.y, -1.0, 1.0)) / 3.14159265);
    float level = log2(max(1.0, angle * panoramaRows / 3.14159265));
    return mix(textureLod(panorama, at, level).rgb, onTheBall, smoothstep(0.12, 0.3, angle));
  }`;

/** Harmonics of `harmonics.py`, up to order 2. */
export const LOOK_UP = `${ON_BALL}
  uniform vec3 irradianceOf[9];
  vec3 ballIrradiance(vec3 worldNormal) {
    vec3 d = cameraFromWorld * worldNormal;
    vec3 sum = 0.28209479 * irradianceOf[0]
      + 0.48860251 * (d.y * irradianceOf[1] + d.z * irradianceOf[2] + d.x * irradianceOf[3])
      + 1.09254843 * (d.x * d.y * irradianceOf[4] + d.y * d.z * irradianceOf[5] + d.x * d.z * irradianceOf[7])
      + 0.31539157 * (3.0 * d.z * d.z - 1.0) * irradianceOf[6]
      + 0.54627422 * (d.x * d.x - d.y * d.y) * irradianceOf[8];
    return max(sum, 0.0);
  }
  // Half of what GGX reflects lies within 2 atan(alpha) of the mirror direction.
  vec3 ballRadiance(vec3 worldDirection, float roughness) {
    return surroundings(worldDirection, 2.0 * atan(roughness * roughness));
  }`;

/** In place of three.js's light maps and environments. */
export const WITHOUT_MAPS = `
  #if defined( RE_IndirectSpecular )
    vec3 worldNormal = inverseTransformDirection(geometryNormal, viewMatrix);
    vec3 mirrored = reflect(-geometryViewDir, geometryNormal);
    // Rough surfaces send light more along the normal than a mirror would.
    mirrored = normalize(mix(mirrored, geometryNormal, pow4(material.roughness)));
    iblIrradiance += ballIrradiance(worldNormal);
    radiance += ballRadiance(inverseTransformDirection(mirrored, viewMatrix), material.roughness);
    #ifdef USE_CLEARCOAT
      vec3 onCoat = reflect(-geometryViewDir, geometryClearcoatNormal);
      clearcoatRadiance += ballRadiance(inverseTransformDirection(onCoat, viewMatrix), material.clearcoatRoughness);
    #endif
  #endif`;

export const MIRROR_VERTEX = `
  varying vec3 facing;
  varying vec3 at;
  void main() {
    facing = transpose(mat3(viewMatrix)) * (normalMatrix * normal);
    vec4 world = modelMatrix * vec4(position, 1.0);
    at = world.xyz;
    gl_Position = projectionMatrix * viewMatrix * world;
  }`;

export const MIRROR_FRAGMENT = `${ON_BALL}
  uniform float reflectivity;
  varying vec3 facing;
  varying vec3 at;
  void main() {
    vec3 toView = isOrthographic
      ? vec3(viewMatrix[0][2], viewMatrix[1][2], viewMatrix[2][2])
      : normalize(cameraPosition - at);
    vec3 normal = normalize(facing) * (gl_FrontFacing ? 1.0 : -1.0);
    vec3 mirrored = reflect(-toView, normal);
    // As wide as a pixel sees, or small lights would flicker.
    vec3 radiance = surroundings(mirrored, min(length(fwidth(mirrored)), 0.1));
    gl_FragColor = vec4(reflectivity * radiance, 1.0);
    #include <tonemapping_fragment>
  }`;

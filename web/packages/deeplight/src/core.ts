/**
 * The parts of the library, for those who put them together in another way, as the live page does.
 * These may change with every minor version.
 */
export * from "./contract/generated.ts";
export { EstimateError, type EstimateErrorKind } from "./errors.ts";
export { type Confidence, headsIn } from "./estimate/confidence.ts";
export { type Estimate, Estimator, type ModelFacts } from "./estimate/estimator.ts";
export type { Frame } from "./estimate/picker.ts";
export type { Tracked } from "./estimate/tracker.ts";
export { pixelFromRadiance, radianceFromPixel } from "./light/camera-response.ts";
export { type Environment, resized, seenShare } from "./light/environment.ts";
export {
  basis,
  cosineKernel,
  irradiance,
  irradianceCoefficients,
  norm,
} from "./light/harmonics.ts";
export { addLamps, type Lamp } from "./light/lamp.ts";
export { Lighting } from "./light/lighting.ts";
export type { MainLight } from "./light/main-light.ts";
export * from "./light/matrix.ts";
export {
  coverage,
  nearestLit,
  pixelDirection,
  pixelOfDirection,
  subpixels,
} from "./light/mirror-ball.ts";
export { ballFromPanorama, rowSolidAngles, sampled, texelDirections } from "./light/panorama.ts";
export { Smoother } from "./light/smoother.ts";
export { type Basis, keepBasis, makeBasis, SPHERES, type SphereName } from "./light/spheres.ts";
export { Light } from "./light.ts";
export { type CameraFacts, cameraFacts } from "./photo/camera-facts.ts";
export { drawStill } from "./photo/still.ts";
export { frameOfVideo, onEachFrame } from "./photo/video.ts";
export { crc32 } from "./save/crc32.ts";
export { type About, hdrFile, jsonFile, panoramaFile } from "./save/index.ts";
export { LIGHT_FEATURES, type SessionTracking, trackSession } from "./xr/track-session.ts";

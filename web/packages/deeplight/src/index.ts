/**
 * The light of a whole scene from one photo, in the browser.
 *
 *     const estimator = await load();
 *     const light = await estimator.estimate(photo);
 */
export { EstimateError, type EstimateErrorKind } from "./errors.ts";
export type { ModelFacts } from "./estimate/estimator.ts";
export type { Environment } from "./light/environment.ts";
export type { Lamp } from "./light/lamp.ts";
export { Lighting } from "./light/lighting.ts";
export type { MainLight } from "./light/main-light.ts";
export type { Matrix3x3, Vector3 } from "./light/matrix.ts";
export type { SphereName } from "./light/spheres.ts";
export { type Harmonics, Light } from "./light.ts";
export {
  type EstimateOptions,
  type FollowOptions,
  LightEstimator,
  type LoadOptions,
  load,
} from "./load.ts";
export type { PhotoSource } from "./photo/source.ts";
export type { TrackedLight, Tracking, TrackOptions, VideoTracking } from "./track.ts";
export { LIGHT_FEATURES, type SessionOptions, type SessionTracking } from "./xr/track-session.ts";

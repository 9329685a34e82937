/** three.js: `deeplight/three`. */
import * as THREE from "three";
import { bindThree, type EstimatedLight } from "./bind-three.ts";

export const { DeepLightEstimatedLight, environmentTexture, cubeTexture } = bindThree(THREE);
export type DeepLightEstimatedLight = EstimatedLight;

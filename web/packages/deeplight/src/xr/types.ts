/** What is used of WebXR, so that no types of it need to be installed. The browser's own fit. */

export interface XRViewLike {
  readonly projectionMatrix: Float32Array;
  readonly transform: { readonly matrix: Float32Array };
  /** Where the session may see the camera's pixels (`camera-access`). */
  readonly camera?: XRCameraLike | null | undefined;
}

export interface XRCameraLike {
  readonly width: number;
  readonly height: number;
}

export interface XRFrameLike {
  getViewerPose(space: object): { readonly views: readonly XRViewLike[] } | null | undefined;
  getLightEstimate?(probe: object): XRLightEstimateLike | null | undefined;
}

export interface XRLightEstimateLike {
  readonly sphericalHarmonicsCoefficients: ArrayLike<number>;
  readonly primaryLightDirection: { readonly x: number; readonly y: number; readonly z: number };
  readonly primaryLightIntensity: { readonly x: number; readonly y: number; readonly z: number };
}

export interface XRSessionLike {
  end(): Promise<void>;
  requestLightProbe?(options?: object): Promise<object>;
}

export interface CameraBinding {
  getCameraImage(camera: XRCameraLike): WebGLTexture | null;
}

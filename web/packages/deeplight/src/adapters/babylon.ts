/** Babylon.js: `deeplight/babylon`. */
import type { Light } from "../light.ts";

/** What is used of Babylon.js, as a module or as the global `BABYLON`. */
export interface BabylonParts<Scene, Texture, Directional> {
  readonly HDRCubeTexture: new (
    url: string,
    scene: Scene,
    size: number,
    noMipmap: boolean,
    generateHarmonics: boolean,
    gammaSpace: boolean,
    reserved: boolean,
    onLoad: () => void,
    onError: (message?: string, exception?: unknown) => void,
    supersample: boolean,
    prefilterOnLoad: boolean,
  ) => Texture;
  readonly DirectionalLight: new (name: string, direction: never, scene: Scene) => Directional;
  readonly Vector3: new (x: number, y: number, z: number) => unknown;
  readonly Color3: new (r: number, g: number, b: number) => unknown;
}

export interface BabylonLight<Texture, Directional> {
  /** The scene's environment now, without the main light. */
  readonly environment: Texture;
  readonly mainLight: Directional;
  dispose(): void;
}

interface LitScene {
  environmentTexture: unknown;
  readonly useRightHandedSystem: boolean;
}

interface Disposable {
  dispose(): void;
}

const SIZE = 128;
/** Where its panoramas have the view, from the left edge, in scenes of either hand. */
const VIEW_U = 0.25;

/**
 * Lights a scene whose camera looks along the photo's view: +X right, +Y up, the view along +Z in
 * Babylon's own left-handed scenes and along -Z in right-handed ones.
 */
export async function lightBabylonScene<
  Scene extends LitScene,
  Texture extends Disposable,
  Directional extends Disposable & { intensity: number; diffuse: unknown; specular: unknown },
>(
  babylon: BabylonParts<Scene, Texture, Directional>,
  scene: Scene,
  light: Light,
): Promise<BabylonLight<Texture, Directional>> {
  const ahead = scene.useRightHandedSystem ? 1 : -1;
  const url = URL.createObjectURL(light.withoutMainLight.hdr(VIEW_U));
  const environment = await new Promise<Texture>((done, failed) => {
    const texture: Texture = new babylon.HDRCubeTexture(
      url,
      scene,
      SIZE,
      false,
      true,
      false,
      false,
      () => done(texture),
      (message, exception) => failed(exception ?? new Error(message)),
      true,
      true,
    );
  }).finally(() => URL.revokeObjectURL(url));
  scene.environmentTexture = environment;
  const { direction, irradiance, colour } = light.mainLight;
  const [x, y, z] = direction;
  const travels = new babylon.Vector3(-x, -y, -z * ahead) as never;
  const mainLight = new babylon.DirectionalLight("main light", travels, scene);
  mainLight.intensity = Math.max(...irradiance);
  mainLight.diffuse = mainLight.specular = new babylon.Color3(...colour);
  return {
    environment,
    mainLight,
    dispose() {
      if (scene.environmentTexture === environment) scene.environmentTexture = null;
      environment.dispose();
      mainLight.dispose();
    },
  };
}

/** Light for three.js, and for programs that carry a three.js of their own, such as A-Frame. */
import type * as Three from "three";
import type { Matrix3x3 } from "../light/matrix.ts";
import { pixelOfDirection } from "../light/mirror-ball.ts";
import type { Light } from "../light.ts";

/** What is used of three.js. */
export type ThreeParts = Pick<
  typeof Three,
  | "Group"
  | "LightProbe"
  | "DirectionalLight"
  | "DataTexture"
  | "CubeTexture"
  | "DataUtils"
  | "RGBAFormat"
  | "HalfFloatType"
  | "LinearFilter"
  | "LinearSRGBColorSpace"
  | "EquirectangularReflectionMapping"
>;

/** Where three.js's panoramas have -Z, from the left edge. */
const VIEW_U = 0.25;
const LARGEST_HALF = 65504;
const ENVIRONMENT_HEIGHT = 64;
const CUBE_SIZE = 32;

export interface EstimationEvents extends Three.Object3DEventMap {
  /** The first light has come. */
  estimationstart: object;
  /** The light was taken away. */
  estimationend: object;
}

/**
 * The estimated light in a scene, with the interface of three.js's `XREstimatedLight`: a group with
 * the events `estimationstart` and `estimationend`.
 *
 * Unlike there, nothing is counted twice: with an environment, which is the scene's without the main
 * light, the probe stays dark.
 */
export interface EstimatedLight extends Three.Group<EstimationEvents> {
  readonly lightProbe: Three.LightProbe;
  readonly directionalLight: Three.DirectionalLight;
  /** For `scene.environment`; null before the first light, and where none is wanted. */
  readonly environment: Three.Texture | null;
  readonly environmentEstimation: boolean;
  /** @param camera that saw the photo: the light is turned with it into the world. */
  setLight(light: Light, camera?: Three.Object3D): void;
  /** Dark again. */
  clearLight(): void;
  dispose(): void;
}

export interface BoundThree {
  /** The first argument, a renderer, is not needed; `XREstimatedLight` has it there. */
  readonly DeepLightEstimatedLight: new (
    renderer?: unknown,
    environmentEstimation?: boolean,
  ) => EstimatedLight;
  /** An equirectangular texture: `scene.environment = environmentTexture(light)`. */
  environmentTexture(light: Light, height?: number): Three.DataTexture;
  /** A cube texture with the light as it is in each direction, unfiltered. */
  cubeTexture(light: Light, size?: number): Three.CubeTexture;
}

export function bindThree(three: ThreeParts): BoundThree {
  function environmentTexture(light: Light, height = ENVIRONMENT_HEIGHT): Three.DataTexture {
    const panorama = light.environment(height, VIEW_U);
    const width = 2 * height;
    const texture = new three.DataTexture(
      halves(width * height, (pixel, c) => {
        const [row, column] = [height - 1 - Math.floor(pixel / width), pixel % width];
        return panorama[3 * (row * width + column) + c]!; // textures start at the bottom
      }),
      width,
      height,
    );
    texture.mapping = three.EquirectangularReflectionMapping;
    return prepared(texture);
  }

  function cubeTexture(light: Light, size = CUBE_SIZE): Three.CubeTexture {
    const { lighting } = light;
    const radiance = lighting.radiance();
    const faces = FACES.map((face) => {
      const data = halves(size * size, (pixel, c) => {
        const [s, t] = [pixel % size, Math.floor(pixel / size)].map(
          (at) => (2 * (at + 0.5)) / size - 1,
        ) as [number, number];
        const [x, y, z] = face(s, t);
        const length = Math.hypot(x, y, z);
        const direction = [-x / length, y / length, z / length] as const; // three.js mirrors cubes
        return radiance[3 * pixelOfDirection(direction, lighting.size) + c]!;
      });
      return prepared(new three.DataTexture(data, size, size));
    });
    return prepared(new three.CubeTexture(faces));
  }

  function prepared<T extends Three.Texture>(texture: T): T {
    texture.format = three.RGBAFormat;
    texture.type = three.HalfFloatType;
    texture.magFilter = texture.minFilter = three.LinearFilter;
    texture.generateMipmaps = false;
    texture.colorSpace = three.LinearSRGBColorSpace;
    texture.needsUpdate = true;
    return texture;
  }

  function halves(pixels: number, value: (pixel: number, c: number) => number): Uint16Array {
    return Uint16Array.from({ length: 4 * pixels }, (_, i) =>
      three.DataUtils.toHalfFloat(
        i % 4 === 3 ? 1 : Math.min(value(Math.floor(i / 4), i % 4), LARGEST_HALF),
      ),
    );
  }

  class DeepLightEstimatedLight extends three.Group<EstimationEvents> implements EstimatedLight {
    readonly lightProbe: Three.LightProbe = new three.LightProbe();
    readonly directionalLight: Three.DirectionalLight = new three.DirectionalLight();
    environment: Three.Texture | null = null;
    #light: Light | null = null;

    constructor(
      _renderer: unknown = null,
      readonly environmentEstimation: boolean = true,
    ) {
      super();
      this.lightProbe.intensity = 0;
      this.directionalLight.intensity = 0;
      this.add(this.lightProbe, this.directionalLight, this.directionalLight.target);
    }

    setLight(light: Light, camera?: Three.Object3D): void {
      const world = camera ? light.turned(rotationOf(camera)) : light;
      const { direction, irradiance } = world.mainLight;
      const rest = world.withoutMainLight;
      const brightest = Math.max(...irradiance);
      this.directionalLight.position.set(...direction);
      this.directionalLight.intensity = brightest;
      const share = (value: number) => (brightest > 0 ? value / brightest : 1);
      const [r, g, b] = irradiance;
      this.directionalLight.color.setRGB(share(r), share(g), share(b));
      if (this.environmentEstimation) this.#show(rest);
      else {
        this.lightProbe.sh.fromArray(Array.from(rest.harmonics.allPositive));
        this.lightProbe.intensity = 1;
      }
      const isFirst = this.#light === null;
      this.#light = world;
      if (isFirst) this.dispatchEvent({ type: "estimationstart" });
    }

    clearLight(): void {
      this.lightProbe.intensity = this.directionalLight.intensity = 0;
      this.#forget();
      if (this.#light) this.dispatchEvent({ type: "estimationend" });
      this.#light = null;
    }

    override dispose(): void {
      this.clearLight();
      this.directionalLight.dispose();
      this.removeFromParent();
    }

    /** The same texture each time, so that a scene which holds it needs no new one. */
    #show(rest: Light): void {
      const fresh = environmentTexture(rest);
      if (!this.environment) this.environment = fresh;
      else {
        this.environment.dispose(); // or three.js would keep what it made of the old light
        this.environment.image = fresh.image;
        this.environment.needsUpdate = true;
      }
    }

    #forget(): void {
      this.environment?.dispose();
      this.environment = null;
    }
  }

  return { DeepLightEstimatedLight, environmentTexture, cubeTexture };
}

/** Rows of the rotation from an object's frame to the world's, whatever its scale. */
function rotationOf(object: Three.Object3D): Matrix3x3 {
  object.updateWorldMatrix(true, false);
  const e = object.matrixWorld.elements;
  const column = (i: number): [number, number, number] => {
    const [x, y, z] = [e[4 * i]!, e[4 * i + 1]!, e[4 * i + 2]!];
    const length = Math.hypot(x, y, z);
    return [x / length, y / length, z / length];
  };
  const [x, y, z] = [column(0), column(1), column(2)];
  return [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]];
}

type Place = (s: number, t: number) => [number, number, number];
/** Where a cube texture's pixels look, face by face, rows from the top: OpenGL's convention. */
const FACES: readonly Place[] = [
  (s, t) => [1, -t, -s],
  (s, t) => [-1, -t, s],
  (s, t) => [s, 1, t],
  (s, t) => [s, -1, -t],
  (s, t) => [s, -t, 1],
  (s, t) => [-s, -t, -1],
];

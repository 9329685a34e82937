/**
 * A-Frame: `deeplight/aframe` adds the component `deeplight` to the page's own A-Frame.
 *
 *     <a-entity deeplight="src: #photo"></a-entity>
 */
import type * as Three from "three";
import type { Light } from "../light.ts";
import { type LightEstimator, load } from "../load.ts";
import type { PhotoSource } from "../photo/source.ts";
import { bindThree, type EstimatedLight, type ThreeParts } from "./bind-three.ts";

interface Entity extends HTMLElement {
  readonly object3D: Three.Object3D;
  readonly sceneEl: HTMLElement & { readonly object3D: Three.Scene };
}

interface AFrame {
  readonly THREE: ThreeParts;
  registerComponent(name: string, component: object): void;
}

interface Component {
  readonly el: Entity;
  readonly data: { readonly src: HTMLElement | null; readonly model: string };
  group: EstimatedLight;
  setLight(light: Light): void;
  /** What was asked for last. */
  asked: HTMLElement | null;
}

const estimators = new Map<string, Promise<LightEstimator>>();

function estimatorFor(model: string): Promise<LightEstimator> {
  const known = estimators.get(model);
  if (known) return known;
  const made = load(model ? { model } : {});
  estimators.set(model, made);
  return made;
}

/** Called at once with the global `AFRAME` where there is one. */
export function registerDeepLight(aframe: AFrame): void {
  const { DeepLightEstimatedLight } = bindThree(aframe.THREE);
  aframe.registerComponent("deeplight", {
    schema: {
      /** An image, a canvas or a video whose light is estimated. */
      src: { type: "selector" },
      /** The address of another network. */
      model: { type: "string", default: "" },
    },
    init(this: Component) {
      this.group = new DeepLightEstimatedLight();
      this.asked = null;
      this.el.sceneEl.setAttribute("light", "defaultLightsEnabled: false");
      this.el.object3D.add(this.group);
    },
    async update(this: Component) {
      const { src, model } = this.data;
      this.asked = src;
      if (!src) return this.group.clearLight();
      try {
        const estimator = await estimatorFor(model);
        const light = await estimator.estimate(src as unknown as PhotoSource);
        if (this.asked === src) this.setLight(light);
      } catch (error) {
        this.el.dispatchEvent(new CustomEvent("lightfailed", { detail: { error }, bubbles: true }));
      }
    },
    setLight(this: Component, light: Light) {
      this.group.setLight(light);
      this.el.sceneEl.object3D.environment = this.group.environment;
      this.el.dispatchEvent(
        new CustomEvent("lightestimated", { detail: { light }, bubbles: true }),
      );
    },
    remove(this: Component) {
      const scene = this.el.sceneEl.object3D;
      if (scene.environment === this.group.environment) scene.environment = null;
      this.group.dispose();
      this.asked = null;
    },
  });
}

const own = (globalThis as { AFRAME?: AFrame }).AFRAME;
if (own) registerDeepLight(own);

/**
 * A plain custom element, `deeplight/element`: the light of a photo as three spheres, with an event.
 *
 *     <deep-light src="photo.jpg"></deep-light>
 */

import { SPHERE_SIZE, SPHERES } from "../light/spheres.ts";
import type { Light } from "../light.ts";
import { type LightEstimator, load } from "../load.ts";

const estimators = new Map<string, Promise<LightEstimator>>();

/**
 * Attributes: `src`, a photo's address; `model`, the address of another network. Fires
 * `lightestimated` with `detail.light`, or `lightfailed` with `detail.error`.
 */
export class DeepLightElement extends HTMLElement {
  static readonly observedAttributes = ["src", "model"];
  /** Of the photo that is shown; null until it has been estimated. */
  light: Light | null = null;
  #asked = 0;

  connectedCallback(): void {
    if (!this.shadowRoot) this.attachShadow({ mode: "open" });
    void this.#estimate();
  }

  attributeChangedCallback(): void {
    if (this.isConnected && this.shadowRoot) void this.#estimate();
  }

  async #estimate(): Promise<void> {
    const [src, model] = [this.getAttribute("src"), this.getAttribute("model") ?? ""];
    const asked = ++this.#asked;
    this.light = null;
    if (!src) return;
    try {
      const response = await fetch(new URL(src, document.baseURI));
      if (!response.ok) throw new Error(`${src}: HTTP ${response.status}`);
      if (!estimators.has(model)) estimators.set(model, load(model ? { model } : {}));
      const estimator = await estimators.get(model)!;
      const light = await estimator.estimate(await response.blob());
      if (asked !== this.#asked) return;
      this.show(light);
    } catch (error) {
      if (asked !== this.#asked) return;
      this.#announce("lightfailed", { error });
    }
  }

  /** Shows a light from elsewhere. */
  show(light: Light): void {
    this.light = light;
    const canvases = SPHERES.map((name) => {
      const canvas = document.createElement("canvas");
      canvas.width = canvas.height = SPHERE_SIZE;
      canvas.style.imageRendering = "auto";
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `${name.replace("_", " ")} sphere in the estimated light`);
      canvas.getContext("2d")?.putImageData(light.lighting.sphere(name), 0, 0);
      return canvas;
    });
    this.shadowRoot?.replaceChildren(...canvases);
    this.#announce("lightestimated", { light });
  }

  #announce(type: string, detail: object): void {
    this.dispatchEvent(new CustomEvent(type, { detail, bubbles: true, composed: true }));
  }
}

if (!customElements.get("deep-light")) customElements.define("deep-light", DeepLightElement);

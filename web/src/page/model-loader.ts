/** Loads the network once, shows how far it is, and offers to try again when that fails. */
import { Estimator } from "deeplight/core";
import { box, element } from "./elements.ts";
import type { Notice } from "./notice.ts";

export class ModelLoader {
  private estimator: Estimator;

  constructor(private readonly notice: Notice) {
    this.estimator = this.load();
  }

  /** Calls `use` with the estimator, which may still be loading; where that fails, once more after another try. */
  use(use: (estimator: Estimator) => void): void {
    const { estimator } = this;
    estimator.loaded.catch((error: unknown) => {
      this.notice.show(error, () => {
        if (this.estimator === estimator) this.estimator = this.load();
        this.use(use);
      });
    });
    use(estimator);
  }

  /** When the first attempt has ended, well or not. */
  async settled(): Promise<void> {
    await this.estimator.loaded.catch(() => {});
  }

  private load(): Estimator {
    const bar = element("loading-bar", HTMLProgressElement);
    bar.removeAttribute("value");
    box("loading").hidden = false;
    const estimator = Estimator.start({
      model: new URL("model/deeplight.onnx", document.baseURI),
      detail: new URL("model/detail.bin", document.baseURI),
      worker: () =>
        new Worker(new URL("./estimate-worker.ts", import.meta.url), { type: "module" }),
      onProgress: (done, all) => {
        if (!(all > 0)) return; // some servers do not say
        bar.value = done / all;
        box("meter-loading").textContent = `· model ${Math.round((100 * done) / all)} %`;
      },
    });
    const hide = (): void => {
      box("loading").hidden = true;
      box("meter-loading").textContent = "";
    };
    estimator.loaded.then(hide, hide); // whoever needs the estimator gets the failure
    return estimator;
  }
}

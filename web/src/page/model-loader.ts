/** Loads the network once, shows how far it is, and offers to try again when that fails. */
import { Estimator } from "../estimate/estimator.ts";
import { box, element } from "./elements.ts";
import type { Notice } from "./notice.ts";

export class ModelLoader {
  private loading: Promise<Estimator>;

  constructor(private readonly notice: Notice) {
    this.loading = this.load();
  }

  /** Calls `use` with the estimator, now or when it has come; failures are shown. */
  async whenReady(use: (estimator: Estimator) => void): Promise<void> {
    try {
      use(await this.loading);
    } catch (error) {
      this.notice.show(error, () => {
        this.loading = this.load();
        void this.whenReady(use);
      });
    }
  }

  /** When the first attempt has ended, well or not. */
  async settled(): Promise<void> {
    await this.loading.catch(() => {});
  }

  private load(): Promise<Estimator> {
    const bar = element("loading-bar", HTMLProgressElement);
    bar.removeAttribute("value");
    box("loading").hidden = false;
    const where = {
      model: new URL("model/deeplight.onnx", document.baseURI),
      runtime: new URL("runtime/", document.baseURI),
    };
    const loading = Estimator.load(where, (done, all) => {
      if (all > 0) bar.value = done / all; // some servers do not tell
    });
    void loading.then(
      () => {
        box("loading").hidden = true;
      },
      () => {
        box("loading").hidden = true; // whoever needs the estimator is told
      },
    );
    return loading;
  }
}

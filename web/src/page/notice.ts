/** The dialog that says what went wrong and offers what to do about it. */

import { asFailure } from "../failure.ts";
import { adviceFor, type Remedy } from "./advice.ts";
import { box, button, element } from "./elements.ts";

const LABELS: Record<Remedy, string> = {
  camera: "Try the camera again",
  photo: "Choose a photo",
  retry: "Try again",
  reload: "Load the page again",
  "model-file": "Choose another file",
  "session-file": "Choose another file",
  close: "Close",
};

/** What each button does; `retry` is of the failed step. */
export type Remedies = Readonly<Record<Exclude<Remedy, "close" | "retry">, () => void>>;

export class Notice {
  private readonly dialog = element("notice", HTMLDialogElement);

  constructor(private readonly remedies: Remedies) {}

  /** Opens over everything. Escape and Close leave it. */
  show(error: unknown, retry: () => void = this.remedies.reload): void {
    const failure = asFailure(error);
    const { title, sentence, remedies } = adviceFor(failure);
    if (failure.kind === "unexpected") console.error(error);
    box("notice-title").textContent = title;
    box("notice-text").textContent = sentence;
    this.dialog.dataset.kind = failure.kind;
    const actions = { ...this.remedies, retry, close: () => {} };
    box("notice-buttons").replaceChildren(
      ...remedies.map((remedy, i) => this.made(remedy, i === 0, actions[remedy])),
    );
    if (!this.dialog.open) this.dialog.showModal();
  }

  /** Takes back what was said, where it no longer holds. */
  close(): void {
    this.dialog.close();
  }

  private made(remedy: Remedy, isFirst: boolean, act: () => void): HTMLButtonElement {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = LABELS[remedy];
    made.dataset.remedy = remedy;
    made.autofocus = isFirst;
    if (isFirst) made.className = "primary";
    made.addEventListener("click", () => {
      this.dialog.close();
      act();
    });
    return made;
  }
}

/** The line that offers a new version of the page. */
export function offerUpdate(load: () => void): void {
  button("update-now").onclick = load;
  box("update").hidden = false;
}

/** Files from the picker, from dropping and from pasting. */
import { box, input } from "./elements.ts";

export interface Intake {
  photo(file: File): void;
  model(file: File): void;
  /** What a camera saw before. */
  session(file: File): void;
}

export function connectIntake(intake: Intake): void {
  const take = (files: FileList | null | undefined): void => {
    const file = files?.[0];
    if (!file) return;
    if (/\.glb$/i.test(file.name) || file.type === "model/gltf-binary") intake.model(file);
    else if (/\.npz$/i.test(file.name)) intake.session(file);
    else intake.photo(file);
  };
  for (const id of ["photo-file", "model-file", "session-file"]) {
    const field = input(id);
    field.addEventListener("change", () => {
      take(field.files);
      field.value = ""; // or the same file could not be chosen again
    });
  }
  document.addEventListener("paste", (event) => take(event.clipboardData?.files));
  connectDropping(take);
}

function connectDropping(take: (files: FileList | undefined) => void): void {
  const hint = box("drop-hint");
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    hint.hidden = false;
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) hint.hidden = true; // left the window
  });
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    hint.hidden = true;
    take(event.dataTransfer?.files);
  });
}

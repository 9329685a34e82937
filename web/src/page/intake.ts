/** Files from the picker, from dropping, pasting and sharing, and those that the installed page is opened with. */
import { box, input } from "./elements.ts";

export interface Intake {
  photo(file: File): void;
  model(file: File): void;
  /** What a camera saw before. */
  session(file: File): void;
}

export function connectIntake(intake: Intake): void {
  const take = (files: ArrayLike<File> | null | undefined): void => {
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
  connectLaunch((file) => take([file]));
}

/** Where browsers install pages. */
interface LaunchQueue {
  setConsumer(take: (launch: { readonly files: readonly FileSystemFileHandle[] }) => void): void;
}

function connectLaunch(take: (file: File) => void): void {
  const { launchQueue } = window as Window & { launchQueue?: LaunchQueue };
  launchQueue?.setConsumer(({ files }) => void files[0]?.getFile().then(take));
  if (!new URLSearchParams(location.search).has("shared")) return;
  history.replaceState(null, "", location.pathname); // loaded again, the page opens nothing
  const { port1, port2 } = new MessageChannel();
  port1.onmessage = ({ data }: MessageEvent<File | null>) => data && take(data);
  navigator.serviceWorker?.controller?.postMessage("shared", [port2]);
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

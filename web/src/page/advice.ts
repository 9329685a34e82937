/** What is said about each failure: a sentence, and what to do about it. */
import { asFailure, type FailureKind } from "../failure.ts";

/** What a button under the sentence does. */
export type Remedy =
  | "camera"
  | "photo"
  | "retry"
  | "reload"
  | "model-file"
  | "session-file"
  | "close";

export interface Advice {
  readonly title: string;
  readonly sentence: string;
  readonly remedies: readonly Remedy[];
}

const ADVICE: Record<FailureKind, Advice> = {
  insecure: {
    title: "The camera needs a safe address",
    sentence:
      "Browsers give the camera only to pages from https or from this very device. A photo works here too.",
    remedies: ["photo", "close"],
  },
  denied: {
    title: "The camera is not allowed",
    sentence:
      "Allow it in the browser’s settings for this page (the icon next to the address), then try again.",
    remedies: ["camera", "photo"],
  },
  "no-camera": {
    title: "No camera was found",
    sentence: "This device has none that the browser can see. Choose a photo instead.",
    remedies: ["photo", "camera"],
  },
  "camera-busy": {
    title: "The camera is in use",
    sentence: "Another app or tab holds it. Close that one, then try again.",
    remedies: ["camera", "photo"],
  },
  "camera-lost": {
    title: "The camera stopped",
    sentence: "It was unplugged or taken by another app.",
    remedies: ["camera", "photo"],
  },
  "motion-denied": {
    title: "Motion sensors are not allowed",
    sentence:
      "The object cannot hold its place while you turn the phone. You can set the tilt by hand under Camera.",
    remedies: ["close"],
  },
  "no-motion": {
    title: "No motion sensors",
    sentence: "This device does not say how it is held. You can set the tilt by hand under Camera.",
    remedies: ["close"],
  },
  "model-missing": {
    title: "The model could not be loaded",
    sentence:
      "The file was not found, or the connection broke. Without it no light can be estimated.",
    remedies: ["retry", "close"],
  },
  "model-damaged": {
    title: "The model file is damaged",
    sentence: "It is not a model that this page can read, perhaps because the download was cut.",
    remedies: ["retry", "close"],
  },
  "model-version": {
    title: "The model is of another version",
    sentence: "This page cannot run it. A newer page and its model belong together.",
    remedies: ["reload", "close"],
  },
  "no-light": {
    title: "No light came out",
    sentence: "The model gave no usable answer for this picture. Another picture may work.",
    remedies: ["photo", "close"],
  },
  runtime: {
    title: "The estimator could not start",
    sentence: "This browser cannot run it: WebAssembly is missing, switched off or out of memory.",
    remedies: ["retry", "close"],
  },
  "no-room": {
    title: "The room could not be opened",
    sentence:
      "Augmented reality was refused or is not there: on Android it needs Google Play Services for AR and the camera. The plain camera works too.",
    remedies: ["camera", "close"],
  },
  "no-scene-viewer": {
    title: "Scene Viewer cannot fetch this object",
    sentence:
      "It is another app and fetches the file itself, from a public https address: it takes only the page’s own objects, and only where the page has such an address.",
    remedies: ["close"],
  },
  "no-webgl": {
    title: "No 3D graphics",
    sentence:
      "The browser offers no WebGL 2, so objects cannot be drawn. Switch hardware acceleration on, or try another browser.",
    remedies: ["reload", "close"],
  },
  "graphics-lost": {
    title: "The graphics stopped",
    sentence: "The device took its graphics memory back. Loading the page again brings them back.",
    remedies: ["reload"],
  },
  "photo-unreadable": {
    title: "This is no photo the browser can read",
    sentence: "JPEG, PNG, WebP and AVIF work everywhere; HEIC only on Apple devices.",
    remedies: ["photo", "close"],
  },
  "photo-too-large": {
    title: "This photo is too large",
    sentence: "It has more than 100 megapixels or megabytes. Choose a smaller one.",
    remedies: ["photo", "close"],
  },
  "photo-too-small": {
    title: "This photo is too small",
    sentence: "It has fewer than 32 pixels along a side. Choose a larger one.",
    remedies: ["photo", "close"],
  },
  "glb-broken": {
    title: "This object cannot be read",
    sentence: "It is not a complete .glb file with triangles in it.",
    remedies: ["model-file", "close"],
  },
  "glb-packed": {
    title: "This object’s textures cannot be read",
    sentence:
      "Their KTX2 packing is damaged, or of a kind that glTF does not allow. Export the object again, or with JPEG, PNG or WebP textures.",
    remedies: ["model-file", "close"],
  },
  "glb-too-large": {
    title: "This object is too large",
    sentence: "It has more than 100 megabytes or two million triangles. Choose a simpler one.",
    remedies: ["model-file", "close"],
  },
  "session-damaged": {
    title: "This file cannot be read",
    sentence: "It is not what this page or deeplight saved of a place, or not all of it.",
    remedies: ["session-file", "close"],
  },
  "object-missing": {
    title: "The object could not be loaded",
    sentence: "Its file was not found, or the connection broke.",
    remedies: ["retry", "close"],
  },
  "cannot-save": {
    title: "The file could not be saved",
    sentence: "The browser refused to share or store it.",
    remedies: ["close"],
  },
  unexpected: {
    title: "Something went wrong",
    sentence: "That should not happen. Loading the page again may help.",
    remedies: ["reload", "close"],
  },
};

/** What to say about anything thrown. */
export function adviceFor(error: unknown): Advice {
  return ADVICE[asFailure(error).kind];
}

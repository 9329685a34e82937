/** What is on screen, as one of a few states, and which events lead from one to another. */
import type { Matrix3x3 } from "deeplight/core";
import type { Picture } from "../camera/picture.ts";
import type { Facing } from "../sensors/orientation.ts";

export type State =
  | { readonly shows: "start" }
  /** The camera was asked for and is not there yet. */
  | { readonly shows: "opening"; readonly facing: Facing }
  | { readonly shows: "live"; readonly picture: Picture; readonly facing: Facing }
  /** The camera is off because nobody sees the page. */
  | { readonly shows: "asleep"; readonly facing: Facing }
  /** A frame of the camera, kept: how the phone was held then. */
  | {
      readonly shows: "frozen";
      readonly picture: Picture;
      readonly facing: Facing;
      readonly heldPose: Matrix3x3;
    }
  | { readonly shows: "photo"; readonly picture: Picture }
  /** The object stands in the real room: a WebXR session has the screen. */
  | { readonly shows: "room" };

export type Event =
  | { readonly what: "camera-asked"; readonly facing: Facing }
  | { readonly what: "camera-opened"; readonly picture: Picture; readonly facing: Facing }
  | { readonly what: "photo-opened"; readonly picture: Picture }
  | { readonly what: "frozen"; readonly picture: Picture; readonly heldPose: Matrix3x3 }
  | { readonly what: "hidden" }
  | { readonly what: "room-entered" }
  | { readonly what: "left" };

export const START: State = { shows: "start" };

/** The state after an event; the same one where the event means nothing in it. */
export function next(state: State, event: Event): State {
  switch (event.what) {
    case "camera-asked":
      return { shows: "opening", facing: event.facing };
    case "camera-opened": // of a camera that is not wanted any more nothing comes
      return state.shows === "opening"
        ? { shows: "live", picture: event.picture, facing: event.facing }
        : state;
    case "photo-opened":
      return { shows: "photo", picture: event.picture };
    case "frozen": {
      const { picture, heldPose } = event;
      return state.shows === "live"
        ? { shows: "frozen", picture, facing: state.facing, heldPose }
        : state;
    }
    case "hidden":
      return state.shows === "live" || state.shows === "opening"
        ? { shows: "asleep", facing: state.facing }
        : state;
    case "room-entered":
      return { shows: "room" };
    case "left":
      return START;
  }
}

/** The picture on screen; null where there is none. */
export function pictureOf(state: State): Picture | null {
  return "picture" in state ? state.picture : null;
}

/** Which camera is or was on; the rear one at first. */
export function facingOf(state: State): Facing {
  return "facing" in state ? state.facing : "environment";
}

/** What the tools around the view offer. */
export interface DeskView {
  /** Null where there is nothing to freeze. */
  readonly freeze: "Freeze" | "Live" | null;
  readonly offersMotion: boolean;
  readonly offersOtherCamera: boolean;
  readonly savesLight: boolean;
  readonly savesVideo: boolean;
  readonly setsTilt: boolean;
  /** How much has been looked at. */
  readonly showsRing: boolean;
}

export interface DeskFacts {
  readonly hasLight: boolean;
  readonly hasSeveralCameras: boolean;
  readonly hasSensor: boolean;
  readonly recordsVideo: boolean;
}

export function deskOf(state: State, facts: DeskFacts): DeskView {
  const isLive = state.shows === "live";
  const isFrozen = state.shows === "frozen";
  return {
    freeze: isFrozen ? "Live" : isLive ? "Freeze" : null,
    offersMotion: isLive,
    offersOtherCamera: isLive && facts.hasSeveralCameras,
    savesLight: facts.hasLight,
    savesVideo: isLive && facts.hasLight && facts.recordsVideo,
    setsTilt: !(isLive && facts.hasSensor),
    showsRing: (isLive || isFrozen) && facts.hasLight,
  };
}

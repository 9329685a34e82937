import { IDENTITY } from "deeplight/core";
import { describe, expect, test } from "vitest";
import type { Picture } from "../camera/picture.ts";
import {
  type DeskFacts,
  deskOf,
  type Event,
  facingOf,
  next,
  pictureOf,
  START,
  type State,
} from "./state.ts";

const film = { kind: "live" } as Picture;
const kept = { kind: "photo" } as Picture;
const asked: Event = { what: "camera-asked", facing: "user" };
const opened: Event = { what: "camera-opened", picture: film, facing: "environment" };
const frozen: Event = { what: "frozen", picture: kept, heldPose: IDENTITY };

const through = (...events: Event[]): State => events.reduce(next, START);

describe("the states of the page", () => {
  test("start, camera, frozen, and back", () => {
    expect(through(asked)).toEqual({ shows: "opening", facing: "user" });
    const live = through(asked, opened);
    expect(live).toEqual({ shows: "live", picture: film, facing: "environment" });
    expect(through(asked, opened, frozen)).toMatchObject({ shows: "frozen", picture: kept });
    expect(through(asked, opened, frozen, { what: "left" })).toBe(START);
  });

  test("a camera that comes too late changes nothing", () => {
    const photo: Event = { what: "photo-opened", picture: kept };
    expect(through(asked, photo, opened)).toEqual({ shows: "photo", picture: kept });
    expect(through(asked, { what: "left" }, opened)).toBe(START);
  });

  test("only what films can be frozen or fall asleep", () => {
    const photo = through({ what: "photo-opened", picture: kept });
    expect(next(photo, frozen)).toBe(photo);
    expect(next(photo, { what: "hidden" })).toBe(photo);
    expect(next(START, { what: "hidden" })).toBe(START);
    expect(through(asked, opened, { what: "hidden" })).toEqual({
      shows: "asleep",
      facing: "environment",
    });
    expect(through(asked, { what: "hidden" }).shows).toBe("asleep");
  });

  test("each has a picture or none, and the camera it was", () => {
    expect(pictureOf(START)).toBeNull();
    expect(pictureOf(through(asked))).toBeNull();
    expect(pictureOf(through(asked, opened))).toBe(film);
    expect(facingOf(START)).toBe("environment");
    expect(facingOf(through(asked))).toBe("user");
  });
});

describe("the tools", () => {
  const facts: DeskFacts = {
    hasLight: true,
    hasSeveralCameras: true,
    hasSensor: true,
    recordsVideo: true,
  };

  test("of a live camera", () => {
    expect(deskOf(through(asked, opened), facts)).toEqual({
      freeze: "Freeze",
      offersMotion: true,
      offersOtherCamera: true,
      savesLight: true,
      savesVideo: true,
      setsTilt: false,
      showsRing: true,
    });
  });

  test("of a frozen frame and of a photo", () => {
    const still = deskOf(through(asked, opened, frozen), facts);
    expect(still).toMatchObject({ freeze: "Live", offersMotion: false, showsRing: true });
    expect(still).toMatchObject({ savesVideo: false, setsTilt: true });
    const photo = deskOf(through({ what: "photo-opened", picture: kept }), facts);
    expect(photo).toMatchObject({ freeze: null, showsRing: false, offersOtherCamera: false });
  });

  test("nothing is saved without light", () => {
    const without = { ...facts, hasLight: false };
    const view = deskOf(through(asked, opened), without);
    expect([view.savesLight, view.savesVideo, view.showsRing]).toEqual([false, false, false]);
  });
});

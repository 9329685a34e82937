import { turned, type Vector3 } from "deeplight/core";
import { describe, expect, it } from "vitest";
import { cameraPose } from "./orientation.ts";
import { headingOf, pitchOf, worldFromCamera } from "./pose.ts";

const RIGHT: Vector3 = [1, 0, 0];
const UP: Vector3 = [0, 1, 0];
const AHEAD: Vector3 = [0, 0, -1];
const UPRIGHT = { alpha: 0, beta: 90, gamma: 0 };

function close(got: Vector3, want: Vector3): void {
  got.forEach((value, i) => {
    expect(value).toBeCloseTo(want[i]!, 9);
  });
}

describe("cameraPose", () => {
  it("has no turn for a phone held upright towards the north", () => {
    const pose = cameraPose(UPRIGHT, 0, "environment");
    close(turned(pose, RIGHT), RIGHT);
    close(turned(pose, UP), UP);
    close(turned(pose, AHEAD), AHEAD);
  });

  it("looks straight down for a phone that lies on its back", () => {
    const pose = cameraPose({ alpha: 0, beta: 0, gamma: 0 }, 0, "environment");
    close(turned(pose, AHEAD), [0, -1, 0]);
    expect(pitchOf(pose)).toBeCloseTo(-Math.PI / 2, 6);
  });

  it("looks down by as much as the phone leans forward", () => {
    const pose = cameraPose({ alpha: 0, beta: 60, gamma: 0 }, 0, "environment");
    expect((pitchOf(pose) * 180) / Math.PI).toBeCloseTo(-30, 6);
    close(turned(pose, RIGHT), RIGHT);
  });

  it("turns to the left with alpha, as worldFromCamera does with yaw", () => {
    const pose = cameraPose({ ...UPRIGHT, alpha: 40 }, 0, "environment");
    worldFromCamera((40 * Math.PI) / 180, 0).forEach((value, i) => {
      expect(pose[i]).toBeCloseTo(value, 9);
    });
  });

  it("keeps the picture's up for a phone turned onto its left side", () => {
    // The screen's angle is 90: the phone's right side is up, and so is the picture's top.
    const pose = cameraPose({ alpha: 0, beta: 0, gamma: -90 }, 90, "environment");
    close(turned(pose, UP), UP);
    expect(pitchOf(pose)).toBeCloseTo(0, 6);
  });

  it("looks back with the front camera, un-mirrored", () => {
    const pose = cameraPose(UPRIGHT, 0, "user");
    close(turned(pose, AHEAD), [0, 0, 1]);
    close(turned(pose, RIGHT), [-1, 0, 0]);
    close(turned(pose, UP), UP);
  });
});

describe("headingOf", () => {
  it.each([-2.5, 0, 0.4, 3])(
    "gives back a turn to the left, however the camera is tilted: %f",
    (yaw) => {
      for (const pitch of [-1.2, 0, 0.9]) {
        expect(headingOf(worldFromCamera(yaw, pitch, 0.3))).toBeCloseTo(yaw, 9);
      }
    },
  );
});

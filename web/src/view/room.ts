/** The object in the real room: a WebXR session (`immersive-ar`) draws the stage over the camera. */
import { Matrix4, Quaternion, Vector3 } from "three";
import type { Stage } from "./stage.ts";

/** What is asked for besides light: where surfaces are, and what keeps a place on them. */
export const ROOM_FEATURES = { required: ["hit-test"], optional: ["anchors"] } as const;

/** The object's longest side. */
const FIRST_SIZE_M = 0.3;

export class Room {
  /** Called in each animation frame, before it is drawn. */
  onFrame: (frame: XRFrame, space: XRReferenceSpace) => void = () => {};
  /** Called when the object has been put somewhere. */
  onPlaced: () => void = () => {};
  /** Called when a surface has been found for the first time. */
  onSurface: () => void = () => {};
  private hit: XRHitTestResult | null = null;
  private anchor: XRAnchor | null = null;
  private isPlaced = false;
  private foundSurface = false;

  private constructor(
    private readonly stage: Stage,
    private readonly session: XRSession,
    private readonly surfaces: XRHitTestSource,
  ) {
    session.addEventListener("select", () => this.place());
  }

  static async open(stage: Stage, session: XRSession): Promise<Room> {
    const viewer = await session.requestReferenceSpace("viewer");
    const surfaces = await session.requestHitTestSource?.({ space: viewer });
    if (!surfaces) throw new Error("expected a session that finds surfaces");
    const room = new Room(stage, session, surfaces);
    stage.anchor.scale.setScalar(FIRST_SIZE_M);
    await stage.present(session, (frame, space) => room.frame(frame, space));
    return room;
  }

  private frame(frame: XRFrame, space: XRReferenceSpace): void {
    this.hit = frame.getHitTestResults(this.surfaces)[0] ?? null;
    const at = this.hit?.getPose(space);
    if (at && !this.foundSurface) {
      this.foundSurface = true;
      this.onSurface();
    }
    this.stage.aimAtPoint(at ? placeOf(at) : null);
    const kept = this.anchor && frame.getPose(this.anchor.anchorSpace, space);
    if (kept) this.stage.anchor.position.copy(placeOf(kept));
    this.stage.isPlaced = this.isPlaced;
    this.onFrame(frame, space);
  }

  /** Puts the object on the surface in the middle of the view; it faces who placed it. */
  private place(): void {
    const { hit, stage } = this;
    if (!hit || !stage.target) return;
    stage.anchor.position.copy(stage.target);
    const towards = stage.viewer().sub(stage.target);
    stage.anchor.rotation.y = Math.atan2(towards.x, towards.z);
    stage.relight();
    this.isPlaced = true;
    this.anchor?.delete();
    this.anchor = null;
    // A session without anchors refuses: the place itself is kept then.
    hit.createAnchor?.()?.then(
      (anchor) => {
        this.anchor = anchor;
      },
      () => {},
    );
    this.onPlaced();
  }

  close(): Promise<void> {
    return this.session.end().catch(() => {});
  }
}

function placeOf(pose: XRPose): Vector3 {
  const [place, turn, size] = [new Vector3(), new Quaternion(), new Vector3()];
  new Matrix4().fromArray(pose.transform.matrix).decompose(place, turn, size);
  return place;
}

/** "In your room": the page's side of a WebXR session, with the light gathered while one looks around. */
import {
  IDENTITY,
  LIGHT_FEATURES,
  type Light,
  type SessionTracking,
  trackSession,
} from "deeplight/core";
import { Failure } from "../failure.ts";
import { ROOM_FEATURES, Room } from "../view/room.ts";
import type { Showroom } from "../view/showroom.ts";
import type { Stage } from "../view/stage.ts";
import { announce, box, button } from "./elements.ts";
import type { ModelLoader } from "./model-loader.ts";

const HINTS = {
  looking: "Move the phone slowly: it looks for a floor or a table.",
  found: "Tap to place the object on the ring.",
  placed: "Look around: reflections become those of the room.",
  dark: "This device shows no camera pictures to the page: the light is its own estimate.",
} as const;

export class RoomView {
  private tracking: SessionTracking | null = null;
  private room: Room | null = null;
  private session: XRSession | null = null;

  constructor(
    private readonly stage: Stage,
    private readonly showroom: Showroom,
    private readonly model: ModelLoader,
    private readonly on: { readonly ended: () => void; readonly failed: (error: unknown) => void },
  ) {
    const overlay = box("room");
    button("leave-room").addEventListener("click", () => void this.close());
    button("room-object").addEventListener("click", () => void this.nextObject());
    button("room-material").addEventListener("click", () => this.nextMaterial());
    // A tap on a button places nothing.
    overlay.addEventListener("beforexrselect", (event) => {
      if ((event.target as Element).closest("button")) event.preventDefault();
    });
  }

  /** To be called in the tap that asks for it. @throws Failure `no-room` */
  async open(): Promise<void> {
    const overlay = box("room");
    const session = await navigator.xr
      ?.requestSession("immersive-ar", {
        requiredFeatures: [...ROOM_FEATURES.required],
        optionalFeatures: [...ROOM_FEATURES.optional, ...LIGHT_FEATURES, "dom-overlay"],
        domOverlay: { root: overlay },
      })
      .catch((error: unknown) => {
        throw new Failure("no-room", String(error));
      });
    if (!session) throw new Failure("no-room");
    this.session = session;
    session.addEventListener("end", () => this.ended());
    overlay.hidden = false;
    this.say("looking");
    try {
      this.room = await Room.open(this.stage, session);
    } catch (error) {
      await session.end().catch(() => {});
      throw new Failure("no-room", String(error));
    }
    const { room } = this;
    room.onSurface = () => this.say("found");
    room.onPlaced = () => this.say(this.seesPictures() ? "placed" : "dark");
    this.model.use((estimator) => {
      if (this.session !== session) return;
      const { gl } = this.stage;
      const seen = ({ light }: { light: Light }): void => {
        this.stage.setLight(light, IDENTITY);
        box("room").dataset.seen = String(Math.round(100 * light.seenShare));
      };
      const onError = (error: unknown): void => console.warn("no camera pictures:", error);
      this.tracking = trackSession(estimator, session, gl, seen, { onError });
      room.onFrame = (frame, space) => this.tracking?.onFrame(frame, space);
    });
  }

  async close(): Promise<void> {
    await this.room?.close();
  }

  private ended(): void {
    this.tracking?.stop();
    this.tracking = this.room = this.session = null;
    box("room").hidden = true;
    delete box("room").dataset.seen;
    this.on.ended();
  }

  private seesPictures(): boolean {
    return this.session?.enabledFeatures?.includes("camera-access") ?? false;
  }

  private say(hint: keyof typeof HINTS): void {
    box("room-hint").textContent = HINTS[hint];
    box("room").dataset.hint = hint;
    announce(HINTS[hint]);
  }

  private async nextObject(): Promise<void> {
    const { choices, chosen } = this.showroom;
    const at = choices.findIndex(({ name }) => name === chosen);
    await this.showroom.choose(choices[(at + 1) % choices.length]?.name).catch(this.on.failed);
  }

  private nextMaterial(): void {
    const { materials, material } = this.showroom;
    const next = materials[(materials.indexOf(material!) + 1) % materials.length];
    if (next) this.showroom.setMaterial(next);
  }
}

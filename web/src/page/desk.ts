/** The tools around the view: they set what the app shows, and show what it holds. */
import { Failure } from "../failure.ts";
import { pitchOf } from "../sensors/pose.ts";
import type { App } from "./app.ts";
import { Chips, connectTrays, press, Slider } from "./controls.ts";
import { announce, box, button, canvas, input } from "./elements.ts";
import { unsureOf } from "./light-in-words.ts";
import type { Notice } from "./notice.ts";
import { canRecord, Recorder } from "./recorder.ts";
import { drawRing, sectorsSeen } from "./ring.ts";
import { deskOf, pictureOf } from "./state.ts";
import { give, panoramaPicture, pictureFile } from "./takeaway.ts";

const DEGREES = 180 / Math.PI;
const SENSOR_PATIENCE_MS = 1500;
const MATERIAL_LABELS = {
  diffuse: "Grey",
  silver: "Matte silver",
  mirror: "Mirror",
  glossy: "Glossy",
  file: "Its own",
} as const;

export class Desk {
  private readonly turn: Slider;
  private readonly size: Slider;
  private readonly tilt: Slider;
  private readonly height: Slider;
  private readonly fov: Slider;
  private readonly objects: Chips;
  private readonly materials: Chips;
  private recorder: Recorder | null = null;

  constructor(
    private readonly app: App,
    private readonly notice: Notice,
  ) {
    const { hand, stage } = app;
    const degrees = (value: number): string => `${Math.round(value)}°`;
    this.turn = new Slider("turn", degrees, (value) => {
      hand.turnRad = value / DEGREES;
    });
    this.size = new Slider(
      "size",
      (value) => inMetres(2 ** value),
      (value) => {
        hand.sizeM = 2 ** value;
      },
    );
    this.tilt = new Slider("tilt", degrees, (value) => {
      app.tiltRad = value / DEGREES;
      app.cameraWasSet(false);
    });
    this.height = new Slider("height", inMetres, (value) => {
      stage.heightM = value;
      app.cameraWasSet(false);
    });
    this.fov = new Slider("fov", degrees, (value) => {
      stage.longSideFovRad = value / DEGREES;
      app.cameraWasSet(true);
    });
    this.objects = new Chips("objects", (name) => void this.choose(name));
    this.materials = new Chips("materials", (name) => app.showroom.setMaterial(name));
    this.connect();
    app.onChange = () => this.show();
    app.onLight = () => this.showRing();
    hand.onChange = () => this.showHand();
    this.show();
  }

  private connect(): void {
    const { app } = this;
    connectTrays((tray) => app.stage.keepClearOf(tray?.getBoundingClientRect() ?? null));
    const on = (id: string, act: () => void): void => button(id).addEventListener("click", act);
    on("close", () => app.leave());
    on("freeze", () => void app.freeze());
    on("switch-camera", () => void app.otherCamera());
    on("other-photo", () => input("photo-file").click());
    on("own-object", () => input("model-file").click());
    on("motion", () => void this.followMotion());
    on("meter", () => this.toggleLight());
    on("save-picture", () => void this.save(() => this.picture()));
    on("save-hdr", () => void this.saveLight("hdr"));
    on("save-json", () => void this.saveLight("json"));
    on("save-session", () => void this.save(() => app.sessionToSave(stem())));
    on("open-session", () => input("session-file").click());
    on("save-panorama", () => void this.savePanorama());
    on("record", () => void this.record());
    on("around", () => this.forget());
  }

  /** One of the built-in objects, or the user's that was opened. */
  async choose(name?: string): Promise<void> {
    try {
      await this.app.showroom.choose(name);
    } catch (error) {
      this.notice.show(error, () => void this.choose(name));
    }
    this.show();
  }

  /** The user's own object, chosen, dropped or pasted. */
  async openModel(file: File): Promise<void> {
    try {
      await this.app.showroom.open(file);
    } catch (error) {
      this.notice.show(error);
    }
    this.show();
  }

  private show(): void {
    const { app } = this;
    const view = deskOf(app.state, {
      hasLight: app.light !== null,
      hasSeveralCameras: app.hasSeveralCameras,
      hasSensor: app.sensor.isOn,
      recordsVideo: canRecord(app.stage.canvas),
    });
    button("freeze").hidden = view.freeze === null;
    button("freeze").firstElementChild!.textContent = view.freeze ?? "";
    press("freeze", view.freeze === "Live");
    button("switch-camera").hidden = !view.offersOtherCamera;
    button("motion").hidden = !view.offersMotion;
    press("motion", app.sensor.isOn);
    for (const id of ["save-picture", "save-hdr", "save-json", "save-panorama", "hand-over"]) {
      button(id).disabled = !view.savesLight;
    }
    button("record").hidden = !view.savesVideo && !this.recorder;
    button("around").hidden = button("save-session").hidden = !view.showsRing;
    this.tilt.enable(view.setsTilt);
    this.showSure();
    this.showRing();
    this.tilt.show(Math.round(pitchOf(app.pose()) * DEGREES));
    this.height.show(app.stage.heightM);
    this.fov.show(app.stage.longSideFovRad * DEGREES);
    this.objects.show(app.showroom.choices, app.showroom.chosen);
    const choices = app.showroom.materials.map((name) => ({
      name,
      label: MATERIAL_LABELS[name],
      look: name,
    }));
    this.materials.show(choices, app.showroom.material);
    this.showHand();
  }

  private showHand(): void {
    this.turn.show(Math.round(this.app.hand.turnRad * DEGREES));
    this.size.show(Math.log2(this.app.hand.sizeM));
  }

  private async followMotion(): Promise<void> {
    const { sensor } = this.app;
    try {
      if (sensor.isOn) sensor.stop();
      else {
        await sensor.ask();
        await sensor.firstReading(SENSOR_PATIENCE_MS);
      }
    } catch (error) {
      sensor.stop();
      this.notice.show(error);
    }
    this.show();
  }

  private toggleLight(): void {
    const is = box("light").hidden !== false;
    button("meter").setAttribute("aria-expanded", String(is));
    this.app.showLightPanel(is);
  }

  /** How sure the estimate is, where it is not. */
  private showSure(): void {
    const confidence = this.app.seen?.confidence;
    const unsure = confidence ? unsureOf(confidence) : "";
    box("unsure").textContent = unsure;
    box("unsure").hidden = unsure === "";
  }

  /** Which way one has looked. */
  private showRing(): void {
    const { light } = this.app;
    if (!light?.panorama || button("around").hidden) return;
    const percent = Math.round(100 * light.seenShare);
    button("around").setAttribute("aria-label", `${percent} % of all directions seen. Begin anew`);
    drawRing(canvas("ring"), sectorsSeen(light.panorama, this.app.pose()));
  }

  private forget(): void {
    this.app.forget();
    announce("What was seen is forgotten.");
  }

  private saveLight(kind: "hdr" | "json"): Promise<void> {
    return this.save(async () => {
      const light = await this.app.lightToSave();
      const blob = kind === "hdr" ? light.hdr() : light.json();
      return new File([blob], `${stem()}.${kind}`, { type: blob.type });
    });
  }

  /** The picture with the object in it, as large as the camera can. */
  private picture(): Promise<File> {
    const { state, stage } = this.app;
    const make = () => pictureFile(stage.snapshot(), stem());
    return pictureOf(state)?.atFullSize(make) ?? make();
  }

  private savePanorama(): Promise<void> {
    return this.save(async () => panoramaPicture(await this.app.lightToSave(), stem()));
  }

  /** Begins a film of the picture with the object in it, or ends it and gives it away. */
  private async record(): Promise<void> {
    const { recorder } = this;
    if (recorder) {
      this.recorder = null;
      await this.save(() => recorder.end(stem()));
    } else this.recorder = Recorder.start(this.app.stage.canvas);
    button("record").textContent = this.recorder ? "End the video" : "Video";
    press("record", this.recorder !== null);
    this.show();
  }

  private async save(make: () => Promise<File>): Promise<void> {
    try {
      const file = await make();
      if (await give(file)) announce(`${file.name} saved.`);
    } catch (error) {
      this.notice.show(
        error instanceof Failure ? error : new Failure("cannot-save", String(error)),
      );
    }
  }
}

/** Asks for the sensors where that is needed, in the same tap as for the camera. */
export async function followMotion({ sensor }: App): Promise<void> {
  await sensor.ask().catch(() => {}); // without them the pictures say how the phone turns
}

function inMetres(value: number): string {
  return value < 1 ? `${Math.round(value * 100)} cm` : `${value.toFixed(1)} m`;
}

function stem(): string {
  return `deeplight-${new Date().toISOString().slice(0, 19).replace(/[:T]/g, "-")}`;
}

/** The tools around the view: they set what the app shows, and show what it holds. */
import { hdrFile, jsonFile } from "deeplight/core";
import { Failure } from "../failure.ts";
import { mayRead } from "../sensors/orientation.ts";
import { pitchOf } from "../sensors/pose.ts";
import type { App } from "./app.ts";
import { Chips, connectTrays, press, Slider } from "./controls.ts";
import { announce, box, button, input } from "./elements.ts";
import type { Notice } from "./notice.ts";
import { give, pictureFile } from "./takeaway.ts";

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
    hand.onChange = () => this.showHand();
    this.show();
  }

  private connect(): void {
    const { app } = this;
    connectTrays();
    const on = (id: string, act: () => void): void => button(id).addEventListener("click", act);
    on("close", () => app.leave());
    on("freeze", () => void app.freeze());
    on("switch-camera", () => void app.otherCamera());
    on("other-photo", () => input("photo-file").click());
    on("own-object", () => input("model-file").click());
    on("motion", () => void this.followMotion());
    on("meter", () => this.toggleLight());
    on("save-picture", () => void this.save(() => pictureFile(app.stage.snapshot(), stem())));
    on("save-hdr", () => void this.saveLight("hdr"));
    on("save-json", () => void this.saveLight("json"));
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
    const isLive = app.shows === "live";
    const isFrozen = app.shows === "frozen";
    const hasLight = app.light !== null;
    button("freeze").hidden = !(isLive || isFrozen);
    button("freeze").firstElementChild!.textContent = isFrozen ? "Live" : "Freeze";
    press("freeze", isFrozen);
    if (!isLive) button("switch-camera").hidden = true;
    button("motion").hidden = !isLive;
    press("motion", app.sensor.isOn);
    for (const id of ["save-picture", "save-hdr", "save-json"]) button(id).disabled = !hasLight;
    this.tilt.enable(!(isLive && app.sensor.isOn));
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

  private saveLight(kind: "hdr" | "json"): Promise<void> {
    const { light } = this.app;
    return this.save(async () => {
      if (!light) throw new Failure("cannot-save", "no light yet");
      const blob = kind === "hdr" ? hdrFile(light) : jsonFile(light, this.app.about());
      return new File([blob], `${stem()}.${kind}`, { type: blob.type });
    });
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

/** Starts the sensors where nobody has to be asked. */
export async function followMotionUnasked({ sensor }: App): Promise<void> {
  if (await mayRead()) sensor.start();
}

function inMetres(value: number): string {
  return value < 1 ? `${Math.round(value * 100)} cm` : `${value.toFixed(1)} m`;
}

function stem(): string {
  return `deeplight-${new Date().toISOString().slice(0, 19).replace(/[:T]/g, "-")}`;
}

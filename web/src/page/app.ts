/** The page as a whole: what is on screen, where its light comes from, what happens when it fails. */

import {
  type About,
  ASSUMED_LONG_SIDE_FOV_RAD,
  type Estimator,
  IDENTITY,
  Light,
  type Matrix3x3,
  transposed,
} from "deeplight/core";
import { hasSeveralCameras, LiveCamera } from "../camera/live.ts";
import { Photo } from "../camera/photo.ts";
import type { Picture } from "../camera/picture.ts";
import { Failure } from "../failure.ts";
import { type Facing, OrientationSensor } from "../sensors/orientation.ts";
import { worldFromCamera } from "../sensors/pose.ts";
import { verticalFov } from "../view/fit.ts";
import { Gestures } from "../view/gestures.ts";
import { Hand } from "../view/hand.ts";
import { Showroom } from "../view/showroom.ts";
import { Stage } from "../view/stage.ts";
import { announce, box, canvas, element } from "./elements.ts";
import { inWords } from "./light-in-words.ts";
import { LightPanel } from "./light-panel.ts";
import { Meter } from "./meter.ts";
import type { ModelLoader } from "./model-loader.ts";
import type { Notice } from "./notice.ts";
import type { RoomView } from "./room-view.ts";
import { type Event, facingOf, next, pictureOf, START, type State } from "./state.ts";
import { type Looked, type Seen, Watch } from "./watch.ts";

/** As `deeplight compose` assumes where nothing says the tilt. */
export const ASSUMED_TILT_RAD = (-15 * Math.PI) / 180;
/** Rows of a saved light of many frames. */
const SAVED_ROWS = 512;

export class App {
  readonly stage: Stage;
  readonly hand: Hand;
  readonly showroom: Showroom;
  private room: RoomView | null = null;
  readonly sensor = new OrientationSensor();
  /** Called when the picture, the pose or the tools' state have changed. */
  onChange: () => void = () => {};
  /** Called when the light or the camera's direction has changed. */
  onLight: () => void = () => {};
  readonly firstLight: Promise<void>;
  private wasLit: () => void = () => {};
  /** How the camera is held where no sensor says it. */
  tiltRad = ASSUMED_TILT_RAD;
  private rollRad = 0;
  state: State = START;
  /** The newest light. */
  seen: Seen | null = null;
  hasSeveralCameras = false;
  /** How the camera is held, as its pictures say. */
  private visualPose: Matrix3x3 | null = null;
  /** A file was opened whose turns count from another direction. */
  private isWorldNew = false;
  /** Of a photo: from who gave it, or set by hand. */
  private isTiltKnown = false;
  private watch: Watch | null = null;
  private readonly meter = new Meter();
  private photosAsked = 0;
  private readonly panel = new LightPanel();

  constructor(
    private readonly notice: Notice,
    private readonly model: ModelLoader,
  ) {
    this.firstLight = new Promise((resolve) => {
      this.wasLit = resolve;
    });
    this.stage = new Stage(canvas("view"));
    this.stage.onLost = () => notice.show(new Failure("graphics-lost"));
    this.hand = new Hand(this.stage);
    this.showroom = new Showroom(this.stage);
    new Gestures(canvas("view"), this.hand);
    this.sensor.onReading = () => this.moved();
    this.sensor.onFirstReading = () => this.placeAgain();
    addEventListener("resize", () => this.stage.layOut());
    element("video", HTMLVideoElement).addEventListener("resize", () => this.stage.layOut());
    document.addEventListener("visibilitychange", () => this.visibilityChanged());
    addEventListener("popstate", () => this.leave());
  }

  get light(): Light | null {
    return this.seen?.light ?? null;
  }

  async openCamera(facing: Facing = facingOf(this.state)): Promise<void> {
    const goesOn = this.state.shows === "live" || this.state.shows === "frozen";
    const { tiltRad } = this;
    this.go({ what: "camera-asked", facing });
    const opening = this.state;
    try {
      const camera = await LiveCamera.open(element("video", HTMLVideoElement), facing);
      if (this.state !== opening) return camera.close(); // something else was opened meanwhile
      camera.onLost = () => {
        this.leave();
        this.notice.show(new Failure("camera-lost"));
      };
      this.go({ what: "camera-opened", picture: camera, facing: camera.facing });
      this.show(camera, goesOn ? tiltRad : ASSUMED_TILT_RAD, goesOn);
      this.hasSeveralCameras = await hasSeveralCameras();
      this.onChange();
    } catch (error) {
      if (this.state !== opening) return;
      this.leave();
      this.notice.show(error);
    }
  }

  /** Puts the object into the real room, where the browser can. */
  async openRoom(): Promise<void> {
    this.go({ what: "room-entered" });
    const opening = this.state;
    try {
      const { RoomView } = await import("./room-view.ts");
      this.room ??= new RoomView(this.stage, this.showroom, this.model, {
        ended: () => this.leave(),
        failed: (error) => this.notice.show(error),
      });
      await this.room.open();
      box("start").hidden = true;
    } catch (error) {
      if (this.state === opening) this.leave();
      this.notice.show(error);
    }
  }

  /** Goes on with what a camera saw before, at the same place; opens the camera where it is not. */
  async openSession(file: Blob): Promise<void> {
    try {
      if (this.state.shows !== "live") await this.openCamera();
      const { watch } = this;
      if (this.state.shows !== "live" || !watch) return;
      const views = await watch.estimator.restorePlace(new Uint8Array(await file.arrayBuffer()));
      this.isWorldNew = true;
      watch.again();
      announce(`Opened ${views} views.`);
    } catch (error) {
      this.notice.show(error);
    }
  }

  otherCamera(): Promise<void> {
    const { facing } = this;
    // Without sensors nothing says how the two cameras' worlds fit together.
    if (!this.sensor.isOn) this.forget();
    return this.openCamera(facing === "user" ? "environment" : "user");
  }

  /** @param tiltRad of the camera, where it is known. */
  async openPhoto(file: Blob | Promise<Blob>, tiltRad?: number): Promise<void> {
    const asked = ++this.photosAsked;
    try {
      const picture = await Photo.open(await file);
      if (asked !== this.photosAsked) return; // a smaller one that was chosen later was quicker
      this.notice.close();
      this.go({ what: "photo-opened", picture });
      this.forget();
      const pitchRad = tiltRad ?? (picture.up && Math.asin(-picture.up[2]));
      this.isTiltKnown = pitchRad !== null;
      this.show(picture, pitchRad ?? ASSUMED_TILT_RAD);
    } catch (error) {
      if (asked === this.photosAsked) this.notice.show(error);
    }
  }

  /** Keeps the camera's picture of now as a photo, and the light so far; or goes on live. */
  async freeze(): Promise<void> {
    if (this.state.shows === "frozen") return this.openCamera();
    if (this.state.shows !== "live") return;
    const { seen } = this;
    const heldPose = this.pose();
    const picture = Photo.of(this.state.picture);
    this.go({ what: "frozen", picture, heldPose });
    this.stage.show(picture);
    if (seen?.frame === "world") {
      this.seen = seen;
      this.stage.setLight(seen.light, IDENTITY);
      this.onChange();
    } else this.estimate();
    announce("Picture frozen.");
  }

  /** Back to the start screen, camera off. */
  leave(): void {
    this.go({ what: "left" });
    this.forget();
    box("viewer").hidden = true;
    box("start").hidden = false;
    if (history.state?.viewing) history.back();
    this.onChange();
  }

  /** Forgets what the camera has seen so far. */
  forget(): void {
    this.watch?.estimator.leavePlace();
    this.visualPose = null;
    this.isWorldNew = false;
    this.watch?.again();
  }

  /** After tilt, height or field of view were set by hand: the object keeps its place on screen. */
  cameraWasSet(lightToo: boolean): void {
    const place = this.stage.place();
    this.isTiltKnown = true;
    if (this.state.shows === "frozen") {
      this.state = { ...this.state, heldPose: this.startPose() };
    }
    if (this.state.shows !== "photo") this.forget(); // the light did not turn, our idea of the camera did
    this.stage.setPose(this.pose());
    if (this.seen?.frame === "camera") this.stage.setLight(this.seen.light, this.pose());
    this.stage.layOut();
    this.hand.standAt(...place);
    if (lightToo) this.watch?.look();
  }

  /** Where the camera looks: as the sensors say, else as the pictures do, else as it was set. */
  pose(): Matrix3x3 {
    const { state } = this;
    const held = state.shows === "frozen" ? state.heldPose : null;
    return held ?? this.sensedPose() ?? this.visualPose ?? this.startPose();
  }

  /** Where the light of now comes from, for its file. */
  about(): About {
    const picture = pictureOf(this.state);
    const model = this.watch?.estimator.model;
    if (!picture || !model) throw new Failure("cannot-save", "nothing is estimated");
    const { file, width, height } = picture;
    const notes = this.seen?.frame === "world" ? ["gathered from the camera's frames so far"] : [];
    const photo = { file, width, height };
    const { heads } = this.seen ?? {};
    return { model, photo, verticalFovRad: this.fovOf(picture), notes, heads };
  }

  /** The light of now in the camera's frame, as fine as it is known. */
  async lightToSave(): Promise<Light> {
    const { seen, watch } = this;
    const about = this.about();
    if (!seen || !watch) throw new Failure("cannot-save", "no light yet");
    const { lighting, lamps, panorama } = seen.light;
    if (seen.frame === "camera") return new Light(lighting, about, lamps, panorama);
    const request = { worldFromCamera: this.pose(), rows: SAVED_ROWS };
    const environment = await watch.estimator.fused(request);
    if (!environment) throw new Failure("cannot-save", "no light yet");
    return Light.of(environment, about);
  }

  /** What the camera has seen so far, for `openSession` and for Python. */
  async sessionToSave(stem: string): Promise<File> {
    const file = await this.watch?.estimator.savedPlace();
    if (!file) throw new Failure("cannot-save", "nothing was seen yet");
    return new File([file], `${stem}.npz`, { type: "application/octet-stream" });
  }

  showLightPanel(is: boolean): void {
    box("light").hidden = !is;
    if (is) this.panel.refresh();
  }

  get facing(): Facing {
    return facingOf(this.state);
  }

  /** Changes the state; what was shown and is not any more lets go of the camera or the memory. */
  private go(event: Event): void {
    const before = pictureOf(this.state);
    this.state = next(this.state, event);
    if (before === null || before === pictureOf(this.state)) return;
    this.watch?.stop();
    before.close();
    this.seen = null;
    delete box("viewer").dataset.light;
    this.panel.clear();
    this.stage.clear();
  }

  /** @param keepsPlace leaves the object where it stands: the same camera goes on. */
  private show(picture: Picture, tiltRad: number, keepsPlace = false): void {
    this.tiltRad = tiltRad;
    this.rollRad = picture.up ? Math.atan2(picture.up[0], picture.up[1]) : 0;
    box("start").hidden = true;
    box("viewer").hidden = false;
    if (!history.state?.viewing) history.pushState({ viewing: true }, "");
    this.estimate();
    // Its frame goes off before the graphics, which can block the page, have a look at the picture.
    setTimeout(() => this.put(picture, keepsPlace));
  }

  private put(picture: Picture, keepsPlace: boolean): void {
    if (pictureOf(this.state) !== picture) return;
    try {
      this.stage.show(picture);
      if (keepsPlace) this.stage.setPose(this.pose());
      else this.placeAgain();
      canvas("view").focus({ preventScroll: true });
    } catch (error) {
      this.notice.show(error);
    }
  }

  private placeAgain(): void {
    this.stage.setPose(this.pose());
    this.hand.reset();
    this.onChange();
  }

  private estimate(): void {
    const picture = pictureOf(this.state);
    this.meter.clear();
    box("meter-text").textContent = String(this.meter);
    this.onChange();
    this.model.use((estimator) => {
      if (!picture || pictureOf(this.state) !== picture) return;
      if (this.watch?.estimator !== estimator) this.watch = this.watchWith(estimator);
      this.watch.start(picture);
    });
  }

  private watchWith(estimator: Estimator): Watch {
    return new Watch(estimator, {
      sensedPose: () => this.sensedPose(),
      startPose: () => this.startPose(),
      verticalFovRad: (of) => this.fovOf(of),
      seen: (seen) => this.lit(seen),
      looked: (looked) => this.looked(looked),
      failed: (error) => this.notice.show(error, () => this.estimate()),
    });
  }

  private lit(seen: Seen): void {
    const isFirst = this.seen === null;
    this.seen = seen;
    if (seen.pitchRad !== null && !this.isTiltKnown) {
      this.tiltRad = seen.pitchRad;
      this.placeAgain();
    }
    const isLive = seen.frame === "world";
    this.stage.setLight(seen.light, isLive ? IDENTITY : this.pose());
    this.panel.show({ light: seen.light, worldFromCamera: isLive ? this.pose() : null });
    if (isFirst || (!isLive && !seen.isFirst)) {
      announce(`Light estimated. ${inWords(this.lightAhead(seen).mainLight())}`);
    }
    if (isFirst || !isLive) this.onChange();
    box("viewer").dataset.light = seen.isFirst ? "first" : "whole";
    this.onLight();
    this.wasLit();
  }

  /** As the camera sees it now. */
  private lightAhead({ light, frame }: Seen) {
    const { lighting } = light;
    return frame === "camera" ? lighting : lighting.turned(transposed(this.pose()));
  }

  private looked({ visualPose, isNew, tookMs }: Looked): void {
    this.meter.count(performance.now(), tookMs);
    box("meter-text").textContent = String(this.meter);
    if (isNew) announce("Another place: the light is gathered anew.");
    if (!visualPose) return;
    if (isNew || this.isWorldNew) this.hand.keepInSight(this.pose(), visualPose);
    this.visualPose = visualPose;
    this.isWorldNew = false;
    this.moved();
  }

  private sensedPose(): Matrix3x3 | null {
    return (this.state.shows === "live" && this.sensor.pose(this.facing)) || null;
  }

  private startPose(): Matrix3x3 {
    return worldFromCamera(0, this.tiltRad, this.rollRad);
  }

  /** As the file says or the slider was set; undefined leaves the usual to be assumed. */
  private fovOf(picture: Picture): number | undefined {
    const { longSideFovRad } = this.stage;
    if (picture.verticalFovRad || longSideFovRad === ASSUMED_LONG_SIDE_FOV_RAD) {
      return picture.verticalFovRad;
    }
    return verticalFov(picture, longSideFovRad);
  }

  private moved(): void {
    if (this.state.shows !== "live") return;
    this.stage.setPose(this.pose());
    this.onLight();
  }

  /** A page that nobody sees does not film. */
  private visibilityChanged(): void {
    if (document.hidden) this.go({ what: "hidden" });
    else if (this.state.shows === "asleep") void this.openCamera();
  }
}

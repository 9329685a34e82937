/** The page as a whole: what is on screen, where its light comes from, what happens when it fails. */

import {
  type About,
  ASSUMED_LONG_SIDE_FOV_RAD,
  type Estimator,
  type Lighting,
  type Matrix3x3,
  Smoother,
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
import { announce, box, button, canvas, element } from "./elements.ts";
import { inWords } from "./light-in-words.ts";
import { LightPanel } from "./light-panel.ts";
import { Meter } from "./meter.ts";
import type { ModelLoader } from "./model-loader.ts";
import type { Notice } from "./notice.ts";
import { Watch } from "./watch.ts";

/** As `deeplight compose` assumes where nothing gives the tilt. */
export const ASSUMED_TILT_RAD = (-15 * Math.PI) / 180;

export class App {
  readonly stage: Stage;
  readonly hand: Hand;
  readonly showroom: Showroom;
  readonly sensor = new OrientationSensor();
  /** Called when the picture, the pose or the tools' state have changed. */
  onChange: () => void = () => {};
  readonly firstLight: Promise<void>;
  private wasLit: () => void = () => {};
  /** How the camera is held where no sensor gives it. */
  tiltRad = ASSUMED_TILT_RAD;
  /** The newest light, smoothed while live. */
  light: Lighting | null = null;
  private picture: Picture | null = null;
  private facing: Facing = "environment";
  /** How the phone was held when its picture was frozen. */
  private heldPose: Matrix3x3 | null = null;
  private wasFrozen = false;
  /** Counts what was opened and closed: a camera that comes too late is not wanted any more. */
  private asked = 0;
  /** The camera is off because nobody sees the page. */
  private sleeping = false;
  private watch: Watch | null = null;
  private readonly smoother = new Smoother();
  private readonly meter = new Meter();
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

  get shows(): "nothing" | "live" | "frozen" | "photo" {
    if (!this.picture) return "nothing";
    if (this.picture.kind === "live") return "live";
    return this.wasFrozen ? "frozen" : "photo";
  }

  async openCamera(facing: Facing = this.facing): Promise<void> {
    const goesOn = this.shows === "live" || this.shows === "frozen";
    const { tiltRad } = this;
    this.release();
    const { asked } = this;
    try {
      const camera = await LiveCamera.open(element("video", HTMLVideoElement), facing);
      if (asked !== this.asked) return camera.close(); // something else was opened meanwhile
      this.facing = camera.facing;
      camera.onLost = () => {
        this.leave();
        this.notice.show(new Failure("camera-lost"));
      };
      this.show(camera, goesOn ? tiltRad : ASSUMED_TILT_RAD, goesOn);
      button("switch-camera").hidden = !(await hasSeveralCameras());
    } catch (error) {
      if (asked !== this.asked) return;
      this.leave();
      this.notice.show(error);
    }
  }

  otherCamera(): Promise<void> {
    return this.openCamera(this.facing === "user" ? "environment" : "user");
  }

  async openPhoto(file: Blob | Promise<Blob>, tiltRad = ASSUMED_TILT_RAD): Promise<void> {
    try {
      const photo = await Photo.open(await file);
      this.release();
      this.show(photo, tiltRad);
    } catch (error) {
      this.notice.show(error);
    }
  }

  /** Keeps the camera's picture of now as a photo; or goes on live. */
  async freeze(): Promise<void> {
    if (this.shows === "frozen") return this.openCamera();
    if (this.picture?.kind !== "live") return;
    const pose = this.pose();
    const photo = Photo.of(this.picture);
    this.picture.close();
    this.picture = photo;
    this.wasFrozen = true;
    this.heldPose = pose;
    this.stage.show(photo);
    this.smoother.reset();
    this.estimate();
    announce("Picture frozen.");
  }

  /** Back to the start screen, camera off. */
  leave(): void {
    this.release();
    box("viewer").hidden = true;
    box("start").hidden = false;
    if (history.state?.viewing) history.back();
    this.onChange();
  }

  /** After tilt, height or field of view were set by hand: the object keeps its place on screen. */
  cameraWasSet(lightToo: boolean): void {
    const place = this.stage.place();
    this.heldPose = null;
    this.smoother.reset(); // the light did not turn, our idea of the camera did
    this.stage.setPose(this.pose());
    if (this.light) this.stage.setLight(this.light, this.pose());
    this.stage.layOut();
    this.hand.standAt(...place);
    if (lightToo) this.watch?.look();
  }

  /** Where the camera looks: as the sensors say, else as it was set. */
  pose(): Matrix3x3 {
    const sensed = this.shows === "live" ? this.sensor.pose(this.facing) : this.heldPose;
    return sensed ?? worldFromCamera(0, this.tiltRad);
  }

  /** Where the light of now comes from, for its file. */
  about(): About {
    const { picture } = this;
    const model = this.watch?.estimator.model;
    if (!picture || !model) throw new Failure("cannot-save", "nothing is estimated");
    const { file, width, height } = picture;
    const notes = picture.kind === "live" ? ["smoothed over the camera's last frames"] : [];
    const photo = { file, width, height };
    return { model, photo, verticalFovRad: this.fovOf(picture), notes };
  }

  showLightPanel(is: boolean): void {
    box("light").hidden = !is;
    if (is) this.panel.refresh();
  }

  /** @param keepsPlace leaves the object where it stands: the same camera goes on. */
  private show(picture: Picture, tiltRad: number, keepsPlace = false): void {
    this.picture = picture;
    this.tiltRad = tiltRad;
    this.wasFrozen = false;
    this.heldPose = null;
    box("start").hidden = true;
    box("viewer").hidden = false;
    if (!history.state?.viewing) history.pushState({ viewing: true }, "");
    this.estimate();
    // Its frame goes off before the graphics, which can block the page, have a look at the picture.
    setTimeout(() => this.put(picture, keepsPlace));
  }

  private put(picture: Picture, keepsPlace: boolean): void {
    if (this.picture !== picture) return;
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
    this.smoother.reset();
    this.stage.setPose(this.pose());
    this.hand.reset();
    this.onChange();
  }

  private estimate(): void {
    const { picture } = this;
    this.meter.clear();
    this.showMeter();
    this.onChange();
    this.model.use((estimator) => {
      if (!picture || this.picture !== picture) return;
      if (this.watch?.estimator !== estimator) this.watch = this.watchWith(estimator);
      this.watch.start(picture);
    });
  }

  private watchWith(estimator: Estimator): Watch {
    return new Watch(estimator, {
      pose: () => this.pose(),
      verticalFovRad: (of) => this.fovOf(of),
      seen: ({ lighting, worldFromCamera: pose, tookMs }) => this.seen(lighting, pose, tookMs),
      failed: (error) => this.notice.show(error, () => this.estimate()),
    });
  }

  private seen(lighting: Lighting, pose: Matrix3x3, tookMs: number): void {
    const isLive = this.shows === "live";
    const isFirst = this.light === null;
    const now = performance.now();
    this.light = isLive ? this.smoother.next(lighting, now, pose) : lighting;
    this.stage.setLight(this.light, pose);
    this.panel.show(this.light);
    this.meter.count(now, tookMs);
    this.showMeter();
    if (isFirst || !isLive) announce(`Light estimated. ${inWords(this.light.mainLight())}`);
    if (isFirst) this.onChange();
    this.wasLit();
  }

  /** As the file says or the slider was set; undefined leaves the usual to be assumed. */
  private fovOf(picture: Picture): number | undefined {
    const { longSideFovRad } = this.stage;
    if (picture.verticalFovRad || longSideFovRad === ASSUMED_LONG_SIDE_FOV_RAD) {
      return picture.verticalFovRad;
    }
    return verticalFov(picture, longSideFovRad);
  }

  private showMeter(): void {
    box("meter-text").textContent = String(this.meter);
  }

  private moved(): void {
    if (this.shows === "live") this.stage.setPose(this.pose());
  }

  private release(): void {
    this.asked++;
    this.watch?.stop();
    this.picture?.close();
    this.picture = null;
    this.light = null;
    this.smoother.reset();
    this.panel.clear();
    this.stage.clear();
  }

  /** A page that nobody sees does not film. */
  private visibilityChanged(): void {
    if (document.hidden && this.shows === "live") {
      this.watch?.stop();
      this.picture?.close();
      this.sleeping = true;
    } else if (!document.hidden && this.sleeping) {
      this.sleeping = false;
      void this.openCamera();
    }
  }
}

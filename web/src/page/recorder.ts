/** A film of the view: the camera's picture with the object in it. */
import { Failure } from "../failure.ts";

/** The first that the browser writes: MP4 plays everywhere, WebM in most places. */
const TYPES = ["video/mp4;codecs=avc1.42E01F", "video/mp4", "video/webm;codecs=vp9", "video/webm"];
const BITS_PER_SECOND = 8e6;

export function canRecord(canvas: HTMLCanvasElement): boolean {
  return "captureStream" in canvas && typeOf() !== undefined;
}

export class Recorder {
  private readonly parts: Blob[] = [];

  private constructor(
    private readonly recorder: MediaRecorder,
    private readonly stream: MediaStream,
  ) {
    recorder.addEventListener("dataavailable", ({ data }) => this.parts.push(data));
    recorder.start(1000); // a part a second: a long film does not wait in the encoder
  }

  static start(canvas: HTMLCanvasElement): Recorder {
    const stream = canvas.captureStream(30);
    const mimeType = typeOf();
    const options = { videoBitsPerSecond: BITS_PER_SECOND, ...(mimeType ? { mimeType } : {}) };
    return new Recorder(new MediaRecorder(stream, options), stream);
  }

  /** @throws Failure `cannot-save` where nothing was filmed. */
  async end(stem: string): Promise<File> {
    await new Promise<void>((stopped) => {
      this.recorder.addEventListener("stop", () => stopped(), { once: true });
      if (this.recorder.state === "inactive") stopped();
      else this.recorder.stop();
    });
    for (const track of this.stream.getTracks()) track.stop();
    const [type] = this.recorder.mimeType.split(";");
    const film = new Blob(this.parts, type ? { type } : {});
    if (film.size === 0) throw new Failure("cannot-save", "nothing was filmed");
    const suffix = type === "video/mp4" ? "mp4" : "webm";
    return new File([film], `${stem}.${suffix}`, { type: film.type });
  }
}

function typeOf(): string | undefined {
  if (typeof MediaRecorder === "undefined") return undefined;
  return TYPES.find((type) => MediaRecorder.isTypeSupported(type));
}

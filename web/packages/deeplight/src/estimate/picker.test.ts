/** A browser that will not hand over a frame's pixels gets the canvas; stand-ins play both. */
import { afterEach, expect, test, vi } from "vitest";
import { noise } from "../../../../tests/noise.ts";
import { CONTRACT } from "../contract/generated.ts";
import { CellMeans } from "./cell-means.ts";
import { framePhoto } from "./framing.ts";
import { type Frame, Picker } from "./picker.ts";

const [WIDTH, HEIGHT] = [1080, 1920];
const PIXELS = noise(WIDTH, HEIGHT);
const framing = framePhoto(HEIGHT, WIDTH, undefined, CONTRACT);
let copied = 0;

/** Hands over the first strip, brightened so that it would be noticed, and refuses the second. */
class Refusing {
  readonly format = "NV12";
  readonly displayWidth = WIDTH;
  readonly displayHeight = HEIGHT;
  readonly visibleRect = { x: 0, y: 0, width: WIDTH, height: HEIGHT };

  allocationSize({ rect }: { rect: DOMRectInit }): number {
    return 4 * rect.width! * rect.height!;
  }

  async copyTo(to: Uint8Array): Promise<void> {
    copied++;
    if (copied === 2) throw new TypeError("not supported");
    to.fill(255);
  }
}

/** Draws without scaling, as the picker asks for. */
class Canvas {
  #from = { x: 0, y: 0 };

  getContext(): object {
    return {
      drawImage: (_: unknown, x: number, y: number) => {
        this.#from = { x, y };
      },
      getImageData: (_x: number, _y: number, width: number, height: number) => {
        const data = new Uint8ClampedArray(4 * width * height);
        for (let row = 0; row < height; row++) {
          const start = 4 * ((this.#from.y + row) * WIDTH + this.#from.x);
          data.set(PIXELS.subarray(start, start + 4 * width), 4 * width * row);
        }
        return { data };
      },
    };
  }
}

afterEach(() => vi.unstubAllGlobals());

test("a frame whose second strip is refused is drawn from its start, and so are the next", async () => {
  vi.stubGlobal("VideoFrame", Refusing);
  vi.stubGlobal("OffscreenCanvas", Canvas);
  const want = new CellMeans(framing);
  const { left, top, width, height } = want;
  const canvas = new Canvas().getContext() as OffscreenCanvasRenderingContext2D;
  canvas.drawImage(new Refusing() as never, left, top, width, height, 0, 0, width, height);
  want.add(canvas.getImageData(0, 0, width, height).data, top);
  const planes = want.planes(-0.5, 0.5);
  const picker = new Picker();
  for (let frame = 0; frame < 2; frame++) {
    const means = new CellMeans(framing);
    expect(await picker.pick(new Refusing() as unknown as Frame, means)).toBe(false);
    const got = means.planes(-0.5, 0.5);
    expect(got.every((value, i) => Math.abs(value - planes[i]!) < 1e-6)).toBe(true);
  }
  expect(copied).toBe(2);
});

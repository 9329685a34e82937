/** The pixels of an AR session's camera: halved by the graphics card, read without holding it up. */

const LONGEST = 720;

interface Size {
  readonly width: number;
  readonly height: number;
}

interface Level extends Size {
  readonly framebuffer: WebGLFramebuffer;
  readonly store: WebGLRenderbuffer;
}

/** Rows from the top, RGBA. */
export interface Pixels extends Size {
  readonly data: Uint8ClampedArray<ArrayBuffer>;
}

/** Sizes from a camera's to one of at most `longest` pixels along the longer side, halved each time. */
export function halvings({ width, height }: Size, longest = LONGEST): readonly Size[] {
  const sizes = [{ width, height }];
  for (let last = sizes[0]!; Math.max(last.width, last.height) > longest; ) {
    last = { width: Math.ceil(last.width / 2), height: Math.ceil(last.height / 2) };
    sizes.push(last);
  }
  return sizes.length > 1 ? sizes.slice(1) : sizes;
}

export class CameraPixels {
  #levels: readonly Level[] = [];
  #from: Size = { width: 0, height: 0 };
  readonly #source: WebGLFramebuffer;
  readonly #buffer: WebGLBuffer;
  #fence: WebGLSync | null = null;

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.#source = gl.createFramebuffer();
    this.#buffer = gl.createBuffer();
  }

  /** A picture is on its way. */
  get isReading(): boolean {
    return this.#fence !== null;
  }

  /**
   * Starts to read a camera's picture, which lives in this animation frame only.
   *
   * @throws Error where the browser does not let it be read.
   */
  start(texture: WebGLTexture, size: Size): void {
    const { gl } = this;
    kept(gl, () => {
      this.#make(size);
      gl.disable(gl.SCISSOR_TEST);
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#source);
      attach(gl, texture);
      let from = size;
      this.#levels.forEach((level, k) => {
        const { width, height } = level;
        gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, level.framebuffer);
        // The last one turns the rows, which graphics cards count from below.
        const [bottom, top] = k === this.#levels.length - 1 ? [height, 0] : [0, height];
        const { COLOR_BUFFER_BIT, LINEAR } = gl;
        const onto = [0, bottom, width, top] as const;
        gl.blitFramebuffer(0, 0, from.width, from.height, ...onto, COLOR_BUFFER_BIT, LINEAR);
        gl.bindFramebuffer(gl.READ_FRAMEBUFFER, level.framebuffer);
        from = level;
      });
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
      gl.readPixels(0, 0, from.width, from.height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
      this.#fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.#source);
      attach(gl, null); // it must not be touched after this frame
    });
    gl.flush();
  }

  /** The picture that was started, once it is there; null before. */
  poll(): Pixels | null {
    const { gl } = this;
    if (!this.#fence) return null;
    const status = gl.clientWaitSync(this.#fence, 0, 0);
    if (status === gl.TIMEOUT_EXPIRED) return null;
    gl.deleteSync(this.#fence);
    this.#fence = null;
    const { width, height } = this.#levels.at(-1)!;
    const data = new Uint8ClampedArray(4 * width * height);
    kept(gl, () => {
      gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
      gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, data);
    });
    for (let i = 3; i < data.length; i += 4) data[i] = 255;
    return { width, height, data };
  }

  dispose(): void {
    const { gl } = this;
    if (this.#fence) gl.deleteSync(this.#fence);
    this.#fence = null;
    this.#forget();
    gl.deleteFramebuffer(this.#source);
    gl.deleteBuffer(this.#buffer);
  }

  #make(size: Size): void {
    const { gl } = this;
    if (size.width === this.#from.width && size.height === this.#from.height) return;
    this.#forget();
    this.#from = { width: size.width, height: size.height };
    this.#levels = halvings(size).map(({ width, height }) => {
      const [framebuffer, store] = [gl.createFramebuffer(), gl.createRenderbuffer()];
      gl.bindRenderbuffer(gl.RENDERBUFFER, store);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA8, width, height);
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, framebuffer);
      const [onto, place] = [gl.DRAW_FRAMEBUFFER, gl.COLOR_ATTACHMENT0];
      gl.framebufferRenderbuffer(onto, place, gl.RENDERBUFFER, store);
      return { width, height, framebuffer, store };
    });
    const last = this.#levels.at(-1)!;
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.#buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, 4 * last.width * last.height, gl.STREAM_READ);
  }

  #forget(): void {
    for (const { framebuffer, store } of this.#levels) {
      this.gl.deleteFramebuffer(framebuffer);
      this.gl.deleteRenderbuffer(store);
    }
    this.#levels = [];
  }
}

/** @throws Error where the browser does not let the texture be read. */
function attach(gl: WebGL2RenderingContext, texture: WebGLTexture | null): void {
  const [target, place] = [gl.READ_FRAMEBUFFER, gl.COLOR_ATTACHMENT0];
  gl.framebufferTexture2D(target, place, gl.TEXTURE_2D, texture, 0);
  if (texture && gl.checkFramebufferStatus(target) !== gl.FRAMEBUFFER_COMPLETE) {
    throw new Error("expected a camera picture that can be read");
  }
}

/** Leaves the context as it was: renderers remember what they have bound. */
function kept(gl: WebGL2RenderingContext, act: () => void): void {
  const read = gl.getParameter(gl.READ_FRAMEBUFFER_BINDING);
  const draw = gl.getParameter(gl.DRAW_FRAMEBUFFER_BINDING);
  const store = gl.getParameter(gl.RENDERBUFFER_BINDING);
  const buffer = gl.getParameter(gl.PIXEL_PACK_BUFFER_BINDING);
  const isCut = gl.isEnabled(gl.SCISSOR_TEST);
  try {
    act();
  } finally {
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, read);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, draw);
    gl.bindRenderbuffer(gl.RENDERBUFFER, store);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
    if (isCut) gl.enable(gl.SCISSOR_TEST);
  }
}

/** Fingers, mouse, wheel and keys that move, turn and scale what stands on the floor. */

export interface Movable {
  /** Stand where the floor is seen at (x, y), shares of the view's width and height. */
  standAt(x: number, y: number): void;
  /** Shows where it would stand; null hides that. */
  aim(place: readonly [number, number] | null): void;
  /** Where it stands now, in the same shares. */
  place(): readonly [number, number];
  /** Anticlockwise from above. */
  turnBy(angleRad: number): void;
  scaleBy(factor: number): void;
  /** Back to where and how it stood first. */
  reset(): void;
}

/** A finger that moves less and is gone sooner has tapped. */
const TAP_PX = 8;
const TAP_MS = 350;
const KEY_STEP = 0.02;
const KEY_TURN_RAD = Math.PI / 24;
const KEY_SCALE = 1.06;

interface Point {
  readonly x: number;
  readonly y: number;
}

export class Gestures {
  private readonly pointers = new Map<number, Point>();
  /** From the finger to the object's foot, so that it does not jump when it is taken. */
  private grip: Point = { x: 0, y: 0 };
  /** Where and when a single finger came down; null once it can be no tap any more. */
  private tap: { readonly x: number; readonly y: number; readonly ms: number } | null = null;

  constructor(
    private readonly view: HTMLElement,
    private readonly movable: Movable,
  ) {
    view.addEventListener("pointerdown", this.down);
    view.addEventListener("pointermove", this.move);
    for (const end of ["pointerup", "pointercancel"] as const) view.addEventListener(end, this.up);
    view.addEventListener("pointerleave", () => this.movable.aim(null));
    view.addEventListener("wheel", this.wheel, { passive: false });
    view.addEventListener("keydown", this.key);
  }

  private readonly down = (event: PointerEvent): void => {
    if (event.button !== 0) return;
    this.view.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, this.at(event));
    const mayTap = this.pointers.size === 1 && !event.defaultPrevented;
    this.tap = mayTap ? { x: event.clientX, y: event.clientY, ms: event.timeStamp } : null;
    this.takeHold();
  };

  private readonly move = (event: PointerEvent): void => {
    const before = this.pointers.get(event.pointerId);
    if (!before) {
      this.hover(event);
      return;
    }
    if (this.tap && Math.hypot(event.clientX - this.tap.x, event.clientY - this.tap.y) < TAP_PX)
      return;
    this.tap = null;
    const now = this.at(event);
    const other = this.others(event.pointerId)[0];
    this.pointers.set(event.pointerId, now);
    if (other) this.pinch(other, before, now);
    else {
      const to = [now.x + this.grip.x, now.y + this.grip.y] as const;
      this.movable.standAt(...to);
      this.movable.aim(to);
    }
  };

  /** A mouse shows where a click would place it. */
  private hover(event: PointerEvent): void {
    if (event.pointerType !== "mouse") return;
    const { x, y } = this.at(event);
    this.movable.aim([x, y]);
  }

  private readonly up = (event: PointerEvent): void => {
    const { tap } = this;
    this.pointers.delete(event.pointerId);
    this.tap = null;
    this.movable.aim(null);
    if (tap && event.type === "pointerup" && event.timeStamp - tap.ms < TAP_MS) {
      const { x, y } = this.at(event);
      this.movable.standAt(x, y);
    }
    this.takeHold(); // of the finger that is left
  };

  private takeHold(): void {
    const [finger] = this.pointers.values();
    const [x, y] = this.movable.place();
    if (finger) this.grip = { x: x - finger.x, y: y - finger.y };
  }

  private pinch(still: Point, before: Point, now: Point): void {
    const { width, height } = this.view.getBoundingClientRect();
    const arm = (to: Point): Point => ({
      x: (to.x - still.x) * width,
      y: (to.y - still.y) * height,
    });
    const [from, to] = [arm(before), arm(now)];
    const [short, long] = [Math.hypot(from.x, from.y), Math.hypot(to.x, to.y)];
    if (short < 1 || long < 1) return;
    this.movable.scaleBy(long / short);
    const twist = Math.atan2(from.x * to.y - from.y * to.x, from.x * to.x + from.y * to.y);
    this.movable.turnBy(-twist); // the screen's y points down
  }

  private readonly wheel = (event: WheelEvent): void => {
    event.preventDefault();
    if (event.shiftKey) this.movable.turnBy((event.deltaX + event.deltaY) / 300);
    else this.movable.scaleBy(Math.exp(-event.deltaY / 500));
  };

  private readonly key = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const action = this.keys[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  };

  private readonly keys: Readonly<Record<string, () => void>> = {
    ArrowLeft: () => this.step(-KEY_STEP, 0),
    ArrowRight: () => this.step(KEY_STEP, 0),
    ArrowUp: () => this.step(0, -KEY_STEP),
    ArrowDown: () => this.step(0, KEY_STEP),
    q: () => this.movable.turnBy(-KEY_TURN_RAD),
    e: () => this.movable.turnBy(KEY_TURN_RAD),
    "+": () => this.movable.scaleBy(KEY_SCALE),
    "=": () => this.movable.scaleBy(KEY_SCALE),
    "-": () => this.movable.scaleBy(1 / KEY_SCALE),
    Home: () => this.movable.reset(),
  };

  private step(x: number, y: number): void {
    const [fromX, fromY] = this.movable.place();
    this.movable.standAt(fromX + x, fromY + y);
  }

  private others(id: number): Point[] {
    return [...this.pointers].filter(([other]) => other !== id).map(([, point]) => point);
  }

  private at(event: PointerEvent): Point {
    const { left, top, width, height } = this.view.getBoundingClientRect();
    return { x: (event.clientX - left) / width, y: (event.clientY - top) / height };
  }
}

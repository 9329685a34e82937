/** A part of the screen, in pixels. */
export interface ScreenBox {
  readonly left: number;
  readonly top: number;
  readonly right: number;
  readonly bottom: number;
}

const MARGIN_PX = 12;
/** Of the view's side it moves at most: what else is in the picture stays in sight. */
const MOST = 0.3;

/**
 * How far to move a view up or to the left, in pixels, so that a panel below or on the right does not cover an object in
 * it: the shorter way of the two.
 */
export function movedClear(
  object: ScreenBox,
  panel: ScreenBox,
  view: ScreenBox,
): readonly [left: number, up: number] {
  const [left, up] = [object.right + MARGIN_PX - panel.left, object.bottom + MARGIN_PX - panel.top];
  const isClear = Math.min(left, up) <= 0 || object.left > panel.right || object.top > panel.bottom;
  if (isClear) return [0, 0];
  return left < up
    ? [Math.min(left, MOST * (view.right - view.left)), 0]
    : [0, Math.min(up, MOST * (view.bottom - view.top))];
}

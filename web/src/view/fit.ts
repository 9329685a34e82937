/** Where a picture lies on the screen, and the camera that took it. */

export interface Size {
  readonly width: number;
  readonly height: number;
}

/** The box on the screen in CSS pixels, and which part of the picture it shows. */
export interface Fit extends Size {
  readonly left: number;
  readonly top: number;
  /** Shares of the picture's width and height that are visible, around its centre. */
  readonly share: Size;
  /** Of the box, so that drawn objects have the picture's own perspective. */
  readonly verticalFovRad: number;
}

/** A picture that would lose more than this is shown whole instead. */
const LEAST_VISIBLE = 0.55;

/**
 * Fill the screen with the picture, or show it whole where filling would hide too much.
 *
 * @param focalPx the picture's focal length, in its own pixels.
 */
export function fitOn(screen: Size, picture: Size, focalPx: number): Fit {
  const across = screen.width / picture.width;
  const down = screen.height / picture.height;
  const [less, more] = [Math.min(across, down), Math.max(across, down)];
  const scale = less / more >= LEAST_VISIBLE ? more : less;
  const width = Math.min(screen.width, picture.width * scale);
  const height = Math.min(screen.height, picture.height * scale);
  return {
    width,
    height,
    left: (screen.width - width) / 2,
    top: (screen.height - height) / 2,
    share: { width: width / (picture.width * scale), height: height / (picture.height * scale) },
    verticalFovRad: 2 * Math.atan(height / 2 / (focalPx * scale)),
  };
}

/** Focal length in pixels of a camera whose picture is `height` pixels high. */
export function focalLength(height: number, verticalFovRad: number): number {
  return height / 2 / Math.tan(verticalFovRad / 2);
}

/** Vertical field of view of a picture whose long side spans `longSideFovRad`. */
export function verticalFov(picture: Size, longSideFovRad: number): number {
  const focalPx = focalLength(Math.max(picture.width, picture.height), longSideFovRad);
  return 2 * Math.atan(picture.height / 2 / focalPx);
}

/** Photos to try, from examples/photos (CC0, see LICENSES.md there), filmed at a known tilt. */
const TILT_RAD = (-12 * Math.PI) / 180;

export interface Example {
  readonly name: string;
  readonly url: URL;
  readonly tiltRad: number;
}

export const EXAMPLES: readonly Example[] = [
  {
    name: "an old canteen",
    url: new URL("../../../examples/photos/canteen.jpg", import.meta.url),
    tiltRad: TILT_RAD,
  },
  {
    name: "a museum hall",
    url: new URL("../../../examples/photos/hall.jpg", import.meta.url),
    tiltRad: TILT_RAD,
  },
  {
    name: "a meadow",
    url: new URL("../../../examples/photos/meadow.jpg", import.meta.url),
    tiltRad: TILT_RAD,
  },
];

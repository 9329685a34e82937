/** What a session has seen as a file: the .npz of session.py, so Python goes on where a page ended, and back. */
import { FUSE } from "../contract/generated.ts";
import { Session } from "../fuse/session.ts";
import type { View } from "../fuse/view.ts";
import type { Matrix3x3 } from "../light/matrix.ts";
import { type NumpyArray, npzArrays, npzFile } from "./npz.ts";

const floats = (shape: readonly number[], values: readonly number[]): NumpyArray => ({
  shape,
  values: Float64Array.from(values),
});
const whole = (shape: readonly number[], ...values: number[]): NumpyArray => ({
  shape,
  values: BigInt64Array.from(values, BigInt),
});

/** @throws RangeError where nothing has been added. */
export function sessionFile(session: Session): Uint8Array<ArrayBuffer> {
  const { views, places, mostViews, count, strange, unit, firstTurn } = session.state;
  if (!views[0]) throw new RangeError("expected a frame, got none: add one first");
  const n = views.length;
  const size = Math.sqrt(views[0].logEstimate.length / 3);
  const estimates = new Float32Array(3 * size * size * n);
  views.forEach((view, k) => {
    estimates.set(view.logEstimate, 3 * size * size * k);
  });
  const pictures = views.map(({ height, width, pixels }, k) => {
    return [`pixels_${k}`, { shape: [height, width, 3], values: pixels }] as const;
  });
  return npzFile({
    version: whole([], FUSE.VERSION),
    vertical_fov_rad: floats([], [views[0].verticalFovRad]),
    most_views: whole([], mostViews),
    count: whole([2], count, strange),
    unit: floats([3], unit),
    first_turn: floats([3, 3], firstTurn),
    rotations: floats(
      [n, 3, 3],
      views.flatMap(({ worldFromCamera }) => [...worldFromCamera]),
    ),
    places: floats(
      [n, 3, 3],
      places.flatMap((place) => [...place]),
    ),
    estimates: { shape: [n, size, size, 3], values: estimates },
    // No camera says its exposure to a page.
    exposures: floats(
      [n, 3],
      views.flatMap((view) => [Number.NaN, view.number, view.verticalFovRad]),
    ),
    ...Object.fromEntries(pictures),
  });
}

/** @throws RangeError that says what is wrong with the file. */
export function sessionOf(file: Uint8Array): Session {
  const arrays = npzArrays(file);
  const numbers = (name: string, ...shape: number[]): number[] => {
    const array = arrays.get(name);
    if (!array || String(array.shape) !== String(shape)) {
      throw new RangeError(`expected a session of deeplight, got a file without ${name}`);
    }
    return Array.from(array.values as ArrayLike<number | bigint>, Number);
  };
  const [version] = numbers("version");
  if (version !== FUSE.VERSION) throw new RangeError(`a session of version ${version}`);
  const n = arrays.get("rotations")?.shape[0] ?? 0;
  if (n === 0 || n > FUSE.MOST_VIEWS + 1) throw new RangeError(`a session of ${n} views`);
  const size = arrays.get("estimates")?.shape[1] ?? 0;
  const [rotations, estimates] = [
    numbers("rotations", n, 3, 3),
    numbers("estimates", n, size, size, 3),
  ];
  const exposures = numbers("exposures", n, 3);
  // Files of before have none.
  const opened = arrays.has("places") ? numbers("places", n, 3, 3) : rotations;
  const matrix = (values: number[]) => values as unknown as Matrix3x3;
  const views = Array.from({ length: n }, (_, k): View => {
    const picture = arrays.get(`pixels_${k}`);
    const [height = 0, width = 0, colours] = picture?.shape ?? [];
    const isPicture = picture?.values instanceof Uint8Array && colours === 3 && height * width > 0;
    if (!isPicture) throw new RangeError(`view ${k} is no picture`);
    return {
      pixels: picture.values as Uint8Array,
      height,
      width,
      number: exposures[3 * k + 1]!,
      verticalFovRad: exposures[3 * k + 2]!,
      worldFromCamera: matrix(rotations.slice(9 * k, 9 * k + 9)),
      logEstimate: Float32Array.from(
        estimates.slice(3 * size * size * k, 3 * size * size * (k + 1)),
      ),
    };
  });
  const [count, strange] = numbers("count", 2) as [number, number];
  const [red, green, blue] = numbers("unit", 3) as [number, number, number];
  const [mostViews] = numbers("most_views") as [number];
  const firstTurn = matrix(numbers("first_turn", 3, 3));
  const unit = [red, green, blue] as const;
  const places = views.map((_, k) => matrix(opened.slice(9 * k, 9 * k + 9)));
  return Session.restored({ mostViews, count, strange, unit, firstTurn, views, places });
}

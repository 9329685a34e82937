"""A photo in, the light of its scene out: `deeplight.estimate(photo)`."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deeplight.environment import Environment
from deeplight.errors import ImageFileError, InputError

if TYPE_CHECKING:
    from deeplight.estimators.fill import Fill
    from deeplight.estimators.network import NetworkEstimator

BATCH = 16
"""Photos that the network sees at once; more make it no faster."""

_default: list["NetworkEstimator"] = []


def estimate(
    photo: Any, fov_deg: float | None = None, height: int = 256, *, fill: "Fill | None" = "auto"
) -> Environment:
    """Estimate the light of a photo with the shipped model.

    Where the camera looked, the environment is the photo itself; elsewhere it is the network's
    estimate. The first call loads the model, later ones reuse it.

    Args:
        photo: a file's path, its bytes or an open file, a Pillow image, pixels (height, width[,
            channels]; grey, RGB or RGBA; uint8, uint16 or float in [0, 1]; gamma-encoded), or a
            torch tensor of such pixels, channels first.
        fov_deg: vertical field of view of the upright photo in degrees. Left out, it is taken from
            EXIF data, and without those the long side is assumed to span 66 degrees.
        height: rows of the environment, 64 to 2048.
        fill: what reflections show where the photo does not look: "photo", its own rows going on to
            both sides; "indoor", "outdoor" or "any", detail of a real place of that kind over them;
            "auto", of the kind that the network is sure of, else "photo"; None leaves it smooth.
            The power of the light stays the same.

    Returns:
        Radiance from all directions relative to the camera's white, in the photo's camera frame:
        +X right, +Y up, -Z the view. `.lighting` is the same on the 32 x 32 mirror ball, `.lamps`
        are the compact lights in it, `.seen` is what the photo showed.

    Raises:
        InputError: the photo cannot be used, or the model is missing.
        OSError: the file cannot be read.

    Examples:
        >>> grey = np.full((240, 180, 3), 128, np.uint8)
        >>> environment = deeplight.estimate(grey, fov_deg=66)
        >>> environment.radiance.shape, environment.unit
        ((256, 512, 3), 'camera_white')
        >>> bool(abs(environment.radiance[128, 256] - (128 / 255) ** 2.2).max() < 0.01)
        True
    """
    (environment,) = _environments(load_estimator(), [photo], fov_deg, height, fill)
    return environment


def estimate_many(
    photos: Iterable[Any],
    fov_deg: float | None = None,
    height: int = 256,
    *,
    estimator: "NetworkEstimator | None" = None,
    progress: Callable[[int], None] = lambda done: None,
    on_error: Callable[[int, InputError | OSError], None] | None = None,
) -> list[Environment | None]:
    """Estimate the light of many photos; the network sees several at once.

    Args:
        photos: as `estimate` takes them; read one after the other.
        fov_deg: as for `estimate`, the same for all.
        height: as for `estimate`, the same for all.
        estimator: of `load_estimator`; left out, the shipped model.
        progress: called with the number of photos done.
        on_error: called with the number of a photo that cannot be used, from 0, and the reason; its
            place in the result is None. Left out, the first such photo ends the call.

    Returns:
        One environment for each photo, in their order.

    Raises:
        InputError, OSError: a photo cannot be used, and there is no `on_error`.
    """
    from deeplight.estimators.environment import pixels_for
    from deeplight.io.photo_like import as_photo

    network = estimator or load_estimator()
    results: list[Environment | None] = []
    batch: list[tuple[int, Any]] = []

    def finish() -> None:
        lights = _environments(network, [opened for _, opened in batch], fov_deg, height)
        for (number, _), light in zip(batch, lights, strict=True):
            results[number] = light
        batch.clear()
        progress(len(results))

    for number, photo in enumerate(photos):
        results.append(None)
        try:
            batch.append((number, as_photo(photo, pixels_for(height))))
        except (InputError, OSError) as error:
            if on_error is None:
                raise
            on_error(number, error)
        if len(batch) == BATCH:
            finish()
    if batch:
        finish()
    return results


def estimate_file(
    path: Path, fov_deg: float | None = None, height: int | None = None
) -> tuple[Environment, tuple[str, ...]]:
    """The light that `deeplight estimate` writes of a photo's file, and what the user should know.

    Unlike `estimate` it places the sun by EXIF data, where the photo has them.

    Args:
        path: of the photo.
        fov_deg: as for `estimate`.
        height: rows of the environment, 64 to 2048; left out, 256.

    Raises:
        InputError: the photo cannot be used; with no field of view also one twice as wide as high,
            which is more likely a panorama.
        OSError: the file cannot be read.
    """
    from deeplight.estimators.confidence import warnings_of
    from deeplight.estimators.environment import HEIGHT, check_height, pixels_for
    from deeplight.estimators.sun import scene_in_sun
    from deeplight.estimators.tilt import tilt_of_estimate
    from deeplight.io.photos import read_photo

    rows = height or HEIGHT
    check_height(rows)
    photo = read_photo(path, pixels_for(rows))
    high, wide = photo.full_size
    if fov_deg is None and wide >= 2 * high:
        got = f"{path} of {wide} x {high}, as panoramas are"
        raise ImageFileError("a photo", got, "name the field of view if it is a photo")
    explained = load_estimator().explain(photo, fov_deg)
    tilt, doubts = tilt_of_estimate(explained)
    scene, sun = scene_in_sun(explained, height=rows, tilt=tilt)
    notes = (*warnings_of(photo.pixels), *explained.notes, *doubts)
    return scene.environment, notes if sun is None else (*notes, sun.note)


def load_estimator(model: Any = None, threads: int | None = None) -> "NetworkEstimator":
    """The estimator of a model; see `deeplight.estimators.open.open_model`.

    Args:
        model: a .onnx or .tflite file, "package.module:Class" or the name of an entry point in
            `deeplight.estimators`; left out, the shipped model, loaded once for the whole process.
        threads: cores the network may use; left out, all that this process has, at most 4.

    Raises:
        InputError: the model cannot be used.
    """
    # Here, so that `import deeplight` loads neither onnxruntime nor the model.
    from deeplight.estimators.open import open_model

    if model is not None or threads is not None:
        return open_model(model, threads)
    if not _default:
        _default.append(open_model())
    return _default[0]


def _environments(
    network: "NetworkEstimator",
    photos: list[Any],
    fov_deg: float | None,
    height: int,
    fill: "Fill | None" = "auto",
) -> list[Environment]:
    from deeplight.estimators.environment import check_height, pixels_for, scene_light
    from deeplight.io.photo_like import as_photo

    check_height(height)
    opened = [as_photo(photo, pixels_for(height)) for photo in photos]
    explained = network.explain_many(opened, fov_deg)
    return [scene_light(estimate, height, fill).environment for estimate in explained]

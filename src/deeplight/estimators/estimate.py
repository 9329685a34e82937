"""A photo in, the light of its scene out: `deeplight.estimate(photo)`."""

from typing import TYPE_CHECKING, Any

from deeplight.lighting import Lighting

if TYPE_CHECKING:
    from deeplight.estimators.onnx import OnnxEstimator

_default: list["OnnxEstimator"] = []


def estimate(photo: Any, fov_deg: float | None = None) -> Lighting:
    """Estimate the light of a photo with the shipped model.

    The first call loads the model, later ones reuse it.

    Args:
        photo: a file's path, a Pillow image or upright RGB pixels, (height, width, 3), uint8 or
            float in [0, 1], gamma-encoded.
        fov_deg: vertical field of view of the upright photo in degrees. Left out, it is taken from
            the file's EXIF data, and without those the long side is assumed to span 66 degrees.

    Returns:
        Radiance from all directions relative to the camera's white, in the photo's camera frame:
        +X right, +Y up, -Z the view.

    Raises:
        InputError: the photo cannot be used, or the model is missing.
        OSError: the file cannot be read.

    >>> lighting = deeplight.estimate("photo.jpg")  # doctest: +SKIP
    >>> lighting.latlong().shape  # doctest: +SKIP
    (256, 512, 3)
    """
    return default_estimator().estimate(photo, fov_deg)


def default_estimator() -> "OnnxEstimator":
    """Give the estimator of the shipped model, loaded once for the whole process."""
    if not _default:
        # Here, so that `import deeplight` loads neither onnxruntime nor the model.
        from deeplight.estimators.onnx import OnnxEstimator

        _default.append(OnnxEstimator())
    return _default[0]

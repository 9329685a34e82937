"""The three-sphere protocol of StyleLight (ECCV 2022) and DiffusionLight (CVPR 2024).

Wang, Yang, Loy and Liu, "StyleLight: HDR Panorama Generation for Lighting Estimation and Editing",
and Phongthawee et al., "DiffusionLight: Light Probes for Free by Painting a Chrome Ball", compare
spheres rendered in Blender under predicted and true panoramas. What their released evaluation does
(Wanggcong/StyleLight and DiffusionLight/DiffusionLight-evaluation) and the text does not say: the
*panoramas* are tone-mapped before rendering, squares are summed over the colour channels, angles of
black pixels count as 0, percentiles are taken over the whole picture. `AS_PUBLISHED` does all
that; `CORRECTED` keeps light linear, averages over channels, leaves black pixels out and looks
where the photo's camera looks. The two, and our own metrics, are three different numbers.

Light is the 32 x 32 mirror ball on both sides, where they render 128 x 256 panoramas.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float64

from deeplight.brdf import lambertian, rough_specular
from deeplight.camera_response import LUMINANCE
from deeplight.evaluate.scores import TRUE_LIGHTING, Column, Report
from deeplight.frames import looking_at
from deeplight.mappings import latlong, mirror_ball
from deeplight.sphere import SPHERES, SphereView

GAMMA, MEDIAN = 2.4, 0.5
CAMERA = (0.0, 16.0, 2.0)  # their camera: across, back and up from a sphere of radius 1
PICTURE_SHARE = 0.120  # of the sphere in their 1920 x 1080 picture through an 85 mm lens
PERCENTILES = (0.01, 99.9)
BATCH = 64

Radiances = Float[np.ndarray, "examples light light 3"]
Images = Float[np.ndarray, "examples pixels 3"]


@dataclass(frozen=True)
class Form:
    """One way to compute the protocol.

    Attributes:
        name: what tables call it.
        published: do what the released code does, instead of what the text means.
    """

    name: str
    published: bool


AS_PUBLISHED = Form("as_published", True)
CORRECTED = Form("corrected", False)
FORMS = (AS_PUBLISHED, CORRECTED)


def three_spheres(report: Report, form: Form) -> dict[str, dict[str, Column]]:
    """Measure every estimator of a report; empty where the true light is not known.

    Returns:
        By estimator, then by metric and sphere: `angular_deg_mirror`, `si_rmse_mirror`,
        `rmse_mirror`, `normalised_rmse_mirror` and so on.
    """
    if TRUE_LIGHTING not in report.log_radiance:
        return {}
    true = report.log_radiance[TRUE_LIGHTING]
    found: dict[str, dict[str, Column]] = {}
    for name, answers in report.log_radiance.items():
        parts = [
            compared(
                np.exp(answers[start : start + BATCH]), np.exp(true[start : start + BATCH]), form
            )
            for start in range(0, len(answers), BATCH)
        ]
        if name != TRUE_LIGHTING:
            found[name] = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    return found


def compared(estimated: Radiances, true: Radiances, form: Form) -> dict[str, Column]:
    """All metrics of lightings against the true ones."""
    if form.published:
        shown, wanted = tone_mapped(estimated), tone_mapped(true)
    else:
        gain = (MEDIAN / np.maximum(_medians(true @ LUMINANCE), 1e-12))[:, None, None, None]
        shown, wanted = estimated * gain, true * gain
    found = {}
    for sphere in SPHERES:
        a, b = _rendered(sphere, shown, form), _rendered(sphere, wanted, form)
        for metric, values in _metrics(a, b, form).items():
            found[f"{metric}_{sphere}"] = values
    return found


def tone_mapped(radiance: Radiances) -> Radiances:
    """x^(1 / 2.4), scaled so that the median of the lit values is 0.5: each light by itself.

    The median is that of a latlong picture's pixels, of which the poles have too many. So neither
    brightness nor the ratio of the sun to the sky is left as it was.
    """
    encoded = np.maximum(radiance, 0) ** (1 / GAMMA)
    weights = np.repeat(_latlong_pixels(radiance.shape[1]), 3)
    scale = [
        MEDIAN / (_weighted_median(values[values > 0], weights[values > 0]) + 1e-10)
        for values in encoded.reshape(len(encoded), -1)
    ]
    result: Radiances = encoded * np.array(scale)[:, None, None, None]
    return result


def _metrics(a: Images, b: Images, form: Form) -> dict[str, Column]:
    pixels = a.shape[1] if form.published else 3 * a.shape[1]
    aa, ab, bb = ((x * y).sum((1, 2)) for x, y in ((a, a), (a, b), (b, b)))
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled = np.sqrt(np.maximum(bb - ab**2 / aa, 0) / pixels)  # at the best one scale
    return {
        "angular_deg": _angles(a, b, form),
        "si_rmse": scaled,
        "rmse": np.sqrt(((a - b) ** 2).sum((1, 2)) / pixels),
        "normalised_rmse": np.sqrt(
            ((_normalised(a, form) - _normalised(b, form)) ** 2).sum((1, 2)) / pixels
        ),
    }


def _angles(a: Images, b: Images, form: Form) -> Column:
    lengths = np.linalg.norm(a, axis=2) * np.linalg.norm(b, axis=2)
    black = lengths == 0
    cosine = np.clip((a * b).sum(2) / np.where(black, 1, lengths), 0, 1)
    angles = np.where(black, 0.0, np.degrees(np.arccos(cosine)))
    counted = np.full(len(a), a.shape[1]) if form.published else (~black).sum(1)
    with np.errstate(invalid="ignore"):
        mean: Column = np.where(counted > 0, angles.sum(1) / np.maximum(counted, 1), np.nan)
    return mean


def _normalised(pictures: Images, form: Form) -> Images:
    """0.01 and 99.9 percentile brought to 0 and 1; as published, of a picture mostly background."""
    low, high = PERCENTILES
    values = pictures.reshape(len(pictures), -1)
    if form.published:  # the lower percentile then is the black around the sphere
        bottom = np.zeros(len(values))
        top = np.percentile(values, 100 - (100 - high) / PICTURE_SHARE, axis=1)
    else:
        bottom, top = np.percentile(values, (low, high), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        result: Images = (pictures - bottom[:, None, None]) / (top - bottom)[:, None, None]
    return result


def _rendered(sphere: str, radiance: Radiances, form: Form) -> Images:
    count, size = len(radiance), radiance.shape[1]
    columns = radiance.astype(np.float32).transpose(1, 2, 0, 3).reshape(size * size, count * 3)
    pixels = _weights(sphere, size, form.published) @ columns
    return pixels.reshape(-1, count, 3).transpose(1, 0, 2).astype(np.float64)


@lru_cache(maxsize=12)
def _weights(sphere: str, light_size: int, published: bool) -> Float[np.ndarray, "pixels lights"]:
    """One sphere of theirs under each pixel of light; the pixels that show nothing but sphere.

    Blender's principled shader as they set it: base colour 0.8; the mirror and the matte silver
    metallic with roughness 0 and 0.3271, the diffuse one with a clear coat of roughness 0.364 and
    4 % at normal incidence. Lambert stands for Blender's diffuse term.
    """
    view = _view(published)
    shown = view.mask().ravel()
    normals, views = (
        values.reshape(-1, 3)[shown].astype(np.float32) for values in (view.normals(), view.views())
    )
    if sphere == "mirror":
        weights = _mirror(view, light_size)[shown]
        return (weights * _schlick(0.8, (normals * views).sum(1))[:, None]).astype(np.float32)
    directions, solid_angle = _light_samples(light_size)
    n_l, l_v = normals @ directions.T, views @ directions.T
    n_v = (normals * views).sum(1, keepdims=True)
    half = np.sqrt(np.maximum((1 + l_v) / 2, 0))  # cosine of light and half vector
    if sphere == "matte_silver":
        weights = rough_specular(n_l, n_v, l_v, 0.3271**2) * _schlick(0.8, half)
    else:
        weights = 0.8 * lambertian(n_l)
        weights = weights + rough_specular(n_l, n_v, l_v, 0.364**2) * _schlick(0.04, half)
    weights = (weights * solid_angle).reshape(len(normals), light_size**2, -1).sum(2)
    return weights.astype(np.float32)


def _view(published: bool) -> SphereView:
    """Their camera looks down at the sphere, towards the panorama's left quarter."""
    _, back, up = CAMERA
    distance = np.hypot(back, up)
    ahead = np.array([-back, -up, 0.0]) if published else np.array([0.0, 0.0, -1.0])
    return SphereView(looking_at(ahead / np.linalg.norm(ahead)), float(np.arcsin(1 / distance)))


def _mirror(view: SphereView, light_size: int) -> Float64[np.ndarray, "pixels lights"]:
    fine = 4
    light = mirror_ball.pixel_of_directions(view.reflected(fine), light_size).ravel()
    row, column = np.divmod(np.arange(len(light)), view.size * fine)
    pixel = row // fine * view.size + column // fine
    counts = np.bincount(pixel * light_size**2 + light, minlength=view.size**2 * light_size**2)
    return counts.reshape(view.size**2, -1) / fine**2


def _light_samples(light_size: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions spread over every pixel of light, and the solid angle of each."""
    directions, inside = mirror_ball.subpixels(light_size, 2)
    share = inside / np.maximum(inside.sum(1, keepdims=True), 1)
    solid_angle = share * mirror_ball.solid_angles(light_size).reshape(-1, 1)
    return directions.reshape(-1, 3).astype(np.float32), solid_angle.ravel().astype(np.float32)


def _schlick(at_normal: float, cosine: np.ndarray) -> np.ndarray:
    """Fresnel reflection of a surface that reflects `at_normal` seen straight on (Schlick 1994)."""
    result: np.ndarray = at_normal + (1 - at_normal) * (1 - np.clip(cosine, 0, 1)) ** 5
    return result


@lru_cache(maxsize=4)
def _latlong_pixels(size: int) -> Float64[np.ndarray, " lights"]:
    """How many pixels of a 128 x 256 panorama each pixel of the ball stands for."""
    pixel = mirror_ball.pixel_of_directions(latlong.directions(128, 256), size)
    return np.bincount(pixel.ravel(), minlength=size * size).astype(np.float64)


def _medians(
    luminance: Float[np.ndarray, "examples light light"],
) -> Float64[np.ndarray, " examples"]:
    weights = mirror_ball.solid_angles(luminance.shape[1]).ravel()
    rows = luminance.reshape(len(luminance), -1)
    return np.array([_weighted_median(row, weights) for row in rows])


def _weighted_median(values: np.ndarray, weights: np.ndarray) -> float:
    if not weights.sum() > 0:
        return 0.0
    order = np.argsort(values)
    running = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(running, running[-1] / 2)])


def summed_up(found: Mapping[str, Mapping[str, Column]]) -> list[tuple[str, str, float, int]]:
    """Estimator, metric, mean over the examples where it is defined, and how many have none."""
    rows = []
    for estimator, metrics in found.items():
        for metric, values in metrics.items():
            defined = np.isfinite(values)
            mean = float(values[defined].mean()) if defined.any() else float("nan")
            rows.append((estimator, metric, mean, int((~defined).sum())))
    return rows

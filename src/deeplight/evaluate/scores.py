"""What an evaluation finds, example by example: scores, and the report of all estimators."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int64, Shaped

from deeplight.camera_response import decode, encode, soft_clip
from deeplight.evaluate.metrics import (
    angular_error_rgb,
    masked_l1,
    mirror_detail,
    relative_radiance_error,
)
from deeplight.reflectance import ReflectanceBasis
from deeplight.sphere import LOSS_WEIGHTS, SPHERES

TRUE_LIGHTING = "true_lighting"  # what the metrics give for the very light that was filmed

CHANNELS = ("red", "green", "blue")

LogRadiance = Float32[np.ndarray, "examples light light 3"]
Column = Float64[np.ndarray, " examples"]


@dataclass(frozen=True, eq=False)
class Scores:
    """One estimator on every example; NaN where a metric is not defined.

    Attributes:
        l1: masked L1 of pixel values, by sphere.
        theta_rgb_deg: mean angle of the linear diffuse colours.
        relative_radiance: (predicted - filmed) / filmed of the linear diffuse sphere, per channel.
        black_pixels: pixels without a colour, left out of `theta_rgb_deg`.
        more: further columns, by name: the mirror's detail, and where the true light is known the
            errors against it.
    """

    l1: Mapping[str, Column]
    theta_rgb_deg: Column
    relative_radiance: Float64[np.ndarray, "examples 3"]
    black_pixels: Int64[np.ndarray, " examples"]
    more: Mapping[str, Column] = field(default_factory=dict)

    def metrics(self) -> dict[str, Column]:
        """Give every metric as a column, by name."""
        columns = {f"l1_{name}": self.l1[name] for name in SPHERES}
        columns["theta_rgb_deg"] = self.theta_rgb_deg
        for channel, name in enumerate(CHANNELS):
            columns[f"radiance_{name}"] = self.relative_radiance[:, channel]
        columns["radiance_absolute"] = np.abs(self.relative_radiance).mean(1)
        for name, values in self.more.items():
            columns[name] = values
            if name.endswith("_stops"):
                columns[f"{name}_absolute"] = np.abs(values)
        return columns

    def reconstruction_loss(self) -> Column:
        """L_rec: the weighted sum of the L1 of the three spheres (section 3.4)."""
        loss: Column = sum(
            (LOSS_WEIGHTS[name] * self.l1[name] for name in SPHERES),
            np.zeros(len(self.black_pixels)),
        )
        return loss


@dataclass(frozen=True, eq=False)
class Report:
    """Estimators measured on one split.

    Attributes:
        split: the split or group of splits.
        numbers: of each example in `data.index(split)`.
        keys, places, scenes: of each example.
        diffuse_clipped: part of the filmed diffuse sphere's values that are 255, per example:
            there `relative_radiance` is too large.
        scores: by estimator, in the order they were given.
        true_radiance: luminance of the true light, averaged over all directions; NaN where the
            example does not give it.
        takes, frames: which clip each example is from, and where in it.
        world_from_camera: how the camera was held; NaN where the example does not give it.
        log_radiance: what each estimator answered, by its name; sizes differ between estimators.
            May lie on disk.
    """

    split: str
    numbers: Int64[np.ndarray, " examples"]
    keys: tuple[str, ...]
    places: Shaped[np.ndarray, " examples"]
    scenes: Shaped[np.ndarray, " examples"]
    diffuse_clipped: Column
    scores: Mapping[str, Scores]
    true_radiance: Column
    takes: Shaped[np.ndarray, " examples"]
    frames: Int64[np.ndarray, " examples"]
    world_from_camera: Float64[np.ndarray, "examples 3 3"]
    log_radiance: Mapping[str, np.ndarray] = field(default_factory=dict)

    def inside(self, scene: str) -> Bool[np.ndarray, " examples"]:
        """The examples of a kind of scene; "both" is all of them."""
        return np.full(len(self.keys), True) if scene == "both" else self.scenes == scene


def rendered_radiance(
    bases: Mapping[str, ReflectanceBasis], log_radiance: LogRadiance
) -> dict[str, Float32[np.ndarray, "examples size size 3"]]:
    """Render each sphere in each lighting (equation 2): linear radiance, not clipped."""
    count, lights = len(log_radiance), log_radiance.shape[1] ** 2
    with np.errstate(over="ignore"):  # infinite light shows as NaN scores
        radiance = np.exp(log_radiance.astype(np.float32)).reshape(count, lights, 3)
    columns = radiance.transpose(1, 0, 2).reshape(lights, count * 3)
    spheres = {}
    for name, basis in bases.items():
        size = basis.view.size
        with np.errstate(invalid="ignore"):
            rendered = (basis.weights @ columns).reshape(size, size, count, 3)
        spheres[name] = np.ascontiguousarray(rendered.transpose(2, 0, 1, 3))
    return spheres


def score(
    radiance: Mapping[str, Float[np.ndarray, "examples size size 3"]],
    filmed: Mapping[str, Float[np.ndarray, "examples size size 3"]],
    bases: Mapping[str, ReflectanceBasis],
    more: Mapping[str, Column] | None = None,
) -> Scores:
    """Compare rendered linear spheres with filmed pixel values (0 to 1).

    L1, theta_rgb and the mirror's detail see the rendered sphere as the camera would show it,
    clipped; the relative radiance error sees its whole radiance.

    Args:
        more: further columns to keep with these.
    """
    masks = {name: bases[name].view.mask() for name in SPHERES}
    with np.errstate(invalid="ignore"):  # NaN stays NaN, and is counted by who averages
        clipped = {name: soft_clip(radiance[name]) for name in SPHERES}
        shown = {name: encode(clipped[name]) for name in SPHERES}
    l1 = {name: masked_l1(shown[name], filmed[name], masks[name]) for name in SPHERES}
    diffuse, mask = decode(filmed["diffuse"]), masks["diffuse"]
    angle = angular_error_rgb(np.maximum(clipped["diffuse"], 0), diffuse, mask)
    relative = relative_radiance_error(radiance["diffuse"], diffuse, mask)
    detail = mirror_detail(shown["mirror"], filmed["mirror"], masks["mirror"])
    columns = {"mirror_detail": detail, **(more or {})}
    return Scores(l1, angle.degrees, relative, angle.black_pixels, columns)


def joined(parts: list[Scores], order: Int64[np.ndarray, " examples"]) -> Scores:
    """The scores of batches as those of all examples, put into `order`."""
    return Scores(
        {name: np.concatenate([part.l1[name] for part in parts])[order] for name in SPHERES},
        np.concatenate([part.theta_rgb_deg for part in parts])[order],
        np.concatenate([part.relative_radiance for part in parts])[order],
        np.concatenate([part.black_pixels for part in parts])[order],
        {
            name: np.concatenate([part.more[name] for part in parts])[order]
            for name in parts[0].more
        },
    )

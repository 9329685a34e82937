"""What a measured basis can be trusted for: the white furnace of every sphere."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from deeplight import brdf
from deeplight.light_stage.outline import Outline
from deeplight.reflectance import ReflectanceBasis

TOLERANCE = 0.01
_UNCOVERED = 0.01  # of the sphere: more is reported


@dataclass(frozen=True)
class SphereCertificate:
    """One sphere in white light of radiance 1, by its basis.

    Attributes:
        measured: mean over the mask; expected: the paper's reflectivity, None for a material
            of one's own. forced: the measured value was made to be that by --reflectivity.
        lowest, highest: over the mask; a smooth sphere in white light is even.
        colour: red, green, blue against their mean; white is 1, 1, 1.
        photographed: False for the mirror's one-hot basis.
        saturated: photographs with clipped pixels.
        centre_px, axes_px, edge_rms_px, edge_share: of the outline.
    """

    measured: float
    expected: float | None
    forced: bool
    lowest: float
    highest: float
    colour: tuple[float, float, float]
    photographed: bool
    saturated: int
    centre_px: tuple[float, float]
    axes_px: tuple[float, float]
    edge_rms_px: float | None
    edge_share: float

    @property
    def passes(self) -> bool:
        """Whether the furnace is within `TOLERANCE` of what is expected."""
        return self.expected is None or abs(self.measured / self.expected - 1) <= TOLERANCE


@dataclass(frozen=True)
class Certificate:
    """All spheres of a measurement.

    Attributes:
        spheres: by name.
        scale_from: what made the values absolute.
        lights: how many.
        uncovered_share: share of all directions that no light is near.
        warnings: what the user should know, one line each.
    """

    spheres: dict[str, SphereCertificate]
    scale_from: str
    lights: int
    uncovered_share: float
    warnings: tuple[str, ...]

    @property
    def passes(self) -> bool:
        """Whether every sphere does."""
        return all(sphere.passes for sphere in self.spheres.values())

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {**asdict(self), "passes": self.passes, "tolerance": TOLERANCE}


def certified(
    bases: Mapping[str, ReflectanceBasis],
    outlines: Mapping[str, Outline],
    colours: Mapping[str, np.ndarray],
    saturated: Mapping[str, int],
    *,
    forced: Mapping[str, float],
    scale_from: str,
    uncovered: float,
    lights: int,
    notes: tuple[str, ...],
) -> Certificate:
    """The certificate of `bases`; `colours` are sums over crop and lights per channel."""
    spheres = {}
    for name, basis in bases.items():
        furnace, outline = basis.furnace()[basis.view.mask()], outlines[name]
        colour = colours.get(name, np.ones(3))
        colour = colour / colour.mean()
        spheres[name] = SphereCertificate(
            measured=float(furnace.mean()),
            expected=forced.get(name, brdf.REFLECTIVITY.get(name)),
            forced=name in forced,
            lowest=float(furnace.min()),
            highest=float(furnace.max()),
            colour=(float(colour[0]), float(colour[1]), float(colour[2])),
            photographed=name in colours,
            saturated=saturated.get(name, 0),
            centre_px=outline.centre_px,
            axes_px=outline.axes_px,
            edge_rms_px=None if np.isnan(outline.rms_px) else outline.rms_px,
            edge_share=outline.edge_share,
        )
    warnings = [*notes, *_warnings(spheres, uncovered)]
    return Certificate(spheres, scale_from, lights, uncovered, tuple(warnings))


def _warnings(spheres: Mapping[str, SphereCertificate], uncovered: float) -> list[str]:
    found = []
    if uncovered > _UNCOVERED:
        found.append(
            f"no light covers {uncovered:.0%} of the sphere: the nearest photographs stand in there"
        )
    for name, sphere in spheres.items():
        if not sphere.passes:
            found.append(
                f"{name}: furnace {sphere.measured:.4f}, expected {sphere.expected} within 1 %"
            )
        if sphere.saturated:
            found.append(f"{name}: {sphere.saturated} photographs have saturated pixels")
        if sphere.photographed and max(abs(c - 1) for c in sphere.colour) > 0.03:
            found.append(f"{name} is not grey, but a basis has one number: its mean is taken")
        if sphere.edge_share < 0.6:
            found.append(f"{name}: only {sphere.edge_share:.0%} of its outline was seen")
    return found

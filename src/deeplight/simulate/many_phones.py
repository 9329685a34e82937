"""A family of phones: every take is filmed with another camera, drawn from wide spreads.

Real phones differ more than one camera's automatics do, and a network that learnt from one almost
perfect camera fails on the others. Nothing here is measured from a phone: the
spreads are our choice, wide enough to hold the phones people have.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float

from deeplight.camera import FRAME_HEIGHT, FRAME_WIDTH, TRAINED_VERTICAL_FOV_RAD
from deeplight.camera_response import GAMMA, LUMINANCE
from deeplight.preprocess import ASSUMED_LONG_SIDE_FOV_RAD
from deeplight.simulate.phone import CameraAutomatics
from deeplight.simulate.processing import IDENTITY, Matrix, Processing

Metering = Literal["average", "centre", "spot", "highlight"]

FAMILY, KEPT = "family", "kept"
"""Names of cameras: one of the family, and the one kept for test splits only."""

PORTRAIT = FRAME_WIDTH / FRAME_HEIGHT
_GRID = (20, 14)  # places the meter looks at, rows and columns of an upright frame


@dataclass(frozen=True)
class Optics:
    """What the lens shows.

    Attributes:
        vertical_fov_rad: of the photo as it is held.
        aspect: width over height of the photo.
        fov_known: the photo states its field of view; else preprocessing assumes 66 degrees for
            its long side, and the network sees it too near or too far.
    """

    vertical_fov_rad: float = TRAINED_VERTICAL_FOV_RAD
    aspect: float = PORTRAIT
    fov_known: bool = True

    @property
    def tangents(self) -> tuple[float, float]:
        """Half width and half height of the photo on the plane at distance 1."""
        high = float(np.tan(self.vertical_fov_rad / 2))
        return high * self.aspect, high

    @property
    def view_scale(self) -> float:
        """Size of what the network sees, over what it was made for; 1 where it is known."""
        if self.fov_known:
            return 1.0
        return max(self.tangents) / float(np.tan(ASSUMED_LONG_SIDE_FOV_RAD / 2))

    @property
    def view_fov_rad(self) -> float:
        """Vertical field of view of the frame whose upper 80 % the network sees."""
        return float(2 * np.arctan(self.view_scale * np.tan(TRAINED_VERTICAL_FOV_RAD / 2)))


@dataclass(frozen=True)
class PhoneSettings:
    """One take's camera: all that does not change from frame to frame.

    Attributes:
        name: of the camera, `FAMILY` or `KEPT`.
        automatics: of the automatics, the lens's vignetting, the sensor's noise and the JPEG.
        optics: what the lens shows.
        metering: where in the frame the meter looks.
        metering_place: centre (x, y) of where it looks, in half frames, -1 to 1, right and up.
        processing: what the phone makes of the picture.
    """

    name: str
    automatics: CameraAutomatics
    optics: Optics = field(default_factory=Optics)
    metering: Metering = "average"
    metering_place: tuple[float, float] = (0.0, 0.0)
    processing: Processing = field(default_factory=Processing)

    def metered_rays(self) -> Float[np.ndarray, "n 3"]:
        """Directions the meter looks along, camera frame, not normalised.

        The whole frame evenly; its middle more than its edges; or one spot.
        """
        rows, columns = ((np.arange(n) + 0.5) * (2 / n) - 1 for n in _GRID)
        y, x = (values.ravel() for values in np.meshgrid(rows, columns, indexing="ij"))
        if self.metering == "centre":
            x, y = x * abs(x) ** 0.7, y * abs(y) ** 0.7
        elif self.metering == "spot":
            x, y = (0.15 * a + 0.85 * c for a, c in zip((x, y), self.metering_place, strict=True))
        wide, high = self.optics.tangents
        return np.stack([x * wide, y * high, np.full_like(x, -1.0)], axis=-1)


def draw_phone(rng: np.random.Generator) -> PhoneSettings:
    """A camera of the family, as it is set for one take."""
    metering = rng.choice(["average", "centre", "spot", "highlight"], p=[0.4, 0.3, 0.15, 0.15])
    gamma, contrast = float(np.clip(rng.normal(GAMMA, 0.15), 1.7, 2.7)), rng.uniform(-0.25, 0.6)
    return PhoneSettings(
        name=FAMILY,
        automatics=CameraAutomatics(
            brightness=rng.uniform(0.36, 0.52),
            bias_stops=rng.normal(0.0, 0.4),
            highlight_share=_highlight_share(metering, rng),
            adaptation=_adaptation(rng),
            picture_share=rng.uniform(0.0, 0.5),
            tint=_tint(rng),
            speed=rng.uniform(0.3, 0.95),
            gamma=gamma,
            contrast=contrast,
            vignette=rng.uniform(0.0, 0.4) if rng.random() < 0.7 else 0.0,
            noise=10 ** rng.uniform(-4.0, -1.8),
            jpeg_quality=int(rng.integers(80, 97)),
        ),
        optics=_draw_optics(rng),
        metering=str(metering),  # type: ignore[arg-type]
        metering_place=(rng.uniform(-0.6, 0.6), rng.uniform(-0.6, 0.6)),
        processing=_draw_processing(gamma, contrast, rng),
    )


def kept_phone(rng: np.random.Generator) -> PhoneSettings:
    """The camera kept for test splits: its own colours, curve and lens; little else varies."""
    return PhoneSettings(
        name=KEPT,
        automatics=CameraAutomatics(
            brightness=rng.uniform(0.42, 0.46),
            bias_stops=rng.normal(0.1, 0.2),
            highlight_share=rng.uniform(0.02, 0.1),
            adaptation=rng.uniform(0.5, 0.9),
            picture_share=0.3,
            tint=tuple((np.array([0.07, 0.02, -0.09]) + rng.normal(0.0, 0.05, 3)).tolist()),
            speed=0.6,
            gamma=2.3,
            contrast=0.32,
            vignette=0.22,
            noise=10 ** rng.uniform(-3.6, -2.6),
            jpeg_quality=92,
        ),
        optics=Optics(float(np.radians(71.0)), 0.75),
        metering="centre",
        processing=Processing(
            matrix=_colour_matrix(1.18, np.array([0.05, -0.03, 0.04, 0.02, -0.06, 0.03])),
            local=0.38,
            headroom=2.2,
            knee=0.55,
            gamma=2.3,
            contrast=0.32,
            detail=0.35,
            chroma_blur=0.5,
        ),
    )


def _highlight_share(metering: str, rng: np.random.Generator) -> float:
    """Part of the picture that may saturate: up to 35 %, little where highlights are metered."""
    if metering == "highlight":
        return rng.uniform(0.003, 0.03)
    return rng.uniform(0.15, 0.35) if metering == "spot" else 0.02 + 0.33 * rng.random() ** 2


def _adaptation(rng: np.random.Generator) -> float:
    """Share of the light's colour that white balance removes: locked (0), full, or between."""
    kind = rng.random()
    return 0.0 if kind < 0.12 else rng.uniform(0.9, 1.0) if kind < 0.3 else rng.uniform(0.0, 1.0)


def _tint(rng: np.random.Generator) -> tuple[float, float, float]:
    """Lasting error of white balance: mostly towards warm or cold, less towards green or pink.

    Its standard deviation is 0.2 in red and blue and 0.1 in green.
    """
    warm, green = rng.normal(0.0, 0.19), rng.normal(0.0, 0.1)
    return warm - green / 2, green, -warm - green / 2


def _draw_optics(rng: np.random.Generator) -> Optics:
    """Lens and format: main cameras above all, wide and long ones; upright, some sideways."""
    kind = rng.random()
    if kind < 0.7:
        long_side = np.clip(rng.normal(67.0, 5.0), 55.0, 80.0)
    else:
        long_side = rng.uniform(80.0, 100.0) if kind < 0.85 else rng.uniform(40.0, 55.0)
    long_tangent = float(np.tan(np.radians(long_side) / 2))
    aspect = float(rng.choice([PORTRAIT, 0.75, 4 / 3], p=[0.55, 0.33, 0.12]))
    high = long_tangent / aspect if aspect > 1 else long_tangent
    smallest = np.tan(np.radians(40.0) / 2)
    vertical = float(2 * np.arctan(max(high, smallest)))
    return Optics(vertical, aspect, bool(rng.random() < 0.8))


def _draw_processing(gamma: float, contrast: float, rng: np.random.Generator) -> Processing:
    saturation, mixing = float(np.exp(rng.normal(0.05, 0.12))), rng.normal(0.0, 0.04, 6)
    rolls_off = rng.random() < 0.45
    return Processing(
        matrix=_colour_matrix(saturation, mixing),
        local=rng.uniform(0.1, 0.6) if rng.random() < 0.55 else 0.0,
        headroom=float(np.exp(rng.uniform(0.2, 2.0))) if rolls_off else 1.0,
        knee=rng.uniform(0.4, 0.75),
        gamma=gamma,
        contrast=contrast,
        detail=rng.uniform(-0.5, 0.9) if rng.random() < 0.7 else 0.0,
        chroma_blur=rng.uniform(0.0, 0.9),
    )


def _colour_matrix(saturation: float, mixing: Float[np.ndarray, "6"]) -> Matrix:
    """White stays white; colours get `saturation`, and each channel a little of the others."""
    matrix = saturation * np.array(IDENTITY) + (1 - saturation) * np.tile(LUMINANCE, (3, 1))
    others = np.zeros((3, 3))
    others[~np.eye(3, dtype=bool)] = mixing
    matrix = matrix + others - np.diag(others.sum(axis=1))
    return tuple(tuple(row) for row in matrix.round(5).tolist())

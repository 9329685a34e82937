"""The sun where the sun is: from what a photo's EXIF data say, or from what somebody points at.

Power and colour stay the estimate's: only the place and the size of its light become the sun's.
"""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from math import degrees, radians
from typing import Any

import numpy as np
from jaxtyping import Float

from deeplight import frames
from deeplight.camera import PinholeCamera
from deeplight.camera_response import LUMINANCE
from deeplight.edit import direction_of
from deeplight.errors import ConfigError, MissingExtraError
from deeplight.estimators.environment import HEIGHT, SceneLight, scene_light
from deeplight.estimators.fill import Fill
from deeplight.estimators.network import Estimate
from deeplight.frames import Rotation
from deeplight.io.tilt import Tilt
from deeplight.io.whereabouts import Whereabouts, whereabouts_of
from deeplight.lamp import SUN_ANGULAR_RADIUS_RAD, Lamp
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball

COMPASS_DEG = 10.0
"""How far a phone's compass may be off."""
UNKNOWN_TILT_DEG = 20.0
"""How far a photo's pitch may be from level when nothing gives it."""
DAYLIGHT_EXPOSURE = 10.5
"""Exposure value at ISO 100 from which on a photo was taken outdoors by day."""
DAYLIGHT_RATIO = 3.7
"""Where a photo does not say its exposure: mean radiance from above over that from below."""
_FIRST_MODEL, _LAST_MODEL = 2010.0, 2029.9  # years that pygeomag has; outside it extrapolates
_ASIDE = 0.3  # sine of the elevation from which on light comes from above or below


@dataclass(frozen=True, eq=False)
class Sun:
    """Where the sun stands in the picture.

    Attributes:
        direction: unit vector towards it, camera frame.
        source: what it was found from, in words; never a place.
        uncertainty_deg: how far it may be off.
    """

    direction: Float[np.ndarray, "3"]
    source: str
    uncertainty_deg: float

    def record(self, used: bool) -> dict[str, Any]:
        """The entry of the JSON file."""
        return {
            "direction": self.direction.tolist(),
            "source": self.source,
            "uncertainty_deg": self.uncertainty_deg,
            "used": used,
        }


@dataclass(frozen=True)
class SunHint:
    """Where somebody says that the sun stands; one of the first three.

    Attributes:
        angles_deg: azimuth (0 is the view, positive to the right) and elevation in the picture.
        pixel: (x, y) of the upright photo, also outside it.
        shadow: pixels (x, y) of the foot of something upright and of its shadow's tip.
        shadow_top: pixel of its upper end; left out, the sun's elevation is the estimate's.

    Raises:
        ConfigError: none or several of the first three, or numbers that are none.
    """

    angles_deg: tuple[float, float] | None = None
    pixel: tuple[float, float] | None = None
    shadow: tuple[float, float, float, float] | None = None
    shadow_top: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        ways = [way for way in (self.angles_deg, self.pixel, self.shadow) if way is not None]
        if len(ways) != 1:
            got = f"{len(ways)} of them"
            raise ConfigError("one of --sun, --sun-at and --shadow", got, "give one")
        if self.shadow is None and self.shadow_top:
            raise ConfigError("--shadow-top with a shadow", "no --shadow", "give one, or drop it")
        if not np.isfinite([value for way in ways for value in way]).all():
            raise ConfigError("numbers for the sun", f"{ways[0]}", "correct them")

    def sun(self, estimate: Estimate, scene: SceneLight) -> "Sun":
        """The sun of one photo."""
        if self.angles_deg is not None:
            return sun_at_angles(*self.angles_deg)
        height, width = estimate.photo.full_size
        camera = PinholeCamera(width, height, estimate.framing.vertical_fov_rad)
        if self.pixel is not None:
            return sun_at_pixel(camera, *self.pixel)
        assert self.shadow is not None
        high = None
        if scene.lamps:
            up = frames.turned(scene.lamps[0].direction, _world(scene.tilt))[1]
            high = float(np.arcsin(np.clip(up, np.sin(np.radians(5)), np.sin(np.radians(85)))))
        foot, tip = self.shadow[:2], self.shadow[2:]
        return sun_from_shadow(camera, scene.tilt, foot, tip, self.shadow_top, high)


@dataclass(frozen=True, eq=False)
class FoundSun:
    """A sun, the scene with it if it is used, and a sentence on it."""

    sun: "Sun"
    scene: SceneLight
    used: bool
    note: str


def find_sun(estimate: Estimate, scene: SceneLight, hint: SunHint | None) -> FoundSun | None:
    """Place the sun of a photo: as somebody says, else by its EXIF data; None where nobody knows.

    By EXIF data it is used outdoors by day only, and nowhere if the estimate has no compact light.
    """
    if hint is not None:
        sun = hint.sun(estimate, scene)
    else:
        taken = whereabouts_of(estimate.photo.exif)
        found = None if taken is None else sun_of(taken, scene.tilt)
        if taken is None or found is None:
            return None
        sun = found
        if not is_daylight(estimate.lighting, taken.exposure_value, estimate.photo.tilt):
            note = "the photo says where the sun was, but not that it was outdoors by day: not used"
            return FoundSun(sun, scene, False, note)
    if not scene.lamps:
        note = "no light stands out of the estimate: no sun is placed"
        return FoundSun(sun, scene, False, note)
    within = f", within {sun.uncertainty_deg:.0f} degrees" if sun.uncertainty_deg >= 1 else ""
    note = f"sun placed, {sun.source}{within}"
    return FoundSun(sun, with_sun(scene, sun), True, note)


def scene_in_sun(
    estimate: Estimate,
    hint: SunHint | None = None,
    height: int = HEIGHT,
    fill: Fill | None = "auto",
    tilt: Tilt | None = None,
) -> tuple[SceneLight, FoundSun | None]:
    """Put a photo into its light as `scene_light` does, its sun where `find_sun` finds it."""
    scene = scene_light(estimate, height, fill, tilt)
    found = find_sun(estimate, scene, hint)
    return (scene if found is None else found.scene), found


def sun_at_angles(azimuth_deg: float, elevation_deg: float) -> Sun:
    """From angles in the picture: azimuth 0 is the view, positive to the right.

    Raises:
        ConfigError: an elevation beyond 90 degrees.
    """
    if not (abs(elevation_deg) <= 90 and abs(azimuth_deg) <= 360):
        got = f"{azimuth_deg:g} {elevation_deg:g}"
        raise ConfigError("--sun with an azimuth and an elevation in degrees", got, "correct it")
    return Sun(direction_of(azimuth_deg, elevation_deg), "given by its angles", 0.0)


def sun_at_pixel(camera: PinholeCamera, x: float, y: float) -> Sun:
    """From the pixel (x, y) of the upright photo where it stands, also outside the photo."""
    if not np.isfinite([x, y]).all():
        raise ConfigError("--sun-at with a pixel", f"{x:g} {y:g}", "correct it")
    return Sun(_ray(camera, x, y), "given by its pixel", 0.5)


def sun_from_shadow(
    camera: PinholeCamera,
    tilt: Tilt | None,
    foot: tuple[float, float],
    tip: tuple[float, float],
    top: tuple[float, float] | None = None,
    elevation_rad: float | None = None,
) -> Sun:
    """From something upright on level ground and its shadow.

    Args:
        camera: of the photo.
        tilt: of the camera; None takes it to look level.
        foot: pixel where the upright thing stands.
        tip: pixel where its shadow ends.
        top: pixel of its upper end; with it the sun's elevation is known.
        elevation_rad: of the sun, where `top` is left out.

    Raises:
        ConfigError: a point above the horizon, both the same, or no way to know the elevation.
    """
    world = _world(tilt)
    stands, ends = (_on_ground(camera, world, point) for point in (foot, tip))
    along = (stands - ends)[[0, 2]]
    length = float(np.linalg.norm(along))
    if length < 1e-6:
        raise ConfigError(
            "a shadow from its foot to its tip", "two points that are one", "move one"
        )
    if top is not None:
        ray = frames.turned(_ray(camera, *top), world)
        reach = float(stands[[0, 2]] @ ray[[0, 2]] / (ray[[0, 2]] @ ray[[0, 2]]))
        elevation_rad = float(np.arctan2(1 + reach * ray[1], length))
    if elevation_rad is None or not 0 < elevation_rad < np.pi / 2:
        got = "a sun at or below the horizon" if top is not None else "no upper end"
        raise ConfigError("a sun above the horizon", got, "give --shadow-top X Y")
    across = along / length * np.cos(elevation_rad)
    direction = np.array([across[0], np.sin(elevation_rad), across[1]])
    known = "and its upper end" if top is not None else "its elevation from the estimate"
    uncertain = float(np.hypot(5.0, _tilt_off_deg(tilt))) if top is not None else UNKNOWN_TILT_DEG
    source = f"from a shadow, {known}, {_tilt_in_words(tilt)}"
    return Sun(frames.turned(direction, world.T), source, uncertain)


def sun_of(taken: Whereabouts, tilt: Tilt | None) -> Sun | None:
    """The sun in a picture taken then and there; None at night.

    Raises:
        MissingExtraError: the extra `sun` is not installed.
    """
    try:
        from astral import Observer
        from astral.sun import azimuth, elevation
    except ModuleNotFoundError as error:
        raise MissingExtraError("sun", "placing the sun by the photo's GPS data") from error
    observer = Observer(taken.latitude_deg, taken.longitude_deg, max(taken.altitude_m, 0.0))
    high = radians(elevation(observer, taken.time, with_refraction=True))
    if high <= 0:
        return None
    north = taken.heading_deg + (_declination_deg(taken) if taken.north == "magnetic" else 0.0)
    right = radians(azimuth(observer, taken.time) - north)
    level = np.array([np.cos(high) * np.sin(right), np.sin(high), -np.cos(high) * np.cos(right)])
    parts = [f"GPS position and time, {taken.north} compass heading"]
    parts.append(_tilt_in_words(tilt))
    uncertain = COMPASS_DEG * float(np.cos(high))
    uncertain = float(np.hypot(uncertain, _tilt_off_deg(tilt)))
    return Sun(frames.turned(level, _world(tilt).T), ", ".join(parts), max(uncertain, 1.0))


def is_daylight(lighting: Lighting, exposure_value: float | None, tilt: Tilt | None) -> bool:
    """Whether a photo was taken outdoors by day.

    Its exposure says (at ISO 100), where EXIF has it. Else the estimate must have much more light
    from above than from below, by the tilt that EXIF gives or level, which holds for four of five
    outdoor scenes and for half of the rooms too.
    """
    if exposure_value is not None:
        return exposure_value >= DAYLIGHT_EXPOSURE
    directions = mirror_ball.pixel_directions(lighting.size)
    up = frames.turned(directions, _world(tilt))[..., 1]
    luminance = lighting.radiance @ LUMINANCE
    weights = mirror_ball.solid_angles(lighting.size)
    above, below = (
        float((luminance * weights)[part].sum() / weights[part].sum())
        for part in (up > _ASIDE, up < -_ASIDE)
    )
    return above > DAYLIGHT_RATIO * below


def with_sun(scene: SceneLight, sun: Sun) -> SceneLight:
    """The scene with the power of its lamps in the sun; without lamps it has no sun to place."""
    if not scene.lamps:
        return scene
    flux = np.sum([lamp.flux for lamp in scene.lamps], axis=0)
    direction = frames.normalised(np.asarray(sun.direction, float))
    return replace(scene, lamps=(Lamp(direction, flux, SUN_ANGULAR_RADIUS_RAD),))


def _declination_deg(taken: Whereabouts) -> float:
    """How far east of true north the compass points there (World Magnetic Model)."""
    try:
        from pygeomag import GeoMag
    except ModuleNotFoundError as error:
        raise MissingExtraError("sun", "turning a magnetic heading into a true one") from error
    year = taken.time.year
    begin, end = (datetime(y, 1, 1, tzinfo=UTC) for y in (year, year + 1))
    decimal = year + (taken.time - begin) / (end - begin)
    model = GeoMag(base_year=min(max(decimal, _FIRST_MODEL), _LAST_MODEL))
    found = model.calculate(
        glat=taken.latitude_deg,
        glon=taken.longitude_deg,
        alt=taken.altitude_m / 1000,
        time=decimal,
        allow_date_outside_lifespan=True,
    )
    return float(found.d)


def _tilt_off_deg(tilt: Tilt | None) -> float:
    """How far off a tilt may be."""
    return UNKNOWN_TILT_DEG if tilt is None else degrees(tilt.scale_rad)


def _tilt_in_words(tilt: Tilt | None) -> str:
    return f"the camera's tilt by {tilt.source}" if tilt else "the camera taken as level"


def _world(tilt: Tilt | None) -> Rotation:
    return tilt.level_from_camera if tilt else np.eye(3)


def _ray(camera: PinholeCamera, x: float, y: float) -> Float[np.ndarray, "3"]:
    """Unit direction through a point of the picture, 0 0 its upper left corner."""
    half_width, half_height = camera.tangents
    right = (2 * x / camera.width - 1) * half_width
    up = (1 - 2 * y / camera.height) * half_height
    return frames.normalised(np.array([right, up, -1.0]))


def _on_ground(
    camera: PinholeCamera, world: Rotation, point: tuple[float, float]
) -> Float[np.ndarray, "3"]:
    """Where a pixel's ray meets the ground, for a camera at height 1 above the origin."""
    ray = frames.turned(_ray(camera, *point), world)
    if ray[1] > -1e-3:
        got = f"({point[0]:g}, {point[1]:g}), at or above the horizon"
        raise ConfigError("a point on the ground", got, "point lower, or give --pitch")
    found: np.ndarray = np.array([0.0, 1.0, 0.0]) - ray / ray[1]
    return found

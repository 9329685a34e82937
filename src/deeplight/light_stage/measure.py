"""Photographs of spheres under single lights -> reflectance bases with their certificate."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from deeplight import brdf
from deeplight.camera import PinholeCamera
from deeplight.errors import ConfigError, DataSetError
from deeplight.light_stage.certificate import Certificate, certified
from deeplight.light_stage.crop import Cropper
from deeplight.light_stage.folder import MIRROR, SpherePhotographs, StageFolder, open_stage
from deeplight.light_stage.highlight import Highlight, find_highlight
from deeplight.light_stage.lobe import PASSES, basis_weights, light_shares, uncovered_share
from deeplight.light_stage.outline import Outline, find_sphere, sphere_at
from deeplight.lighting import LIGHTING_SIZE
from deeplight.reflectance import ReflectanceBasis, analytic_basis
from deeplight.sphere import SphereView

Advance = Callable[[int], None]

_CALIBRATED = "the lights' own calibration"
_UNSEEN = 0.03  # of the lights: more is a photograph gone wrong


@dataclass(frozen=True)
class MeasureSettings:
    """How to read the photographs.

    Attributes:
        material: name of the one sphere whose photographs lie in the folder itself.
        lights: list of the lights; None: the folder's own.
        directions_from_mirror: find the lights in the mirror ball, whatever the list says.
        fov_deg: vertical, of the upright photographs.
        gamma: of integer files; 1 is linear.
        circle: (x, y, radius) of every sphere in pixels, instead of looking for it.
        reflectivity: the one sphere whose reflectivity sets the scale of all.
        passes: 1 is the paper's lobe alone; see `lobe`.
        photographed_mirror: also make the mirror's basis from its photographs, to look at.
    """

    material: str | None = None
    lights: Path | None = None
    directions_from_mirror: bool = False
    fov_deg: float | None = None
    gamma: float | None = None
    circle: tuple[float, float, float] | None = None
    reflectivity: Mapping[str, float] = field(default_factory=dict)
    passes: int = PASSES
    photographed_mirror: bool = False

    def __post_init__(self) -> None:
        wrong = [v for v in self.reflectivity.values() if not 0 < v <= 1]
        if len(self.reflectivity) > 1 or wrong:
            got = f"{dict(self.reflectivity)}"
            raise ConfigError("one reflectivity between 0 and 1", got, "give one sphere's")
        if not 1 <= self.passes <= 8:
            raise ConfigError("1 to 8 passes", f"{self.passes}", "1 is the paper's, 2 is advised")
        if self.fov_deg is not None and not 0 < self.fov_deg < 180:
            raise ConfigError("--fov between 0 and 180", f"{self.fov_deg}", "correct it")
        if self.gamma is not None and not 0 < self.gamma < 10:
            raise ConfigError("a gamma between 0 and 10", f"{self.gamma}", "correct it")


@dataclass(frozen=True, eq=False)
class Measured:
    """What came out.

    Attributes:
        bases: by sphere; the mirror's is one-hot unless its photographs were asked for.
        certificate: the furnace values and what they rest on.
        directions: of the lights as used, camera frame.
    """

    bases: dict[str, ReflectanceBasis]
    certificate: Certificate
    directions: Float[np.ndarray, "lights 3"]


@dataclass(frozen=True, eq=False)
class _Crops:
    """One sphere: its crop under each light, per unit of that light's colour."""

    outline: Outline
    values: Float[np.ndarray, "pixels lights 3"]
    saturated: int


@dataclass(frozen=True, eq=False)
class _Light:
    """The lights as they are used: where they stand, what they give, what that rests on."""

    directions: Float[np.ndarray, "lights 3"]
    colours: Float[np.ndarray, "lights 3"]
    scale_from: str
    notes: tuple[str, ...] = ()


def photographs_in(folder: Path, how: MeasureSettings) -> int:
    """How many photographs `measure` reads, for a progress bar."""
    stage = open_stage(folder, how.material, how.lights, how.gamma)
    return 2 * len(stage.spheres) * len(stage.lights.files)


def measure(folder: Path, how: MeasureSettings, advance: Advance = lambda n: None) -> Measured:
    """The bases of every sphere photographed in `folder`.

    Args:
        advance: called with the number of photographs just read.

    Raises:
        OSError: a file cannot be read.
        DataSetError: photographs or facts are missing.
        ImageFileError: a photograph is broken, of another size, or shows no sphere.
    """
    stage = open_stage(folder, how.material, how.lights, how.gamma)
    _check_scale(stage, how)
    cameras = {name: stage.pinhole(name, how.fov_deg) for name in stage.spheres}
    outlines = _outlines(stage, cameras, how, advance)
    light = _light(stage, cameras, outlines, how, advance)
    crops = {}
    for name, sphere in stage.spheres.items():
        if name != MIRROR or how.photographed_mirror:
            crops[name] = _crops(sphere, outlines[name], cameras[name], stage, light, advance)
    place = _place(stage)
    bases = {
        name: _basis(crop, light.directions, place, how.passes) for name, crop in crops.items()
    }
    scale, light = _scale(bases, how, light)
    bases = {name: _scaled(basis, scale) for name, basis in bases.items()}
    if MIRROR in outlines and not how.photographed_mirror:
        bases[MIRROR] = analytic_basis(MIRROR, outlines[MIRROR].view)
    shares = light_shares(light.directions)
    colours = {name: np.einsum("plc,l->c", crop.values, shares) for name, crop in crops.items()}
    certificate = certified(
        bases,
        outlines,
        colours,
        {name: crop.saturated for name, crop in crops.items()},
        forced=how.reflectivity,
        scale_from=light.scale_from,
        uncovered=uncovered_share(light.directions),
        lights=len(light.directions),
        notes=(*stage.notes, *light.notes),
    )
    return Measured(bases, certificate, light.directions)


def _outlines(
    stage: StageFolder, cameras: dict[str, PinholeCamera], how: MeasureSettings, advance: Advance
) -> dict[str, Outline]:
    """Every sphere's outline; a mirror without a photograph in a lit room has its neighbours'."""
    found = {}
    for name, sphere in stage.spheres.items():
        lit = sphere.outline_photograph()
        if how.circle is not None:
            found[name] = sphere_at(*how.circle, cameras[name])
        elif lit is not None:
            found[name] = find_sphere(lit.mean(axis=2), cameras[name])
        elif name != MIRROR:
            total = np.zeros(sphere.dark.shape[:2])
            for file in stage.lights.files:
                total += sphere.photograph(file)[0].mean(axis=2)
                advance(1)
            found[name] = find_sphere(total, cameras[name])
    if MIRROR in stage.spheres and MIRROR not in found:
        if not found:
            do = "add outline.png, the mirror in a lit room, or give --circle x y r"
            raise DataSetError("the mirror's outline", "lights in it only", do)
        found[MIRROR] = next(iter(found.values()))
    return found


def _light(
    stage: StageFolder,
    cameras: dict[str, PinholeCamera],
    outlines: dict[str, Outline],
    how: MeasureSettings,
    advance: Advance,
) -> _Light:
    """Directions and colours of the lights, from the list or from the mirror ball."""
    lights, sphere = stage.lights, stage.spheres.get(MIRROR)
    find = how.directions_from_mirror or lights.directions is None
    if sphere is None or not (find or not lights.calibrated):
        if find:
            do = "add them to the list, or a folder 'mirror' of photographs under the same lights"
            raise DataSetError("the directions of the lights", "none", do)
        colours = np.ones((len(lights.files), 3)) if lights.colours is None else lights.colours
        given = _CALIBRATED if lights.calibrated else ""
        assert lights.directions is not None
        return _Light(lights.directions, colours, given)
    view, place = outlines[MIRROR].view, _place_m(stage)
    seen, saturated = [], 0
    for file in lights.files:
        photograph, clipped = sphere.photograph(file)
        seen.append(find_highlight(photograph, cameras[MIRROR], view, place))
        saturated += clipped
        advance(1)
    return _from_mirror(stage, _none_missing(seen, view), saturated, find)


def _none_missing(seen: list[Highlight | None], view: SphereView) -> list[Highlight]:
    """A mirror ball shows every light but one straight behind it: there an unseen one stands."""
    unseen = sum(highlight is None for highlight in seen)
    if unseen > max(2, _UNSEEN * len(seen)):
        got = f"{unseen} of {len(seen)} photographs without any"
        do = "expose the mirror longer, or check its outline"
        raise DataSetError("the image of a light in the mirror ball", got, do)
    behind = Highlight(-view.ball_from_camera[2], np.ones(3), behind=True)
    return [behind if highlight is None else highlight for highlight in seen]


def _from_mirror(stage: StageFolder, seen: list[Highlight], saturated: int, find: bool) -> _Light:
    """What the mirror ball shows: where the lights are, and how bright in pixel values."""
    lights = stage.lights
    front = np.array([not highlight.behind for highlight in seen])
    if not front.any():
        raise DataSetError("lights in front of the mirror ball", "none", "check --fov and outline")
    bright = np.array([highlight.irradiance for highlight in seen])
    directions, notes = lights.directions, []
    if find or directions is None:
        directions = np.array([highlight.direction for highlight in seen])
        notes.append(f"directions from the mirror ball; {(~front).sum()} at its rim are rough")
    scale_from = f"the mirror's {brdf.REFLECTIVITY[MIRROR]}"
    if lights.colours is None:
        colours = np.where(front[:, None], bright, np.median(bright[front], axis=0))
    elif lights.calibrated:
        colours, scale_from = lights.colours, _CALIBRATED
    else:
        colours = lights.colours * np.median(bright[front] / lights.colours[front], axis=0)
    if saturated and scale_from != _CALIBRATED:
        notes.append(f"{saturated} lights saturate in the mirror: they set no scale")
        scale_from = ""
    return _Light(directions, colours, scale_from, tuple(notes))


def _crops(
    sphere: SpherePhotographs,
    outline: Outline,
    camera: PinholeCamera,
    stage: StageFolder,
    light: _Light,
    advance: Advance,
) -> _Crops:
    cropper = Cropper.of(outline, camera)
    files = stage.lights.files
    values = np.zeros((outline.view.size**2, len(files), 3), np.float32)
    saturated = 0
    for number, file in enumerate(files):
        photograph, clipped = sphere.photograph(file)
        values[:, number] = cropper.crop(photograph) / light.colours[number]
        saturated += clipped
        advance(1)
    return _Crops(outline, values, saturated)


def _basis(crop: _Crops, directions: np.ndarray, place: float, passes: int) -> ReflectanceBasis:
    """Mean of the channels: the paper's spheres are grey, and a basis has one number."""
    view, grey = crop.outline.view, crop.values.mean(axis=2)
    if place == 0:
        weights = basis_weights(grey, directions, LIGHTING_SIZE, passes)
    else:
        places = view.normals().reshape(-1, 3) * place
        # The light is nearer to the side it shines on than to the centre.
        grey = grey * ((directions[None] - places[:, None]) ** 2).sum(axis=2)
        weights = basis_weights(grey, directions, LIGHTING_SIZE, passes, places)
    return ReflectanceBasis(weights.astype(np.float32), view, LIGHTING_SIZE)


def _scale(
    bases: dict[str, ReflectanceBasis], how: MeasureSettings, light: _Light
) -> tuple[float, _Light]:
    """The one factor that makes all spheres absolute."""
    for name, value in how.reflectivity.items():
        furnace = bases[name].furnace()[bases[name].view.mask()].mean()
        scale_from = f"{name}'s reflectivity, given as {value}"
        return float(value / furnace), replace(light, scale_from=scale_from)
    if not light.scale_from:
        raise _no_scale()
    return 1.0, light


def _check_scale(stage: StageFolder, how: MeasureSettings) -> None:
    """Refuse before the work if its result would have no scale."""
    photographed = sorted(set(stage.spheres) - (set() if how.photographed_mirror else {MIRROR}))
    for name in how.reflectivity:
        if name not in photographed:
            got = f"{name!r}"
            raise ConfigError(f"the reflectivity of one of {photographed}", got, "correct it")
    if not (how.reflectivity or stage.lights.calibrated or MIRROR in stage.spheres):
        raise _no_scale()


def _no_scale() -> DataSetError:
    do = "give --reflectivity diffuse=0.345, photograph the mirror unsaturated, or calibrate"
    return DataSetError("something that sets the absolute scale", "none", do)


def _scaled(basis: ReflectanceBasis, factor: float) -> ReflectanceBasis:
    return ReflectanceBasis(basis.weights * np.float32(factor), basis.view, basis.light_size)


def _place_m(stage: StageFolder) -> tuple[float, float] | None:
    radius, distance = stage.camera.sphere_radius_m, stage.lights.distance_m
    if radius is None or distance is None:
        return None
    if distance < 1.2 * radius:
        got = f"{distance} m, a radius of {radius} m"
        raise DataSetError("lights well outside the sphere", got, "correct distance_m")
    return radius, distance


def _place(stage: StageFolder) -> float:
    """The sphere's radius against the lights' distance; 0 where not known."""
    place = _place_m(stage)
    return 0.0 if place is None else place[0] / place[1]

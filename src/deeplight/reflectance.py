"""A sphere under each single direction of light: the basis of image-based relighting.

Section 3.3. Light is constant over each pixel of the mirror ball, so a weight is the
integral of the sphere's reflection over that pixel; the solid angle is inside it and white
light gives the sphere's reflectivity.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Self

import numpy as np
from jaxtyping import Float

from deeplight import brdf, frames
from deeplight.errors import ShapeError
from deeplight.frames import Rotation
from deeplight.lighting import LIGHTING_SIZE
from deeplight.mappings import mirror_ball
from deeplight.sphere import Rig, SphereView

_ROWS_AT_A_TIME = 64  # keeps the working set in the processor's cache


@dataclass(frozen=True, eq=False)
class ReflectanceBasis:
    """One sphere's basis images.

    Attributes:
        weights: (pixels of the crop, pixels of the lighting), both row-major; rows of
            pixels that do not show the sphere are zero. Read-only.
        view: the sphere and its frame; light is in the camera frame.
        light_size: pixels along the lighting's mirror ball.
    """

    weights: Float[np.ndarray, "pixels lights"]
    view: SphereView
    light_size: int

    def __post_init__(self) -> None:
        wanted = (self.view.size**2, self.light_size**2)
        if self.weights.shape != wanted or not np.isfinite(self.weights).all():
            raise ShapeError(f"finite weights {wanted}", f"{self.weights.shape}", "rebuild it")
        self.weights.setflags(write=False)

    def furnace(self) -> Float[np.ndarray, "size size"]:
        """The sphere in white light of radiance 1: its certificate."""
        return self.weights.sum(axis=1).reshape(self.view.size, self.view.size)

    def turned(self, view: SphereView, light_size: int | None = None) -> Self:
        """The basis of the same sphere in another place of the picture.

        A sphere looks the same from every side, so only its light turns: the weight of a new
        pixel of light is the average, over its area, of the old weights per steradian. Each
        row keeps its sum. A light pixel's width is added to the blur of glossy spheres. The
        angular radius is taken as it is: `view.angular_radius_rad` should not differ by more
        than a few degrees.

        Args:
            light_size: pixels along the new lighting's ball; left out, as many as now.

        Raises:
            ShapeError: `view` has another size.
        """
        if view.size != self.view.size:
            got = f"{view.size} x {view.size}"
            raise ShapeError(f"a view of {self.view.size} x {self.view.size}", got, "keep the size")
        new_size = light_size or self.light_size
        old_from_new = self.view.ball_from_camera.T @ view.ball_from_camera
        density = self.weights / np.maximum(mirror_ball.solid_angles(self.light_size).ravel(), 1e-9)
        weights = density @ _shared(self.light_size, new_size, old_from_new)
        weights = weights.astype(np.float32)
        before, after = (w.sum(axis=1, keepdims=True) for w in (self.weights, weights))
        weights *= np.divide(before, after, out=np.zeros_like(after), where=after > 0)
        return type(self)(weights, view, new_size)


def analytic_basis(
    material: str, view: SphereView, light_size: int = LIGHTING_SIZE
) -> ReflectanceBasis:
    """The basis of one of `brdf.REFLECTIVITY`'s materials as seen in `view`, kept in memory.

    The mirror is one-hot where the paper's is (a distant sphere on the view axis): each
    pixel shows the one pixel of light it reflects. Turned into a sphere's own frame it
    becomes the area average over the pixels of light that a crop pixel covers.

    Examples:
        >>> view = deeplight.PAPER_RIG.views["diffuse"]
        >>> basis = deeplight.analytic_basis("diffuse", view)
        >>> round(float(basis.weights.sum(1)[16 * 32 + 16]), 3)  # its reflectivity
        0.345
    """
    turn = view.ball_from_camera.astype(np.float64).tobytes()
    return _basis(material, turn, view.angular_radius_rad, view.size, light_size)


def rig_bases(rig: Rig, light_size: int = LIGHTING_SIZE) -> dict[str, ReflectanceBasis]:
    """The analytic basis of each of a rig's spheres, in its own frame."""
    return {name: analytic_basis(name, view, light_size) for name, view in rig.views.items()}


@lru_cache(maxsize=24)
def _basis(
    material: str, turn: bytes, angular_radius: float, size: int, light_size: int
) -> ReflectanceBasis:
    builders = {"mirror": _mirror, "matte_silver": _matte_silver, "diffuse": _diffuse}
    if material not in builders:
        raise ShapeError(f"one of {tuple(builders)}", material, "name a reference sphere")
    view = SphereView(np.frombuffer(turn).reshape(3, 3).copy(), angular_radius, size)
    weights = builders[material](view, light_size)
    weights[~(view.alpha().ravel() > 0)] = 0
    return ReflectanceBasis(weights.astype(np.float32), view, light_size)


def _mirror(view: SphereView, light_size: int) -> np.ndarray:
    supersample = 8
    directions = view.reflected(supersample)
    light = mirror_ball.pixel_of_directions(directions, light_size)
    inside = np.hypot(*mirror_ball.grid(view.size, supersample)) <= 1
    n, s = view.size, supersample
    row, column = np.divmod(np.arange((n * s) ** 2), n * s)
    pixel = row // s * n + column // s
    kept = inside.ravel()
    index = pixel[kept] * light_size**2 + light.ravel()[kept]
    weights = np.bincount(index, minlength=n * n * light_size**2).reshape(n * n, -1)
    return weights * (brdf.REFLECTIVITY["mirror"] / np.maximum(weights.sum(1, keepdims=True), 1))


def _diffuse(view: SphereView, light_size: int) -> np.ndarray:
    directions, solid_angle = _light_samples(light_size)
    normals = _by_sample(view.normals(2), 2)
    share = solid_angle / len(normals)
    weights = np.empty((view.size**2, light_size**2), np.float32)
    for some in np.array_split(np.arange(len(weights)), max(1, len(weights) // _ROWS_AT_A_TIME)):
        reflected = sum(brdf.lambertian(n[some] @ directions.T) for n in normals)
        weights[some] = _by_light(reflected * share, light_size)
    return weights * brdf.REFLECTIVITY["diffuse"]


def _matte_silver(view: SphereView, light_size: int) -> np.ndarray:
    """GGX, each row scaled so that white light gives the measured reflectivity."""
    directions, solid_angle = _light_samples(light_size)
    normals, views = (
        values.reshape(-1, 3).astype(np.float32) for values in (view.normals(), view.views())
    )
    weights = np.zeros((view.size**2, light_size**2), np.float32)
    shown = np.flatnonzero(view.alpha())
    for some in np.array_split(shown, max(1, len(shown) // _ROWS_AT_A_TIME)):
        n_l, l_v = normals[some] @ directions.T, views[some] @ directions.T
        n_v = (normals[some] * views[some]).sum(axis=1, keepdims=True)
        weights[some] = _by_light(brdf.rough_specular(n_l, n_v, l_v) * solid_angle, light_size)
    return weights * (
        brdf.REFLECTIVITY["matte_silver"] / np.maximum(weights.sum(1, keepdims=True), 1e-9)
    )


def _shared(
    old_size: int, new_size: int, old_from_new: Rotation
) -> Float[np.ndarray, "old_lights new_lights"]:
    """Solid angle that each old pixel of light (row) shares with each new one (column)."""
    directions, inside = mirror_ball.subpixels(new_size, 8 * max(1, -(-old_size // new_size)))
    old = mirror_ball.pixel_of_directions(frames.turned(directions, old_from_new), old_size)
    new = np.broadcast_to(np.arange(new_size**2)[:, None], old.shape)
    share = inside / np.maximum(inside.sum(axis=1, keepdims=True), 1)
    solid_angle = share * mirror_ball.solid_angles(new_size).reshape(-1, 1)
    index = old.astype(np.int64) * new_size**2 + new
    total = np.bincount(index.ravel(), solid_angle.ravel(), old_size**2 * new_size**2)
    return total.reshape(old_size**2, -1)


def _light_samples(light_size: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions spread over every pixel of light, and the solid angle of each."""
    supersample = _light_supersample(light_size)
    directions, inside = mirror_ball.subpixels(light_size, supersample)
    share = inside / np.maximum(inside.sum(axis=1, keepdims=True), 1)
    solid_angle = share * mirror_ball.solid_angles(light_size).reshape(-1, 1)
    return directions.reshape(-1, 3).astype(np.float32), solid_angle.ravel().astype(np.float32)


def _light_supersample(light_size: int) -> int:
    return max(1, -(-4 * LIGHTING_SIZE // light_size))  # the paper's 4 x 4 on a 32 ball


def _by_light(weights: np.ndarray, light_size: int) -> np.ndarray:
    return weights.reshape(len(weights), light_size**2, -1).sum(axis=2)


def _by_sample(values: np.ndarray, supersample: int) -> list[np.ndarray]:
    """Values at each of the supersample^2 places in every pixel, as (pixels, 3) arrays."""
    s = supersample
    return [
        values[i::s, j::s].reshape(-1, 3).astype(np.float32) for i in range(s) for j in range(s)
    ]

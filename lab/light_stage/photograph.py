"""One photograph of a virtual light stage: a sphere, one light, a camera with its faults."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from deeplight import brdf
from deeplight.camera import PinholeCamera
from deeplight.frames import dot, turned
from deeplight.mappings import mirror_ball
from deeplight.sphere import SphereView
from lab.light_stage.surfaces import SURFACES

MIRROR = "mirror"
LENS_BLUR_PX = 0.6  # standard deviation: no lens is sharper than its pixels
_WINDOW_PX = 15  # about the image of a light in the mirror
_WINDOW_SUPERSAMPLE = 12


@dataclass(frozen=True, eq=False)
class Scene:
    """What stands still while the lights change.

    Attributes:
        camera: looks along -Z from the origin.
        view: the sphere, its direction and angular radius.
        radius_m: of the sphere.
        light_distance_m: from the sphere's centre.
        light_radius_rad: standard deviation of a light's size seen from the centre.
        supersample: samples along a pixel.
    """

    camera: PinholeCamera
    view: SphereView
    radius_m: float
    light_distance_m: float
    light_radius_rad: float
    supersample: int


@dataclass(frozen=True, eq=False)
class Points:
    """Where the camera's rays meet the sphere, light by light the same.

    Attributes:
        inside: which samples of the picture show the sphere, (rows, columns).
        places: row and column of those.
        normals, views: of those, camera frame.
    """

    inside: Bool[np.ndarray, "fine_rows fine_columns"]
    places: Int[np.ndarray, "2 points"]
    normals: Float[np.ndarray, "points 3"]
    views: Float[np.ndarray, "points 3"]


def points_of(scene: Scene) -> Points:
    """The sphere at every sample of the picture."""
    camera, s = scene.camera, scene.supersample
    fine = PinholeCamera(camera.width * s, camera.height * s, camera.vertical_fov_rad)
    rays = turned(fine.rays(), scene.view.ball_from_camera)
    u, v = (rays[..., i] / -rays[..., 2] / np.tan(scene.view.angular_radius_rad) for i in (0, 1))
    inside = np.hypot(u, v) <= 1
    return Points(inside, np.array(np.nonzero(inside)), *scene.view.surface(u[inside], v[inside]))


def photographed(
    scene: Scene, points: Points, material: str, light: Float[np.ndarray, "3"]
) -> Float32[np.ndarray, "height width"]:
    """Radiance of the sphere per unit of the light's irradiance at the sphere's centre."""
    if material == MIRROR:
        return _mirrored(scene, points, light)
    n, v = points.normals, points.views
    towards, gain = _towards(scene, n, light)
    n_l = dot(n, towards)
    lit = n_l > 0  # no surface here glows from behind
    n_v, l_v = dot(n[lit], v[lit]), dot(v[lit], towards[lit])
    shown = np.zeros(len(n))
    shown[lit] = SURFACES[material](n_l[lit], n_v, l_v) * gain[lit]
    return _averaged(scene, points.inside, shown)


def in_white_light(
    scene: Scene, points: Points, reflectivity: float
) -> Float32[np.ndarray, "height width"]:
    """Radiance of the sphere in light of radiance 1 from everywhere."""
    return _averaged(scene, points.inside, np.full(len(points.normals), reflectivity))


def reflectivity_of(material: str) -> float:
    """Share of white light that the sphere as a whole shows to a distant camera."""
    if material in brdf.REFLECTIVITY:
        return brdf.REFLECTIVITY[material]
    view = SphereView(size=16)
    mask = view.mask()
    n, v = (values[mask] for values in (view.normals(), view.views()))
    lights, solid_angle = mirror_ball.pixel_directions(128), mirror_ball.solid_angles(128).ravel()
    lights = lights.reshape(-1, 3)
    shown = SURFACES[material](n @ lights.T, (n * v).sum(-1, keepdims=True), v @ lights.T)
    return float((shown * solid_angle).sum(axis=1).mean())


def _averaged(
    scene: Scene, inside: Bool[np.ndarray, "fine_rows fine_columns"], values: np.ndarray
) -> Float32[np.ndarray, "height width"]:
    """Values at the samples on the sphere as pixels, black around it."""
    fine = np.zeros(inside.shape, np.float32)
    fine[inside] = values
    s = scene.supersample
    picture = fine.reshape(scene.camera.height, s, scene.camera.width, s).mean(axis=(1, 3))
    return _blurred(picture, 1)


def _blurred(picture: np.ndarray, supersample: int) -> np.ndarray:
    """The picture through the lens."""
    width = LENS_BLUR_PX * supersample
    offsets = np.arange(-int(4 * width), int(4 * width) + 1)
    kernel = np.exp(-(offsets**2) / (2 * width**2)).astype(np.float32)
    for axis in (0, 1):
        spread = np.zeros_like(picture)
        for offset, weight in zip(offsets, kernel / kernel.sum(), strict=True):
            spread += weight * np.roll(picture, offset, axis)
        picture = spread
    return picture


def _towards(scene: Scene, normals: np.ndarray, light: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Direction from each point to the light, and its irradiance against that at the centre."""
    to_light = light * scene.light_distance_m - normals * scene.radius_m
    squared = dot(to_light, to_light)
    return to_light / np.sqrt(squared)[:, None], scene.light_distance_m**2 / squared


def _mirrored(scene: Scene, points: Points, light: np.ndarray) -> np.ndarray:
    """The light's own image: a small bright patch, sampled finely where it lies."""
    camera, s, fine = scene.camera, scene.supersample, _WINDOW_SUPERSAMPLE
    some = slice(None, None, s)  # to know the window, one sample a pixel is enough
    normals, views = points.normals[some], points.views[some]
    at = s * int(np.argmax(_light_seen(scene, normals, views, light, logarithm=True)))
    row, column = (int(index) // s for index in points.places[:, at])
    half_width, half_height = camera.tangents
    x = column - _WINDOW_PX // 2 + (np.arange(_WINDOW_PX * fine) + 0.5) / fine
    y = row - _WINDOW_PX // 2 + (np.arange(_WINDOW_PX * fine) + 0.5) / fine
    plane = np.meshgrid(
        (2 * x / camera.width - 1) * half_width, (1 - 2 * y / camera.height) * half_height
    )
    rays = np.stack([*plane, np.full(plane[0].shape, -1.0)], -1)
    rays = turned(rays, scene.view.ball_from_camera)
    u, v = (rays[..., i] / -rays[..., 2] / np.tan(scene.view.angular_radius_rad) for i in (0, 1))
    normals, views = scene.view.surface(u.ravel(), v.ravel())
    seen = _light_seen(scene, normals, views, light) * (np.hypot(u, v).ravel() <= 1)
    # Through the lens before the pixels: a light smaller than a pixel still shows where it is.
    seen = _blurred(seen.reshape(u.shape).astype(np.float32), fine)
    patch = seen.reshape(_WINDOW_PX, fine, _WINDOW_PX, fine).mean(axis=(1, 3))
    picture = np.zeros((camera.height + 2 * _WINDOW_PX, camera.width + 2 * _WINDOW_PX), np.float32)
    top, left = row + _WINDOW_PX - _WINDOW_PX // 2, column + _WINDOW_PX - _WINDOW_PX // 2
    picture[top : top + _WINDOW_PX, left : left + _WINDOW_PX] = patch
    return picture[_WINDOW_PX:-_WINDOW_PX, _WINDOW_PX:-_WINDOW_PX] * brdf.REFLECTIVITY[MIRROR]


def _light_seen(
    scene: Scene, normals: np.ndarray, views: np.ndarray, light: np.ndarray, logarithm: bool = False
) -> np.ndarray:
    """Radiance of a light with soft edges in the mirrored directions; integrates to 1 sr."""
    reflected = 2 * dot(normals, views)[..., None] * normals - views
    towards, gain = _towards(scene, normals, light)
    sharpness = 1 / scene.light_radius_rad**2
    exponent = sharpness * (dot(reflected, towards) - 1)
    if logarithm:
        return exponent
    return np.exp(exponent) * gain * sharpness / (2 * np.pi)

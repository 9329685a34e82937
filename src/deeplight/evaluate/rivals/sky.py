"""A clear sky with its sun in closed form, and the sky that explains a panorama.

Preetham, Shirley and Smits, "A practical analytic model for daylight", SIGGRAPH 1999. Hold-Geoffroy
et al. use the model of Hosek and Wilkie, which needs tables; this is its forerunner in the same
parameters: turbidity, sun direction, one scale. Radiance here is in 100 kcd/m^2 of luminance.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from deeplight.camera_response import LUMINANCE
from deeplight.frames import normalised
from deeplight.mappings import latlong

TURBIDITIES = (2.0, 10.0)
SUN_SOLID_ANGLE = 6.0e-5  # sr
SUN_ILLUMINANCE = 128.0  # klx, outside the atmosphere
LOWEST_SUN_RAD = float(np.radians(1.0))
GROUND_ALBEDO = 0.3
BRIGHTEST_PERCENTILE = 98.0

# Perez coefficients A to E of luminance Y and chromaticities x, y: slope over turbidity, offset.
_PEREZ = {
    "Y": [(0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771),
          (-0.0670, 0.3703)],
    "x": [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989),
          (-0.0033, 0.0452)],
    "y": [(-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537),
          (-0.0109, 0.0529)],
}  # fmt: skip
_ZENITH_X = np.array([
    [0.00166, -0.00375, 0.00209, 0.0],
    [-0.02903, 0.06377, -0.03202, 0.00394],
    [0.11693, -0.21196, 0.06052, 0.25886],
])  # fmt: skip
_ZENITH_Y = np.array([
    [0.00275, -0.00610, 0.00317, 0.0],
    [-0.04214, 0.08970, -0.04153, 0.00516],
    [0.15346, -0.26756, 0.06670, 0.26688],
])  # fmt: skip
_RGB_FROM_XYZ = np.array([
    [3.2404542, -1.5371385, -0.4985314],
    [-0.9692660, 1.8760108, 0.0415560],
    [0.0556434, -0.2040259, 1.0572252],
])  # fmt: skip
_WAVELENGTHS_UM = np.array([0.65, 0.55, 0.45])  # of red, green and blue for the sun's extinction

Panorama = Float[np.ndarray, "height width 3"]
Direction = Float[np.ndarray, "3"]


@dataclass(frozen=True, eq=False)
class Sky:
    """What Hold-Geoffroy et al. describe a sky by.

    Attributes:
        sun: unit direction, +Y up.
        turbidity: 2 is crystal clear, 10 hazy.
        scale: factor from the model's radiance to the panorama's.
    """

    sun: Direction
    turbidity: float
    scale: float = 1.0

    def panorama(self, height: int = 64) -> Panorama:
        """The sky, its sun, and a Lambertian ground of albedo 0.3 below the horizon.

        The sun is far smaller than a texel: its power goes into the one that holds it.
        """
        radiance = sky_radiance(latlong.directions(height, 2 * height), self.sun, self.turbidity)
        solid_angle = latlong.solid_angles(height, 2 * height)
        row, column = latlong.position(raised(self.sun)[None], height, 2 * height)
        texel = int(np.clip(np.round(row[0]), 0, height - 1)), int(np.round(column[0]))
        texel = texel[0], texel[1] % (2 * height)
        radiance[texel] += sun_irradiance(self.sun, self.turbidity) / solid_angle[texel]
        up = latlong.directions(height, 2 * height)[..., 1]
        cosine = np.maximum(up, 0) * solid_angle
        irradiance = np.einsum("ij,ijc->c", cosine, radiance)
        radiance[up < 0] = GROUND_ALBEDO * irradiance / np.pi
        return (radiance * self.scale).astype(np.float32)


def raised(sun: Direction) -> Direction:
    """The sun at least a degree above the horizon, where the model ends."""
    least = np.sin(LOWEST_SUN_RAD)
    if sun[1] >= least:
        return normalised(sun)
    level = np.array([sun[0], 0.0, sun[2]])
    level = level / max(float(np.linalg.norm(level)), 1e-9) * np.cos(LOWEST_SUN_RAD)
    return np.array([level[0], least, level[2]])


def sky_radiance(
    directions: Float[np.ndarray, "*shape 3"], sun: Direction, turbidity: float
) -> Float[np.ndarray, "*shape 3"]:
    """Linear sRGB radiance of the sky without the sun's disc; 0 below the horizon."""
    sun = raised(sun)
    zenith_angle = float(np.arccos(sun[1]))
    up = directions[..., 1].astype(np.float64)
    cosine = np.maximum(up, 0.01)
    gamma = np.arccos(np.clip(directions @ sun, -1, 1))
    at_zenith = _zenith(zenith_angle, turbidity)
    found = {
        name: at_zenith[name]
        * _perez(name, cosine, gamma, turbidity)
        / _perez(name, np.ones(1), np.full(1, zenith_angle), turbidity)
        for name in "Yxy"
    }
    luminance, x, y = (found[name] for name in "Yxy")
    xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], axis=-1) * luminance[..., None]
    rgb = np.maximum(xyz @ _RGB_FROM_XYZ.T, 0) / 100
    rgb[up <= 0] = 0
    return np.asarray(rgb)


def sun_irradiance(sun: Direction, turbidity: float) -> Float[np.ndarray, "3"]:
    """The sun's irradiance on a plane that faces it: Rayleigh and aerosol extinction."""
    height_deg = float(np.degrees(np.arcsin(raised(sun)[1])))
    mass = 1 / (np.sin(np.radians(height_deg)) + 0.15 * (3.885 + height_deg) ** -1.253)
    rayleigh = np.exp(-0.008735 * _WAVELENGTHS_UM**-4.08 * mass)
    aerosol = np.exp(-(0.04608 * turbidity - 0.04586) * _WAVELENGTHS_UM**-1.3 * mass)
    return np.asarray(SUN_ILLUMINANCE * rayleigh * aerosol / 100)


def fitted_sky(panorama: Panorama, steps: int = 81) -> Sky:
    """The sky that explains a panorama whose top is up.

    Section 4.2 of Hold-Geoffroy et al. 2017: the sun is the centre of the largest bright region
    of the sky and stays there; the scale has a closed form for each turbidity. Turbidity is
    searched over `steps` values, and texels that no sky explains (buildings, clouds) are dropped
    in three rounds, in place of their sky segmentation.
    """
    height, width, _ = panorama.shape
    directions = latlong.directions(height, width)
    sun = brightest_region(panorama)
    above = (directions[..., 1] > np.sin(np.radians(4))) & (directions @ sun < np.cos(0.2))
    usable: Bool[np.ndarray, "height width"] = above & (panorama > 0).all(-1)
    weight = latlong.solid_angles(height, width)
    candidates = np.linspace(*TURBIDITIES, steps)
    skies = [sky_radiance(directions, sun, float(t)) for t in candidates]
    best, scale = 0, 1.0
    for _ in range(3):
        losses, scales = [], []
        for sky in skies:
            share = weight[usable][:, None]
            own = float((share * panorama[usable] * sky[usable]).sum())
            own /= max(float((share * sky[usable] ** 2).sum()), 1e-12)
            scales.append(own)
            losses.append(float((share * (panorama[usable] - own * sky[usable]) ** 2).sum()))
        best = int(np.argmin(losses))
        scale = scales[best]
        modelled = np.maximum(scale * (skies[best] @ LUMINANCE), 1e-9)
        ratio = (panorama @ LUMINANCE) / modelled
        kept = above & (panorama > 0).all(-1) & (ratio > 0.5) & (ratio < 2)
        if kept.sum() < 50 or (kept == usable).all():
            break
        usable = kept
    return Sky(sun, float(candidates[best]), scale)


def brightest_region(panorama: Panorama) -> Direction:
    """Centre of the largest connected region of the sky above its 98th percentile."""
    height, width, _ = panorama.shape
    directions = latlong.directions(height, width)
    luminance = np.where(directions[..., 1] > 0, panorama @ LUMINANCE, 0)
    sky = luminance[directions[..., 1] > 0]
    threshold = float(np.percentile(sky, BRIGHTEST_PERCENTILE))
    bright = luminance > threshold
    if not bright.any():  # an even sky
        bright = luminance >= threshold
    # Twice around, so that a region behind the camera is one.
    labels, count = ndimage.label(np.concatenate([bright, bright], axis=1))
    power = luminance * latlong.solid_angles(height, width)
    twice = np.concatenate([power, power], axis=1)
    totals = ndimage.sum_labels(twice, labels, np.arange(1, count + 1))
    rows, columns = np.nonzero(labels == 1 + int(np.argmax(totals)))
    columns = columns % width
    centre = (directions[rows, columns] * power[rows, columns][:, None]).sum(0)
    return np.asarray(normalised(centre.astype(np.float64)))


def _perez(
    name: str, cosine: np.ndarray, gamma: np.ndarray, turbidity: float
) -> Float[np.ndarray, "*shape"]:
    a, b, c, d, e = (slope * turbidity + offset for slope, offset in _PEREZ[name])
    glow = 1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2
    return np.asarray((1 + a * np.exp(b / cosine)) * glow)


def _zenith(angle: float, turbidity: float) -> dict[str, float]:
    """Luminance (kcd/m^2) and chromaticity straight up, for the sun's angle from there."""
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * angle)
    luminance = (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192
    by_turbidity = np.array([turbidity**2, turbidity, 1.0])
    by_angle = np.array([angle**3, angle**2, angle, 1.0])
    return {
        "Y": max(float(luminance), 0.05),
        "x": float(by_turbidity @ _ZENITH_X @ by_angle),
        "y": float(by_turbidity @ _ZENITH_Y @ by_angle),
    }

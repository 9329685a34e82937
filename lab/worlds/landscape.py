"""Made-up open ground under a physical sky: clear, hazy or overcast, with houses and trees."""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from deeplight.mappings import latlong
from lab.worlds import paint
from lab.worlds.world import (
    Dome,
    LightGroup,
    Point,
    Sun,
    Surface,
    Texture,
    World,
    ball,
    direction_towards,
    panel,
    turned_box,
)

GROUND_M = 400.0
SOLAR_KLUX = 128.0  # above the air
RAYLEIGH = np.array([0.036, 0.088, 0.23])  # optical depth straight up: red, green, blue
HAZE = 0.045  # the same per unit of turbidity above 1
DOME_ROWS = 64


def draw_landscape(rng: np.random.Generator) -> World:
    """Open ground and its moods."""
    elevation = float(np.radians(rng.choice([rng.uniform(2, 20), rng.uniform(15, 75)])))
    towards = direction_towards(float(rng.uniform(0, 2 * np.pi)), elevation)
    turbidity = float(rng.uniform(1.5, 7.0))
    clear = clear_sky(np.array(towards), turbidity)
    illuminance = float(direct_light(elevation, turbidity) @ [0.2126, 0.7152, 0.0722])
    colour = direct_light(elevation, turbidity) / illuminance
    red, green, blue = (float(part) for part in colour)
    eye = (0.0, float(rng.uniform(1.2, 1.8)), 0.0)
    groups = {
        "sky": LightGroup([Dome(clear)]),
        "clouds": LightGroup([Dome(overcast_sky(rng))]),
        "sun": LightGroup([Sun(towards, illuminance)]),
    }
    surfaces = [_ground(rng), *_houses(rng), *_trees(rng)]
    grey = float(rng.uniform(1.0, 8.0)) * (0.15 + float(np.sin(elevation)))
    veil = float(rng.uniform(0.05, 0.5))
    moods: dict[str, dict[str, Point]] = {
        "clear": {"sky": (1, 1, 1), "sun": (red, green, blue)},
        "hazy": {
            "sky": (0.7, 0.7, 0.7),
            "clouds": (grey * 0.5,) * 3,
            "sun": (veil * red, veil * green, veil * blue),
        },
        "overcast": {"clouds": (0.96 * grey, grey, 1.05 * grey)},
    }
    return World("outdoor", eye, surfaces, groups, moods)


def direct_light(elevation_rad: float, turbidity: float) -> Float[np.ndarray, "3"]:
    """Irradiance of the sun across its direction in 1,000 lux, per channel.

    Beer's law through Rayleigh's air and grey haze; air mass by Kasten and Young 1989.
    """
    degrees = np.degrees(elevation_rad)
    air_mass = 1 / (np.sin(elevation_rad) + 0.50572 * (degrees + 6.07995) ** -1.6364)
    depth = RAYLEIGH + HAZE * (turbidity - 1)
    return np.asarray(SOLAR_KLUX * np.exp(-depth * air_mass))


def clear_sky(sun: Float[np.ndarray, "3"], turbidity: float) -> Float[np.ndarray, "rows columns 3"]:
    """Radiance of a clear sky in 1,000 cd/m2: Preetham et al. 1999, sRGB primaries, no sun disc."""
    directions = latlong.directions(DOME_ROWS, 2 * DOME_ROWS)
    up = np.clip(directions[..., 1], 0.01, 1)
    gamma = np.arccos(np.clip(directions @ sun, -1, 1))
    sun_theta = float(np.arccos(np.clip(sun[1], 0, 1)))
    values = []
    for slope, zenith in zip(_PEREZ @ [turbidity, 1.0], _zenith(sun_theta, turbidity), strict=True):
        there = _perez(slope, up, gamma)
        values.append(zenith * there / _perez(slope, np.ones(1), np.full(1, sun_theta)))
    luminance, x, y = values
    xyz = np.stack([x / y, np.ones_like(x), (1 - x - y) / y], -1) * luminance[..., None]
    sky = np.maximum(xyz @ _RGB_FROM_XYZ.T, 0)
    return np.where(directions[..., 1:2] > 0, sky, 0).astype(np.float32)


def overcast_sky(rng: np.random.Generator) -> Float[np.ndarray, "rows columns 3"]:
    """Clouds of zenith radiance 1: Moon and Spencer 1942, three times as bright above as level."""
    directions = latlong.directions(DOME_ROWS, 2 * DOME_ROWS)
    up = directions[..., 1]
    pattern = paint.noise(rng, 2 * DOME_ROWS, 0.3)[:DOME_ROWS]
    fading = np.clip(4 * up, 0, 1)  # the pattern has a seam at the back, and shrinks at the zenith
    blend = np.minimum(np.abs(np.linspace(-1, 1, 2 * DOME_ROWS)), 1)
    pattern = pattern * (1 - blend**8) * fading
    light = (1 + 2 * np.clip(up, 0, 1)) / 3 * np.exp(0.35 * pattern)
    sky = np.where(up > 0, light, 0)[..., None] * np.ones(3)
    return sky.astype(np.float32)


def _ground(rng: np.random.Generator) -> Surface:
    half = GROUND_M / 2
    kind = rng.choice(["grass", "earth", "asphalt", "paving", "sand", "snow"])
    return panel((-half, 0, half), (GROUND_M, 0, 0), (0, 0, -GROUND_M), _ground_paint(rng, kind))


def _ground_paint(rng: np.random.Generator, kind: str) -> Texture:
    fine = 1024
    if kind == "grass":
        green = np.array([0.06, 0.11, 0.03]) * rng.uniform(0.6, 1.8)
        return paint.mottled(rng, green, 0.5, 1.5, fine)
    if kind == "earth":
        return paint.mottled(rng, paint.warm(rng, (0.06, 0.25)), 0.4, 1.2, fine)
    if kind == "asphalt":
        return paint.mottled(rng, paint.colour_like(rng, (0.04, 0.15), 0.04), 0.2, 1.6, fine)
    if kind == "paving":
        cells = int(rng.integers(100, 250))
        return paint.tiled(rng, paint.colour_like(rng, (0.15, 0.5), 0.1), cells, cells, True)
    albedo = (0.75, 0.9) if kind == "snow" else (0.3, 0.5)
    colour = paint.colour_like(rng, albedo, 0.02) if kind == "snow" else paint.warm(rng, albedo)
    return paint.mottled(rng, colour, 0.12, 0.8, fine)


def _houses(rng: np.random.Generator) -> Iterator[Surface]:
    """None, a few, or a street of them."""
    for _ in range(rng.choice([0, 3, 14])):
        distance, around = rng.uniform(14, 70), rng.uniform(0, 2 * np.pi)
        wide, deep, tall = rng.uniform(6, 20), rng.uniform(6, 12), rng.uniform(4, 18)
        if distance < np.hypot(wide, deep) / 2 + 4:
            continue
        colour = (
            paint.warm(rng, (0.15, 0.6))
            if rng.random() < 0.5
            else paint.colour_like(rng, (0.2, 0.8), 0.1)
        )
        front = paint.facade(rng, colour, round(tall / 3), round(wide / 3))
        centre = (distance * np.cos(around), tall / 2, distance * np.sin(around))
        yield turned_box(centre, (wide, tall, deep), -around + np.pi / 2, front)


def _trees(rng: np.random.Generator) -> Iterator[Surface]:
    """Crowns on trunks, some near enough to give shade."""
    for _ in range(rng.choice([0, 5, 25])):
        distance, around = 4 + 40 * rng.random() ** 1.5, rng.uniform(0, 2 * np.pi)
        x, z = distance * np.cos(around), distance * np.sin(around)
        trunk, crown = rng.uniform(1.5, 3.5), rng.uniform(0.8, 2.5)
        leaves = paint.mottled(
            rng, np.array([0.05, 0.09, 0.02]) * rng.uniform(0.5, 2), 0.7, 1.6, 64
        )
        bark = paint.mottled(rng, paint.warm(rng, (0.05, 0.2)), 0.3, size=32)
        yield turned_box((x, trunk / 2, z), (0.25, trunk, 0.25), around, bark)
        if distance > crown + 1.5:
            yield ball((x, trunk + 0.7 * crown, z), crown, leaves)


def _perez(slope: np.ndarray, up: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    a, b, c, d, e = slope
    light: np.ndarray = (1 + a * np.exp(b / up)) * (
        1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2
    )
    return light


def _zenith(theta: float, turbidity: float) -> tuple[float, float, float]:
    """Luminance (1,000 cd/m2) and chromaticity straight up."""
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * theta)
    luminance = (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192
    powers = np.array([theta**3, theta**2, theta, 1.0])
    with_haze = np.array([turbidity**2, turbidity, 1.0])
    x, y = (float(with_haze @ table @ powers) for table in _ZENITH)
    return max(float(luminance), 0.1), x, y


# The appendix of Preetham, Shirley, Smits: A practical analytic model for daylight, 1999.
_PEREZ = np.array(
    [
        [0.1787, -1.4630, -0.3554, 0.4275, -0.0227, 5.3251, 0.1206, -2.5771, -0.0670, 0.3703],
        [-0.0193, -0.2592, -0.0665, 0.0008, -0.0004, 0.2125, -0.0641, -0.8989, -0.0033, 0.0452],
        [-0.0167, -0.2608, -0.0950, 0.0092, -0.0079, 0.2102, -0.0441, -1.6537, -0.0109, 0.0529],
    ]
).reshape(3, 5, 2)
_ZENITH = np.array(
    [
        [0.00166, -0.00375, 0.00209, 0.0],
        [-0.02903, 0.06377, -0.03202, 0.00394],
        [0.11693, -0.21196, 0.06052, 0.25886],
        [0.00275, -0.00610, 0.00317, 0.0],
        [-0.04214, 0.08970, -0.04153, 0.00516],
        [0.15346, -0.26756, 0.06670, 0.26688],
    ]
).reshape(2, 3, 4)
_RGB_FROM_XYZ = np.array(
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)

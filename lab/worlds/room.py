"""A made-up room: walls with windows, lamps, furniture-like boxes."""

from collections.abc import Iterator

import numpy as np

from lab.worlds import paint
from lab.worlds.world import (
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

# Radiance in 1,000 cd/m2, irradiance in 1,000 lux: windows 1 to 8, panels 2 to 8, bulbs to 60.
WINDOW, PANEL, BULB, SUN = (1.0, 8.0), (2.0, 8.0), (8.0, 60.0), (15.0, 80.0)
TILE_M = 0.35
DARK_GLASS = paint.plain((0.03, 0.03, 0.03))


def draw_room(rng: np.random.Generator) -> World:
    """A room and its moods: by day, in the evening, by night."""
    width, depth = rng.uniform(2.6, 9.0, 2)
    height = rng.uniform(2.3, 3.6)
    size = (float(width), float(height), float(depth))
    walls, windows, dark = _shell(rng, size)
    at = rng.uniform(0.25, 0.75, 2)
    eye = (float(at[0] * width), float(rng.uniform(1.0, 1.7)), float(at[1] * depth))
    furniture = list(_furniture(rng, size, eye))
    lamps, unlit = _lamps(rng, size)
    groups = {"lamps": LightGroup(lamps, {"": unlit})}
    if windows:
        groups["windows"] = LightGroup(windows, {"": dark, "sun": ()})
        towards = direction_towards(rng.uniform(0, 2 * np.pi), rng.uniform(0.15, 0.75))
        groups["sun"] = LightGroup([Sun(towards, float(rng.uniform(*SUN)))])
    return World("indoor", eye, [*walls, *furniture], groups, _moods(rng, bool(windows)))


def _moods(rng: np.random.Generator, windows: bool) -> dict[str, dict[str, Point]]:
    """Lamps of one colour; windows bright and white, dim and blue, or dark."""
    tungsten = rng.uniform(0, 1)
    lamp = np.array([1 + 0.5 * tungsten, 1.0, 1 - 0.6 * tungsten])

    def gain(colour: np.ndarray, least: float, most: float) -> Point:
        red, green, blue = colour * rng.uniform(least, most)
        return float(red), float(green), float(blue)

    night = {"lamps": gain(lamp, 0.5, 1.0)}
    if not windows:
        return {"lamps": night, "dim": {"lamps": gain(lamp * [1.1, 1, 0.8], 0.1, 0.3)}}
    white, warm, blue = np.ones(3), np.array([1.1, 1.0, 0.8]), np.array([0.6, 0.8, 1.3])
    return {
        "sunny": {"windows": gain(white, 0.5, 1.0), "sun": gain(warm, 0.3, 1.0)},
        "day": {"windows": gain(white, 0.4, 1.0), "lamps": gain(lamp, 0.0, 0.6)},
        "evening": {"windows": gain(blue, 0.02, 0.2), "lamps": gain(lamp, 0.4, 1.0)},
        "night": night,
    }


def _shell(
    rng: np.random.Generator, size: Point
) -> tuple[list[Surface], list[Surface], list[Surface]]:
    """Floor, ceiling and walls; panes that shine; panes that do not."""
    width, height, depth = size
    ceiling = paint.plain(paint.colour_like(rng, (0.5, 0.9), 0.03))
    walls = [
        panel(
            (0, 0, depth),
            (width, 0, 0),
            (0, 0, -depth),
            _floor(rng, width, depth),
            rng.random() < 0.5,
        ),
        panel((0, height, 0), (width, 0, 0), (0, 0, depth), ceiling),
    ]
    colour = paint.colour_like(rng, (0.25, 0.85), rng.choice([0.04, 0.2]))
    brightness = rng.uniform(*WINDOW)
    windows: list[Surface] = []
    dark: list[Surface] = []
    sides: list[tuple[Point, Point]] = [
        ((0, 0, 0), (width, 0, 0)), ((width, 0, 0), (0, 0, depth)),
        ((width, 0, depth), (-width, 0, 0)), ((0, 0, depth), (0, 0, -depth)),
    ]  # fmt: skip
    chance = rng.choice([0.0, 0.35, 0.6])
    for corner, across in sides:
        own = colour if rng.random() < 0.7 else paint.colour_like(rng, (0.1, 0.8), 0.25)
        texture = paint.mottled(rng, own, rng.uniform(0.01, 0.12))
        hole = _hole(rng, float(np.linalg.norm(across)), height) if rng.random() < chance else None
        walls += _wall(corner, across, height, texture, hole)
        if hole:
            out = -0.05 * np.cross(np.array(across) / np.linalg.norm(across), (0, 1, 0))
            view = paint.view_outside(rng, brightness)
            windows.append(_part(corner, across, hole, view, out, glows=True))
            dark.append(_part(corner, across, hole, DARK_GLASS, out))
    return walls, windows, dark


Hole = tuple[float, float, float, float]  # left, bottom, right, top in metres along the wall


def _hole(rng: np.random.Generator, length: float, height: float) -> Hole:
    wide = rng.uniform(0.15, 0.85) * length
    left = rng.uniform(0.05 * length, 0.95 * length - wide)
    bottom = rng.choice([0.05, 0.9]) if length > 2 else 0.9
    return float(left), float(bottom), float(left + wide), float(rng.uniform(bottom + 0.9, height))


def _wall(
    corner: Point, across: Point, height: float, texture: Texture, hole: Hole | None
) -> list[Surface]:
    """A wall, or what is left of it around a hole."""
    length = float(np.linalg.norm(across))
    parts: list[Hole] = [(0, 0, length, height)]
    if hole:
        left, bottom, right, top = hole
        parts = [
            (0, 0, left, height), (right, 0, length, height), (left, 0, right, bottom),
            (left, top, right, height),
        ]  # fmt: skip
    solid = [p for p in parts if p[2] - p[0] > 1e-3 and p[3] - p[1] > 1e-3]
    return [_part(corner, across, p, texture, np.zeros(3)) for p in solid]


def _part(
    corner: Point, across: Point, part: Hole, texture: Texture, out: np.ndarray,
    glows: bool = False,
) -> Surface:  # fmt: skip
    """A rectangle of a wall, seen from inside, moved by `out`."""
    unit = np.array(across) / np.linalg.norm(across)
    start = np.array(corner) + part[0] * unit + [0, part[1], 0] + out
    wide = (part[2] - part[0]) * unit
    tall = (0.0, part[3] - part[1], 0.0)
    return panel(tuple(start), tuple(wide), tall, texture, glows=glows)


def _floor(rng: np.random.Generator, width: float, depth: float) -> Texture:
    """Boards, tiles or carpet."""
    kind = rng.choice(["boards", "tiles", "carpet"])
    rows, columns = round(depth / TILE_M), round(width / TILE_M)
    if kind == "boards":
        return paint.tiled(rng, paint.warm(rng, (0.08, 0.5)), 3 * rows, max(2, columns // 3), True)
    if kind == "tiles":
        return paint.tiled(rng, paint.colour_like(rng, (0.1, 0.8), 0.06), rows, columns)
    return paint.mottled(rng, paint.colour_like(rng, (0.05, 0.6), 0.2), 0.15, 1.6)


def _furniture(rng: np.random.Generator, size: Point, eye: Point) -> Iterator[Surface]:
    """Boxes on the floor and thin ones on the walls, not where the camera is."""
    for _ in range(rng.integers(4, 16)):
        wide, deep = rng.uniform(0.3, 2.2), rng.uniform(0.3, 1.0)
        tall = rng.choice([rng.uniform(0.3, 0.9), rng.uniform(1.0, 2.2)])
        x, z = rng.uniform(0, size[0]), rng.uniform(0, size[2])
        if rng.random() < 0.7:  # most things stand along a wall
            x, z = (x, rng.choice([0.4, size[2] - 0.4])) if rng.random() < 0.5 else (
                rng.choice([0.4, size[0] - 0.4]), z)  # fmt: skip
        if np.hypot(x - eye[0], z - eye[2]) < 0.5 + np.hypot(wide, deep) / 2:
            continue
        colour = (
            paint.warm(rng, (0.05, 0.5))
            if rng.random() < 0.4
            else paint.colour_like(rng, (0.03, 0.8), 0.35)
        )
        texture = paint.mottled(rng, colour, rng.uniform(0.02, 0.3), size=64)
        yaw = rng.choice([0, np.pi / 2, rng.uniform(0, np.pi)])
        yield turned_box((x, tall / 2, z), (wide, tall, deep), yaw, texture, rng.random() < 0.4)
        if tall < 0.9 and rng.random() < 0.5:
            little = paint.mottled(rng, paint.colour_like(rng, (0.03, 0.8), 0.4), 0.2, size=32)
            yield turned_box((x, tall + 0.1, z), (0.25, 0.2, 0.15), rng.uniform(0, 3), little)


def _lamps(rng: np.random.Generator, size: Point) -> tuple[list[Surface], list[Surface]]:
    """Lamps that shine and the same ones switched off."""
    width, height, depth = size
    lamps: list[Surface] = []
    off = paint.plain((0.6, 0.6, 0.6))
    unlit: list[Surface] = []
    kind = rng.choice(["panels", "bulbs", "both"])
    if kind in ("panels", "both"):
        glow = paint.plain([rng.uniform(*PANEL)] * 3)
        rows, columns = rng.integers(1, 4, 2)
        wide, deep = rng.uniform(0.15, 1.2), rng.uniform(0.15, 0.6)
        for row, column in np.ndindex(rows, columns):
            x = width * (column + 0.5) / columns - wide / 2
            z = depth * (row + 0.5) / rows - deep / 2
            place: Point = (x, height - 0.01, z)
            lamps.append(panel(place, (wide, 0, 0), (0, 0, deep), glow, glows=True))
            unlit.append(panel(place, (wide, 0, 0), (0, 0, deep), off))
    if kind in ("bulbs", "both"):
        glow = paint.plain([rng.uniform(*BULB)] * 3)
        for _ in range(rng.integers(1, 4)):
            radius = rng.uniform(0.05, 0.16)
            place = (
                rng.uniform(0.1, 0.9) * width, rng.uniform(0.5, 0.85) * height,
                rng.uniform(0.1, 0.9) * depth,
            )  # fmt: skip
            lamps.append(ball(place, radius, glow, glows=True))
            unlit.append(ball(place, radius, off))
    return lamps, unlit

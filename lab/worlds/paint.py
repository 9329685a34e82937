"""Textures of made-up places: boards, tiles, plaster, grass, facades, skies behind windows."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from lab.worlds.world import Texture

Colour = Float[np.ndarray, "3"]

DARKEST, BRIGHTEST = 0.02, 0.92  # of albedos: nothing is black, snow is 0.9


def plain(colour: Sequence[float] | Colour) -> Texture:
    """One colour."""
    return np.array(colour, np.float64).reshape(1, 1, 3)


def colour_like(rng: np.random.Generator, albedo: tuple[float, float], chroma: float) -> Colour:
    """An albedo in a range, `chroma` being the standard deviation of its channels' logarithms."""
    tint = np.exp(rng.normal(0, chroma, 3))
    return np.clip(rng.uniform(*albedo) * tint / tint.mean(), DARKEST, BRIGHTEST)


def warm(rng: np.random.Generator, albedo: tuple[float, float]) -> Colour:
    """Wood, brick, earth."""
    warmth = rng.uniform(0.3, 1.0)
    ramp = np.array([1 + 0.45 * warmth, 1.0, 1 - 0.5 * warmth])
    return np.clip(rng.uniform(*albedo) * ramp, DARKEST, BRIGHTEST)


def noise(
    rng: np.random.Generator, size: int, roughness: float
) -> Float[np.ndarray, "rows columns"]:
    """Fractal noise of mean 0 and standard deviation 1; small `roughness` is cloudier."""
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    frequency[0, 0] = np.inf
    spectrum = np.fft.fft2(rng.standard_normal((size, size))) * frequency ** (roughness - 2)
    values = np.fft.ifft2(spectrum).real
    return np.asarray((values - values.mean()) / max(values.std(), 1e-12))


def mottled(
    rng: np.random.Generator,
    colour: Colour,
    contrast: float,
    roughness: float = 1.0,
    size: int = 128,
) -> Texture:
    """Plaster, concrete, grass, carpet."""
    shade = np.exp(contrast * noise(rng, size, roughness))[..., None]
    hue = np.exp(0.2 * contrast * rng.standard_normal((size, size, 3)))
    return np.clip(colour * shade * hue, DARKEST, BRIGHTEST)


def tiled(
    rng: np.random.Generator, colour: Colour, rows: int, columns: int, bond: bool = False
) -> Texture:
    """Tiles, boards, bricks: cells of slightly different shade between joints."""
    rows, columns = max(1, rows), max(1, columns)
    cell = max(4, min(16, 256 // max(rows, columns)))
    shade = np.exp(0.18 * rng.standard_normal((rows, columns)))
    cells = np.repeat(np.repeat(shade, cell, 0), cell, 1)
    down, across = np.indices(cells.shape)
    shift = (down // cell % 2) * (cell // 2) if bond else 0
    cells = np.take_along_axis(cells, (across + shift) % cells.shape[1], 1)
    joint = (down % cell == 0) | ((across + shift) % cell == 0)
    cells = np.where(joint, rng.uniform(0.4, 1.2), cells)
    return np.clip(colour * cells[..., None], DARKEST, BRIGHTEST)


def facade(rng: np.random.Generator, colour: Colour, storeys: int, windows: int) -> Texture:
    """A house front: dark panes in a wall."""
    cell, pane = 12, np.zeros((12, 12), bool)
    top, left = rng.integers(2, 5, 2)
    pane[top : 12 - 2, left : 12 - left] = True
    panes = np.tile(pane, (max(1, storeys), max(1, windows)))
    glass = rng.uniform(0.03, 0.2) * np.array([0.8, 0.9, 1.0])
    wall = mottled(rng, colour, 0.1, size=cell)
    wall = np.tile(wall, (max(1, storeys), max(1, windows), 1))
    return np.clip(np.where(panes[..., None], glass, wall), DARKEST, BRIGHTEST)


def view_outside(rng: np.random.Generator, brightness: float) -> Texture:
    """Radiance seen through a window: sky above, something darker below."""
    size, horizon = 64, rng.uniform(-0.1, 0.7)
    height = np.linspace(1, 0, size)[:, None, None]
    grey = rng.uniform(0, 1)
    sky = np.array([0.75, 0.9, 1.2]) * (1 - grey) + grey
    ground = colour_like(rng, (0.08, 0.4), 0.25)
    above = height > horizon + 0.05 * noise(rng, size, 0.6)[0, None, :, None]
    shade = np.exp(0.25 * noise(rng, size, 0.8))[..., None]
    light = np.where(above, sky * (0.8 + 0.4 * height), ground * shade)
    return np.asarray(brightness * light)

"""Film three spheres in front of a bare panorama: a simulator that shares nothing with `lab.film`.

python -m lab.plain_films --hdri panoramas --out data/plain --clips 24

The camera turns in one place and the picture is the panorama as it is, blurred by its own few
texels; three spheres of one size hang in any order over whatever is below, on thin rods or on
nothing. It is here so that `capture` is not tuned to one simulator. Each CLIP.truth.json holds
what `python -m lab.evidence.capture_accuracy` asks for.
"""

import json
import sys
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from deeplight import brdf
from deeplight.camera import PinholeCamera
from deeplight.cli.main import run_command
from deeplight.frames import normalised, world_from_camera
from deeplight.io.atomic import replacing
from deeplight.io.environment_file import read_environment
from deeplight.io.video_writer import VideoWriter
from deeplight.mappings import latlong, resample
from deeplight.sphere import SPHERES

CROP = 64  # pixels along a sphere's shading
LIGHTS = 32  # rows of the panorama that lights the two rough spheres


@dataclass(frozen=True)
class Args:
    """Settings of `python -m lab.plain_films`."""

    hdri: Path
    """Folder of panoramas."""
    out: Path
    """Folder of the clips."""
    places: tuple[str, ...] = ()
    """Words of which a panorama's name must hold one; left out, all are filmed in."""
    clips: int = 12
    """How many."""
    frames: int = 24
    """Of each clip, 30 a second."""
    hard: bool = False
    """Dark or bright exposures, a tone curve, defocused spheres, lamps near the rig, noise."""
    dark: bool = False
    """Two and a half to four stops too dark, with a tone curve and noise, instead."""
    lit: bool = False
    """Lamps near the rig, of any colour and hidden from some spheres; spheres of other paints; a
    drifting exposure."""
    missing: bool = False
    """One of the three spheres is left out: a clip to be refused."""
    stops: tuple[float, float] = (0.0, 0.0)
    """Brighter by so much, drawn between the two."""
    seed: int = 0
    """Of everything else: order, size and place of the spheres, camera, exposure, movement."""


@dataclass(frozen=True)
class Place:
    """A panorama, and what spheres of reflectivity 1 show of it.

    Attributes:
        panorama: radiance.
        shown: of each sphere, by the normal of the diffuse one and by the reflected direction of
            the others (the silver one's lobe as if seen from straight ahead): small panoramas.
    """

    panorama: np.ndarray
    shown: dict[str, np.ndarray]


@dataclass(frozen=True)
class Lamp:
    """A round lamp near the rig.

    Attributes:
        at: from the camera in the world, in the spheres' radii.
        power: irradiance of a surface at the rig that faces it, over pi; red, green, blue.
        half_width_rad: half of its width as the rig sees it.
        hidden_from: spheres in shadow.
    """

    at: np.ndarray
    power: np.ndarray
    half_width_rad: float = 0.05
    hidden_from: tuple[str, ...] = ()


@dataclass(frozen=True)
class Setup:
    """What one clip is filmed with; directions in the camera's frame."""

    camera: PinholeCamera
    centres: dict[str, np.ndarray]
    radius_rad: float
    gain: float
    rods: bool
    noise: float = 1.5
    contrast: float = 0.0
    blur_px: float = 0.5
    lamps: tuple[Lamp, ...] = ()
    tints: dict[str, np.ndarray] = field(default_factory=dict)
    adapts: float = 0.0  # stops that the exposure drifts by from the first frame to the last


def run(args: Args) -> None:
    """Film the clips that are not there."""
    files = sorted(path for path in args.hdri.glob("*.exr") if named(path.stem, args.places))
    order = np.random.default_rng(args.seed).permutation(len(files))
    for number in range(args.clips):
        source = files[order[number % len(files)]]
        clip = args.out / f"{number:03d}-{source.stem}.mp4"
        if not clip.with_suffix(".truth.json").exists():
            film(source, clip, args, np.random.default_rng([args.seed, number]))
            print(clip, flush=True)


def named(name: str, words: tuple[str, ...]) -> bool:
    """Whether a name holds one of the words."""
    return not words or any(word in name for word in words)


def film(source: Path, clip: Path, args: Args, rng: np.random.Generator) -> None:
    """Film one clip; its truth is written last."""
    place = place_of(source, rng.uniform(0.2, 0.4))
    turns = walk(args.frames, rng)
    setup = drawn_setup(place.panorama, turns, rng)
    for wanted, drawn in ((args.dark, darkened), (args.hard, troubled), (args.lit, lit)):
        setup = drawn(setup, rng) if wanted else setup
    setup = replace(setup, gain=setup.gain * 2 ** rng.uniform(*args.stops))
    if args.missing:
        setup.centres.pop(str(rng.choice(SPHERES)))
    with VideoWriter(clip, setup.camera.width, setup.camera.height, 30) as video:
        for n, turn in enumerate(turns):
            drift = 2 ** (setup.adapts * (n / max(1, len(turns) - 1) - 0.5))
            seen = pixels(place, turn, setup, setup.gain * drift)
            noise = setup.noise * rng.standard_normal((*seen.shape[:2], 1), np.float32)
            video.write(np.clip(seen + noise, 0, 255).astype(np.uint8))
    camera = setup.camera
    fov = float(np.degrees(camera.vertical_fov_rad))
    spheres: dict[str, dict[str, Any]] = {
        name: {"direction": at.tolist(), "angular_radius_rad": setup.radius_rad}
        for name, at in setup.centres.items()
    }
    truth = {
        "camera": {"width": camera.width, "height": camera.height, "vertical_fov_deg": fov},
        "place": source.stem, "rig": {"spheres": spheres},
    }  # fmt: skip
    with replacing(clip.with_suffix(".truth.json")) as temporary:
        temporary.write_text(json.dumps(truth, indent=1) + "\n")


def place_of(source: Path, roughness: float) -> Place:
    """Read a panorama and light the rough spheres with it."""
    panorama = read_environment(source, max_height=512).radiance.astype(np.float32)
    small = resample.shrink_latlong(panorama, LIGHTS)
    lights = latlong.directions(*small.shape[:2]).reshape(-1, 3)
    solid_angles = latlong.solid_angles(*small.shape[:2]).reshape(-1, 1)
    cosine, shown = lights @ lights.T, {"mirror": panorama}
    lobes = {
        "diffuse": brdf.lambertian(cosine),
        "matte_silver": brdf.rough_specular(cosine, np.ones_like(cosine), cosine, roughness),
    }
    for name, weights in lobes.items():
        power = weights @ (small.reshape(-1, 3) * solid_angles) / (weights @ solid_angles)
        shown[name] = power.reshape(small.shape).astype(np.float32)
    return Place(panorama, shown)


def walk(frames: int, rng: np.random.Generator) -> list[np.ndarray]:
    """world_from_camera of each frame: a slow pan with a hand's tremor, looking a little down."""
    yaw, pitch = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(-28, 2))
    speed = np.radians(rng.uniform(15, 50)) / 30 * rng.choice([-1, 1])
    tremor = np.cumsum(rng.normal(0, np.radians(0.15), (frames, 3)), axis=0)
    wave = np.radians(rng.uniform(0, 6)) * np.sin(np.arange(frames) / frames * 2 * np.pi)
    return [
        world_from_camera(
            yaw + speed * n + tremor[n, 0], pitch + wave[n] + tremor[n, 1], tremor[n, 2]
        )
        for n in range(frames)
    ]


def drawn_setup(panorama: np.ndarray, turns: list[np.ndarray], rng: np.random.Generator) -> Setup:
    """Draw the camera, the rig and an exposure that suits the first frame."""
    width = int(rng.choice([480, 540, 720], p=[0.4, 0.4, 0.2]))
    camera = PinholeCamera(width, 2 * (width * 8 // 9), np.radians(rng.uniform(58, 72)))
    half_width, half_height = camera.tangents
    radius = np.radians(rng.uniform(2.0, 5.0))
    apart = min(rng.uniform(2.3, 4.0) * np.tan(radius), 0.8 * half_width)
    row = -half_height * rng.uniform(0.55, 0.85)
    centres = {}
    for name, place in zip(rng.permutation(SPHERES), (-1, 0, 1), strict=True):
        at = np.array([place * apart, row + rng.normal(0, 0.01), -1.0])
        centres[str(name)] = at / np.linalg.norm(at)
    rays = camera.rays()[::16, ::16].reshape(-1, 3) @ turns[0].T
    bright = resample.sample_latlong(panorama, rays.astype(np.float32)).mean(axis=1)
    gain = float(rng.uniform(0.12, 0.3) / np.median(bright))
    return Setup(camera, centres, radius, gain, bool(rng.random() < 0.5))


def troubled(setup: Setup, rng: np.random.Generator) -> Setup:
    """Draw what makes a clip hard; each in half of them."""
    draws = rng.random(5) < 0.5
    lamp = normalised(rng.normal(size=3) + [0, 0.6, 0.3]) * rng.uniform(8, 25)
    return replace(
        setup,
        gain=setup.gain * (2 ** rng.uniform(-2, 1) if draws[0] else 1),
        contrast=rng.uniform(0.3, 1) if draws[1] else 0,
        blur_px=rng.uniform(1, 3) * setup.camera.width / 1080 if draws[2] else 0.5,
        noise=rng.uniform(2, 5) if draws[3] else 1.5,
        lamps=(Lamp(lamp, np.full(3, rng.uniform(0.5, 3) / setup.gain)),) if draws[4] else (),
    )


def lit(setup: Setup, rng: np.random.Generator) -> Setup:
    """Draw lamps near the rig, spheres of other paints, a small picture and a drifting exposure."""
    lamps = []
    for _ in range(int(rng.integers(1, 5))):
        at = normalised(rng.normal(size=3) + [0, 0.8, 0.3]) * rng.uniform(5, 30)
        colour = rng.uniform([0.7, 0.5, 0.3], [1.3, 1.0, 1.2])
        power = np.exp(rng.uniform(np.log(0.2), np.log(3))) / setup.gain * colour
        hidden = tuple(str(name) for name in SPHERES if rng.random() < 0.12)
        lamps.append(Lamp(at, power, float(np.exp(rng.uniform(-4.6, -1.8))), hidden))
    paints = {"mirror": (0.7, 1.1), "matte_silver": (0.7, 1.4), "diffuse": (0.8, 2.4)}
    tints = {n: rng.uniform(*limits) * rng.uniform(0.94, 1.06, 3) for n, limits in paints.items()}
    return replace(
        setup, lamps=tuple(lamps), tints=tints,
        gain=setup.gain * 2 ** rng.uniform(-2.5, 0.5),
        contrast=rng.uniform(0, 1), noise=rng.uniform(1, 3.5), blur_px=rng.uniform(0.5, 1.6),
        adapts=rng.uniform(-1, 1),
    )  # fmt: skip


def darkened(setup: Setup, rng: np.random.Generator) -> Setup:
    """Draw a picture that is far too dark."""
    return replace(
        setup,
        gain=setup.gain * 2 ** rng.uniform(-4.2, -2.5),
        contrast=rng.uniform(0.3, 1),
        noise=rng.uniform(2, 4.5),
        blur_px=rng.uniform(0.5, 1.5),
    )


def pixels(place: Place, turn: np.ndarray, setup: Setup, gain: float) -> np.ndarray:
    """Grey levels of one frame, 0 to 255, not rounded."""
    rays = rays_of(setup.camera)
    radiance = looked_up(place.panorama, rays @ turn.T.astype(np.float32))
    if setup.rods:
        radiance = with_rods(radiance, setup)
    for name, centre in setup.centres.items():
        paint(radiance, rays, name, centre, place, turn, setup)
    level = np.clip(radiance * np.float32(gain), 0, 1) ** np.float32(1 / 2.2)
    curved = level * level * (3 - 2 * level)
    return np.asarray(255 * (level + setup.contrast * (curved - level)))


@lru_cache(maxsize=1)
def rays_of(camera: PinholeCamera) -> np.ndarray:
    """Give the camera's rays in single precision, kept from frame to frame."""
    return camera.rays().astype(np.float32)


def looked_up(panorama: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Look a panorama up as `resample.sample_latlong` does, many times faster."""
    row, column = latlong.position(directions, *panorama.shape[:2])
    wide = np.concatenate([panorama[:, -1:], panorama, panorama[:, :1]], axis=1)
    at = (column + 1).astype(np.float32), row.astype(np.float32)
    border = cv2.BORDER_REPLICATE
    return np.asarray(cv2.remap(wide, *at, cv2.INTER_LINEAR, borderMode=border))


def with_rods(radiance: np.ndarray, setup: Setup) -> np.ndarray:
    """Draw a dark rod from each sphere down to the edge of the picture."""
    camera = setup.camera
    for centre in setup.centres.values():
        row, column = (float(a[0]) for a in camera.pixel_of_directions(centre[None]))
        half = max(1, round(0.006 * camera.width))
        left = round(column) - half
        radiance[round(row) :, max(left, 0) : left + 2 * half] = 0.02 / setup.gain
    return radiance


def paint(
    radiance: np.ndarray, rays: np.ndarray, name: str, centre: np.ndarray, place: Place,
    turn: np.ndarray, setup: Setup,
) -> None:  # fmt: skip
    """Draw one sphere over the picture, its outline one pixel wide."""
    distance = 1 / np.sin(setup.radius_rad)
    cosine = rays @ centre.astype(np.float32)
    pixel = 2 * setup.camera.tangents[1] / setup.camera.height
    rows, columns = np.nonzero(cosine > np.cos(setup.radius_rad + 3 * pixel * setup.blur_px))
    angle = np.arccos(np.minimum(cosine[rows, columns].astype(float), 1))
    cover = np.clip((setup.radius_rad - angle) / (2 * pixel * setup.blur_px) + 0.5, 0, 1)
    toward = rays[rows, columns].astype(float)
    along = distance * (toward @ centre)
    root = np.sqrt(np.maximum(along**2 - distance**2 + 1, 0))
    normals = (along - root)[:, None] * toward - distance * centre
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    shown = shade(name, normals, -toward, place, turn)
    for lamp in setup.lamps:
        if name not in lamp.hidden_from:
            shown += lamp_light(name, normals, -toward, turn.T @ lamp.at - distance * centre, lamp)
    shown *= setup.tints.get(name, 1.0)
    share = cover[:, None]
    radiance[rows, columns] = share * shown + (1 - share) * radiance[rows, columns]


def lamp_light(
    name: str, normals: np.ndarray, views: np.ndarray, at: np.ndarray, lamp: Lamp
) -> np.ndarray:
    """Give the radiance that a lamp near the rig adds; `at` from the sphere's centre, in radii."""
    toward = at - normals
    distance = np.linalg.norm(toward, axis=1, keepdims=True)
    toward /= distance
    power = np.pi * lamp.power * (np.linalg.norm(at) / distance) ** 2
    cosine = (normals * toward).sum(axis=1, keepdims=True)
    if name == "mirror":
        reflected = 2 * (normals * views).sum(axis=1, keepdims=True) * normals - views
        disc = (reflected * toward).sum(axis=1, keepdims=True) > np.cos(lamp.half_width_rad)
        weight = disc / (np.pi * lamp.half_width_rad**2)
    elif name == "diffuse":
        weight = brdf.lambertian(cosine)
    else:
        n_v = (normals * views).sum(axis=1, keepdims=True)
        weight = brdf.rough_specular(cosine, n_v, (toward * views).sum(axis=1, keepdims=True))
    return np.asarray(brdf.REFLECTIVITY[name] * power * weight)


def shade(
    name: str, normals: np.ndarray, views: np.ndarray, place: Place, turn: np.ndarray
) -> np.ndarray:
    """Give the radiance of points of a sphere; normals and views in the camera's frame."""
    reflected = 2 * (normals * views).sum(axis=1, keepdims=True) * normals - views
    asked = (normals if name == "diffuse" else reflected) @ turn.T
    shown = resample.sample_latlong(place.shown[name], asked.astype(np.float32))
    return np.asarray(brdf.REFLECTIVITY[name] * shown)


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.plain_films", sys.modules[__name__], sys.argv[1:]))

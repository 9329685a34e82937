"""A virtual light stage: one photograph of a sphere under each light, to test what reads them.

    write_light_stage(Path("stage"), LightStage())

The folder is what `deeplight reflectance` takes, with truth.json next to it. The paper's stage
has white LEDs 12 degrees apart at the equator; how the rings lie and how many lights that makes
is our choice. Run again after a kill, it goes on with the photographs that are missing.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32

from deeplight.camera import PinholeCamera
from deeplight.errors import ConfigError
from deeplight.frames import looking_at
from deeplight.io.light_stage_file import (
    CAMERA_JSON,
    LIGHTS_JSON,
    StageLights,
    write_json,
    write_lights,
)
from deeplight.io.photograph import write_photograph
from deeplight.sphere import SphereView
from lab.light_stage.photograph import (
    MIRROR,
    Points,
    Scene,
    in_white_light,
    photographed,
    points_of,
    reflectivity_of,
)
from lab.light_stage.surfaces import SURFACES

TRUTH = "truth.json"
AMBIENT = 2e-4  # radiance left in the dark room, for a light of irradiance 1
HOT = 0.002  # the sensor's offset, as a share of white
DARK_FRAMES = 8  # averaged into the one dark frame
BRIGHTEST = 0.75  # of white, in the brightest photograph of a sphere


@dataclass(frozen=True)
class LightStage:
    """Settings of the virtual stage.

    Attributes:
        materials: spheres to photograph: mirror, matte_silver, diffuse, phong, plastic.
        spacing_deg: between lights of the ring at the equator.
        light_distance_m: from the sphere's centre to the lights.
        camera_distance_m: from the camera to the sphere's centre.
        sphere_radius_m: of every sphere.
        photo_px: size of the square photographs.
        supersample: samples along a pixel.
        intensity_spread, colour_spread: standard deviation of the lights' natural logarithm.
        full_well: electrons of white; 0 is a sensor without noise.
        read_noise: electrons.
        lowest_deg: latitude below which the stage has no lights.
        suffix: .png (16 bits, linear) or .exr.
        seed: of colours and noise.
    """

    materials: tuple[str, ...] = ("mirror", "matte_silver", "diffuse")
    spacing_deg: float = 12.0
    light_distance_m: float = 1.2
    camera_distance_m: float = 1.5
    sphere_radius_m: float = 0.04
    photo_px: int = 192
    supersample: int = 4
    intensity_spread: float = 0.1
    colour_spread: float = 0.03
    full_well: float = 20_000.0
    read_noise: float = 3.0
    lowest_deg: float = -90.0
    suffix: str = ".png"
    seed: int = 0

    def __post_init__(self) -> None:
        known = {MIRROR, *SURFACES}
        unknown = [name for name in self.materials if name not in known]
        if unknown or not self.materials:
            got = f"{unknown[0] if unknown else 'none'}"
            raise ConfigError(f"materials of {sorted(known)}", got, "name a known one")
        if self.suffix not in (".png", ".exr"):
            raise ConfigError("suffix .png or .exr", self.suffix, "choose one")
        if not 2 <= self.spacing_deg <= 60 or self.photo_px < 16 or self.supersample < 1:
            got = f"{self.spacing_deg} degrees, {self.photo_px} px, {self.supersample} samples"
            expected = "lights 2 to 60 degrees apart, photographs from 16 px, from 1 sample"
            raise ConfigError(expected, got, "change the numbers")
        nearest = min(self.light_distance_m, self.camera_distance_m)
        if not 0 < 1.2 * self.sphere_radius_m < nearest:
            got = f"a radius of {self.sphere_radius_m} m, {nearest} m away"
            raise ConfigError("lights and camera well outside the sphere", got, "move them")
        if min(self.full_well, self.read_noise, self.intensity_spread, self.colour_spread) < 0:
            raise ConfigError("noise and spread of at least 0", "less", "change the numbers")

    def scene(self) -> Scene:
        """The camera and the sphere, a little off its axis."""
        angular = float(np.arcsin(self.sphere_radius_m / self.camera_distance_m))
        half = 1.35 * np.tan(angular)
        camera = PinholeCamera(self.photo_px, self.photo_px, float(2 * np.arctan(half)))
        direction = np.array([0.11 * half, -0.07 * half, -1.0])
        view = SphereView(looking_at(direction), angular)
        return Scene(
            camera, view, self.sphere_radius_m, self.light_distance_m,
            float(np.radians(0.4)), self.supersample,
        )  # fmt: skip


def rings(spacing_deg: float, lowest_deg: float = -90.0) -> Float[np.ndarray, "lights 3"]:
    """Directions of lights in rings of latitude, each as dense as the equator.

    Neighbouring rings are nearer than the lights in them and shifted by half a step, so that
    every light has six neighbours; 12 degrees give 344 lights. The camera looks through
    between two lights of the equator.
    """
    count = 2 * max(1, round(90 / (spacing_deg * np.sqrt(3) / 2)))
    directions = []
    for number in range(count + 1):
        latitude = np.pi * (number / count - 0.5)
        if np.degrees(latitude) < lowest_deg - 1e-6:
            continue
        lights = max(1, round(360 / spacing_deg * np.cos(latitude)))
        shift = 0.5 * ((number + count // 2 + 1) % 2)
        around = (np.arange(lights) + shift) * (2 * np.pi / lights)
        level, up = np.cos(latitude), np.full(lights, np.sin(latitude))
        directions.append(np.stack([level * np.sin(around), up, level * np.cos(around)], -1))
    return np.concatenate(directions)


def lights_of(stage: LightStage) -> StageLights:
    """The stage's lights with their colours, as measured without error."""
    directions = rings(stage.spacing_deg, stage.lowest_deg)
    rng = np.random.default_rng([stage.seed, 1])
    intensity = np.exp(stage.intensity_spread * rng.standard_normal((len(directions), 1)))
    colours = intensity * np.exp(stage.colour_spread * rng.standard_normal((len(directions), 3)))
    files = tuple(f"light_{number:03d}{stage.suffix}" for number in range(len(directions)))
    return StageLights(files, directions, colours, stage.light_distance_m, calibrated=True)


def write_light_stage(
    folder: Path, stage: LightStage, advance: Callable[[int], None] = lambda n: None
) -> StageLights:
    """Photograph every sphere under every light; give the lights.

    Args:
        advance: called with the number of photographs just done.

    Raises:
        ConfigError: the folder holds photographs of other settings.
        OSError: a file cannot be written.
    """
    lights, scene = lights_of(stage), stage.scene()
    points = points_of(scene)
    settings = json.loads(json.dumps(asdict(stage)))
    truth = folder / TRUTH
    if truth.exists() and json.loads(truth.read_text(encoding="utf-8")).get("stage") != settings:
        raise ConfigError(f"the settings that {truth} began with", "others", "use another folder")
    exposure = {name: _exposure(scene, points, name, lights) for name in stage.materials}
    write_json(truth, {"stage": settings, "spheres": _truth(stage, scene)})
    write_lights(folder / LIGHTS_JSON, lights)
    write_json(folder / CAMERA_JSON, {
        "vertical_fov_deg": float(np.degrees(scene.camera.vertical_fov_rad)), "gamma": 1.0,
        "sphere_radius_m": stage.sphere_radius_m, "exposure": exposure,
    })  # fmt: skip
    for name in stage.materials:
        _photograph_sphere(folder / name, name, stage, lights, exposure[name], advance)
    return lights


def photographs_of(stage: LightStage) -> int:
    """How many photographs under single lights the stage makes."""
    return len(stage.materials) * len(rings(stage.spacing_deg, stage.lowest_deg))


def _photograph_sphere(
    folder: Path, name: str, stage: LightStage, lights: StageLights, exposure: float,
    advance: Callable[[int], None],
) -> None:  # fmt: skip
    scene = stage.scene()
    points = points_of(scene)
    assert lights.directions is not None
    assert lights.colours is not None
    room = in_white_light(scene, points, reflectivity_of(name))[..., None] * np.ones(3)
    sensor = _Sensor(
        stage, room * AMBIENT * exposure, list(SURFACES).index(name) if name in SURFACES else 99
    )
    dark = np.mean([sensor.read(0 * room, (1, n)) for n in range(DARK_FRAMES)], axis=0)
    write_photograph(folder / f"dark{stage.suffix}", dark.astype(np.float32))
    if name == MIRROR:  # lights are points in it: its outline shows in a lit room only
        write_photograph(folder / f"outline{stage.suffix}", sensor.read(0.7 * room, (2, 0)))
    for number, (file, light) in enumerate(zip(lights.files, lights.directions, strict=True)):
        if not (folder / file).exists():
            shown = photographed(scene, points, name, light)[..., None] * lights.colours[number]
            write_photograph(folder / file, sensor.read(shown * exposure, (3, number)))
        advance(1)


class _Sensor:
    """A sensor: the dark room, the hot offset of each pixel, shot and read noise."""

    def __init__(self, stage: LightStage, ambient: np.ndarray, number: int) -> None:
        self.stage, self.ambient, self.number = stage, ambient, number
        rng = np.random.default_rng([stage.seed, 2])
        self.offset = HOT * rng.exponential(1.0, ambient.shape)

    def read(
        self, values: np.ndarray, key: tuple[int, int]
    ) -> Float32[np.ndarray, "rows columns 3"]:
        """One photograph of linear values; the same key gives the same noise."""
        full = self.stage.full_well
        signal = values + self.ambient
        if full > 0:
            rng = np.random.default_rng([self.stage.seed, 3, self.number, *key])
            noise = np.sqrt(np.maximum(signal, 0) * full + self.stage.read_noise**2) / full
            signal = signal + noise * rng.standard_normal(signal.shape)
        return np.minimum(signal + self.offset, 1.0).astype(np.float32)


def _exposure(scene: Scene, points: Points, name: str, lights: StageLights) -> float:
    """What brings the brightest of some photographs to `BRIGHTEST` of white."""
    assert lights.directions is not None
    assert lights.colours is not None
    some = range(0, len(lights.files), max(1, len(lights.files) // 40))
    peaks = [
        photographed(scene, points, name, lights.directions[n]).max() * lights.colours[n].max()
        for n in some
    ]
    return float(BRIGHTEST / max(peaks))


def _truth(stage: LightStage, scene: Scene) -> dict[str, dict[str, object]]:
    (row,), (column,) = scene.camera.pixel_of_directions(-scene.view.ball_from_camera[2:])
    sphere = {
        "direction": (-scene.view.ball_from_camera[2]).tolist(),
        "angular_radius_rad": scene.view.angular_radius_rad,
        "centre_px": [float(column), float(row)],
    }
    return {name: {**sphere, "reflectivity": reflectivity_of(name)} for name in stage.materials}

"""One clip: a hand, a rig, a phone's automatics and a shutter in one place, frame by frame."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, UInt8, UInt16

from deeplight.camera import PinholeCamera
from deeplight.camera_response import GAMMA
from deeplight.frames import Rotation, rotation
from deeplight.io.colour import hlg_pixels
from deeplight.mappings.resample import turned_ball
from deeplight.simulate.phone import (
    PHONES,
    CameraAutomatics,
    Setting,
    draw_automatics,
    follow,
    metered,
)
from deeplight.sphere import SPHERES
from lab.film.hand import Hand, draw_hand
from lab.film.overlay import Solid, finger_in_picture
from lab.film.picture import FrameMaker
from lab.film.recipe import FilmRecipe
from lab.film.reflections import Place, Reflections
from lab.film.rig import FilmRig, draw_rig
from lab.film.scenery import Scenery, spread
from lab.film.world import DOME_M, build_world, noise_tile

SIDEWAYS = rotation("z", np.pi / 2)  # upright landscape frame from the phone's own

_BLUR_STEP_PX, _MOST_STEPS = 3.0, 6  # a shutter's sub-frames: one for this number of pixels
_MIRROR_STEP_PX = 40.0  # the same for the mirror, in which the place moves that much slower
_SHUTTER_S = {"indoor": (1 / 120, 1 / 50), "outdoor": (1 / 1000, 1 / 200)}
_SLOWER = 0.12  # `CameraAutomatics.speed` is of frames far apart; film is smooth


@dataclass(frozen=True, eq=False)
class FilmFrame:
    """One frame, upright.

    Attributes:
        time_s: when it is shown.
        pixels: 8-bit, or the 16-bit HLG signal.
        crops: 8-bit, in the order of `SPHERES`, in each sphere's own frame.
        log_gain: what the automatics had set: gain on scene radiance, whole-frame.
        world_from_camera, position_m: in the middle of the exposure.
        motion_blur_px: how far the place moved meanwhile.
        dropped: the phone lost it: it is not in the file.
        covered: share of each sphere that a finger hides.
        true_lighting: at the rig, relative to white, upright camera's frame; now and then.
    """

    time_s: float
    pixels: UInt8[np.ndarray, "height width 3"] | UInt16[np.ndarray, "height width 3"]
    crops: UInt8[np.ndarray, "3 size size 3"]
    log_gain: tuple[float, float, float]
    world_from_camera: Rotation
    position_m: Float[np.ndarray, "3"]
    motion_blur_px: float
    dropped: bool
    covered: dict[str, float]
    true_lighting: Float[np.ndarray, "light light 3"] | None


class Clip:
    """Everything about one clip that its frames share."""

    def __init__(
        self,
        panorama: Float[np.ndarray, "height width 3"],
        scene: str,
        recipe: FilmRecipe,
        troubles: tuple[str, ...],
        seed: list[int],
    ) -> None:
        """Draw the clip.

        Args:
            panorama: radiance of the place, in any scale.
            scene: "indoor" or "outdoor".
            recipe: what to film.
            troubles: of `TROUBLES`.
            seed: decides everything.
        """
        rng = np.random.default_rng([*seed, 0])
        self._recipe, self.troubles = recipe, troubles
        self._noise = np.random.default_rng([*seed, 1])
        phone = PHONES[recipe.phone]
        self.phone_camera = PinholeCamera(recipe.size, recipe.height, phone.vertical_fov_rad)
        self._habits = _with_troubles(draw_automatics(phone, rng), troubles)
        side = float(rng.choice([-1, 1]) * rng.uniform(0.24, 0.34))
        side *= "partly_out" in troubles
        person = self.upright_from_phone.T
        self.rig = draw_rig(rng, recipe.vary_rig, recipe.tag, side, person)
        self._shutter_s = _shutter(scene, troubles, rng)
        self._hand = _drawn_hand(recipe, troubles, DOME_M[scene], rng)
        self._times_s, self._dropped = _times(recipe, troubles, rng)
        self._finger = _Finger(self.phone_camera, self.rig, recipe.seconds, rng)
        self.rotation_deg = _stored_turn(troubles, rng)
        world = build_world(panorama, scene, 0.0 if "low_texture" in troubles else 1.0)
        looks = self._hand.at(recipe.seconds / 2)[0]
        tile = noise_tile(seed[-1])
        self._scenery = Scenery(world, self.phone_camera, looks, tile)
        self._reflections = Reflections(world, self.rig)
        self._maker = FrameMaker(
            self.rig, self.phone_camera, world, self._habits, self.upright_from_phone
        )

    @property
    def sideways(self) -> bool:
        """The phone is held in landscape."""
        return "landscape" in self.troubles

    @property
    def camera(self) -> PinholeCamera:
        """Of the upright frame."""
        own = self.phone_camera
        if not self.sideways:
            return own
        return PinholeCamera(own.height, own.width, own.horizontal_fov_rad)

    @property
    def upright_from_phone(self) -> Rotation:
        """From the phone's own frame, in which the rig hangs below, to the upright frame's."""
        return SIDEWAYS if self.sideways else np.eye(3)

    def frames(self) -> Iterator[FilmFrame]:
        """Film it."""
        setting: Setting | None = None
        for number, time_s in enumerate(self._times_s):
            places, blur_px = self._exposed(float(time_s))
            mirrored = spread(places, 1 + int(blur_px / _MIRROR_STEP_PX))
            crops = self._reflections.crops(mirrored)
            scenery = self._scenery.picture(places)
            wanted = metered(*_metered_pixels(scenery, crops), self._habits)
            setting = follow(setting, wanted, self._habits.speed * _SLOWER)
            yield self._frame(number, places[len(places) // 2], blur_px, scenery, crops, setting)

    def _frame(
        self,
        number: int,
        place: Place,
        blur_px: float,
        scenery: np.ndarray,
        crops: dict[str, np.ndarray],
        setting: Setting,
    ) -> FilmFrame:
        (pose, position), gain = place, setting.gain
        time_s = float(self._times_s[number])
        finger = self._finger.at(time_s) if "hand" in self.troubles else None
        root = self._maker.root(scenery, crops, pose, gain, finger)
        lighting = None
        if number % self._recipe.truth_every == 0:
            lighting = self._reflections.lighting(place) * gain
            if self.sideways:
                lighting = turned_ball(lighting, self.upright_from_phone)
        return FilmFrame(
            time_s=time_s,
            pixels=self._upright(self._developed(root)),
            crops=self._maker.true_crops(root, crops, gain, finger),
            log_gain=setting.log_gain,
            world_from_camera=pose @ self.upright_from_phone.T,
            position_m=position,
            motion_blur_px=blur_px,
            dropped=bool(self._dropped[number]),
            covered=self._maker.covered(finger),
            true_lighting=lighting,
        )

    def _exposed(self, time_s: float) -> tuple[list[Place], float]:
        """Where the camera was while the shutter was open, and how far the picture moved."""
        half = self._shutter_s / 2
        blur_px = self._scenery.movement_px(
            self._hand.at(time_s - half), self._hand.at(time_s + half)
        )
        steps = int(np.clip(np.ceil(blur_px / _BLUR_STEP_PX), 1, _MOST_STEPS))
        offsets = (np.arange(steps) + 0.5) / steps * 2 - 1
        return [self._hand.at(time_s + offset * half) for offset in offsets], blur_px

    def _developed(self, root: np.ndarray) -> np.ndarray:
        if "hlg10" not in self.troubles:
            return self._maker.develop(root, self._noise)
        return hlg_pixels(self._maker.noisy_radiance(root, self._noise))

    def _upright(self, pixels: np.ndarray) -> np.ndarray:
        return np.rot90(pixels) if self.sideways else pixels


class _Finger:
    """A finger that comes in from the side, hides part of a sphere and leaves again."""

    def __init__(
        self, camera: PinholeCamera, rig: FilmRig, seconds: float, rng: np.random.Generator
    ) -> None:
        name = SPHERES[int(rng.integers(3))]
        (row,), (column,) = camera.pixel_of_directions(rig.centres_m[name][None])
        self._camera = camera
        self._radius_px = camera.width * rng.uniform(0.035, 0.05)
        right = column > camera.width / 2
        self._root = np.array([row + rng.uniform(-0.02, 0.08) * camera.height, 0.0])
        self._root[1] = camera.width * 1.1 if right else -camera.width * 0.1
        self._tip = np.array([row, column]) + rng.uniform(-0.03, 0.03, 2) * camera.width
        middle, length = rng.uniform(0.35, 0.65) * seconds, rng.uniform(0.4, 0.6) * seconds
        self._from_s, self._to_s = middle - length / 2, middle + length / 2

    def at(self, time_s: float) -> Solid | None:
        share = (time_s - self._from_s) / (self._to_s - self._from_s)
        if not 0 < share < 1:
            return None
        tip = self._root + (self._tip - self._root) * min(1.0, 3 * np.sin(np.pi * share))
        return finger_in_picture(self._camera, tuple(tip), tuple(self._root), self._radius_px)


def _with_troubles(automatics: CameraAutomatics, troubles: tuple[str, ...]) -> CameraAutomatics:
    if "dark" in troubles:
        automatics = replace(automatics, bias_stops=-2.5, noise=max(automatics.noise, 1e-3) * 4)
    if "over_exposed" in troubles:
        automatics = replace(automatics, bias_stops=1.3, highlight_share=0.4)
    if "hlg10" in troubles:  # a standard's curve, not a maker's
        automatics = replace(automatics, gamma=GAMMA, contrast=0.0)
    return automatics


def _shutter(scene: str, troubles: tuple[str, ...], rng: np.random.Generator) -> float:
    low, high = _SHUTTER_S[scene]
    drawn = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    if "dark" in troubles:
        return 1 / 30
    return 1 / 40 if "blur" in troubles else drawn


def _drawn_hand(
    recipe: FilmRecipe, troubles: tuple[str, ...], dome_m: float, rng: np.random.Generator
) -> Hand:
    speed = 0.0 if "still" in troubles else 3.0 if "blur" in troubles else 1.0
    return draw_hand(recipe.seconds, 0.4 * dome_m, speed, rng, "landscape" in troubles)


def _times(
    recipe: FilmRecipe, troubles: tuple[str, ...], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """When each frame is shown, and which are lost."""
    steps = np.ones(recipe.frames) / recipe.rate
    if "variable_rate" in troubles:
        steps = steps * rng.uniform(0.8, 1.7, recipe.frames)
    dropped = np.zeros(recipe.frames, bool)
    if "dropped_frames" in troubles:
        dropped = rng.uniform(size=recipe.frames) < 0.2
        dropped[0] = False
    return np.cumsum(steps) - steps[0], dropped


def _stored_turn(troubles: tuple[str, ...], rng: np.random.Generator) -> int:
    """Quarter turns of the stored frame: phones store portrait lying down."""
    usual = 0 if "landscape" in troubles else 90
    others = [turn for turn in (0, 90, 180, 270) if turn != usual]
    other = int(others[int(rng.integers(3))])
    return other if "rotated" in troubles else usual


def _metered_pixels(
    scenery: np.ndarray, crops: dict[str, np.ndarray]
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "3"]]:
    """A spread of places over the frame, as `take` meters, and the light's colour."""
    _, height, width = scenery.shape
    step = max(1, width // 34)
    background = scenery[:, : round(0.8 * height) : step, ::step].reshape(3, -1).T
    size = len(crops["diffuse"])
    middle = slice(size // 5, -size // 5)
    step = max(1, size // 6)
    spheres = [crop[middle, middle][::step, ::step].reshape(-1, 3) for crop in crops.values()]
    illuminant = crops["diffuse"][middle, middle].mean(axis=(0, 1))
    return np.concatenate([background, *spheres]), illuminant

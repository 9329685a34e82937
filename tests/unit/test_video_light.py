"""The light of a composed video stands still in the world, and is parted where it is switched."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("mitsuba")

from deeplight.camera_response import encode, soft_clip
from deeplight.compose.video import Lights, gathered_lights
from deeplight.frames import rotation
from deeplight.fuse.session import Session
from deeplight.harmonics import irradiance, spherical_harmonics
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, resample
from lab.pans import Pan, Sweep, Troubles, film_pan

FRAMES = 12


@lru_cache
def pan(seed: int = 3) -> Pan:
    rng = np.random.default_rng(seed)
    panorama = np.exp(rng.normal(-1, 0.9, (16, 32, 3))).astype(np.float32)
    panorama = resample.sample_latlong(panorama, latlong.directions(128, 256))
    return film_pan(panorama, Sweep(FRAMES), Troubles(shake_rad=0.0), rng, (192, 108))


def guesses(number: int) -> np.ndarray:
    """What a network might say that gets to know with each frame how bright the place is."""
    return np.full((32, 32, 3), np.log(0.1 + 0.2 * number), np.float32)


def session(filmed: Pan) -> Session:
    asked = iter(range(10_000))
    return Session(filmed.camera.vertical_fov_rad, lambda _: guesses(next(asked)))


def gathered(*pans: Pan) -> Lights:
    frames = [(f.pixels, f.rotation) for filmed in pans for f in filmed.frames]
    return gathered_lights(session(pans[0]), frames)


def grey_levels(lights: list[np.ndarray]) -> list[float]:
    """Pixels, 0 to 255, of a grey ball's middle and four sides."""
    normals = np.array([[0, 0, 1], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]], np.float32)
    balls = (irradiance(spherical_harmonics(Lighting.from_latlong(one)), normals) for one in lights)
    return [255 * float(encode(soft_clip(0.345 / np.pi * ball)).mean()) for ball in balls]


def test_a_grey_ball_does_not_swing_while_the_camera_turns() -> None:
    filmed, lights = pan(), gathered(pan())
    own = session(filmed)
    so_far, steady = [], []
    for k, frame in enumerate(filmed.frames[:5]):
        own.add(frame.pixels, frame.rotation)
        so_far.append(own.environment(np.eye(3), height=64).radiance)
        steady.append(lights.part(k).radiance)
    assert np.ptp(grey_levels(steady)) < 2
    assert np.ptp(grey_levels(so_far)) > 10


def test_each_frame_is_lit_relative_to_its_own_white() -> None:
    wanted = [f.log_gain - pan().frames[0].log_gain for f in pan().frames]
    assert np.ptp(wanted, axis=0).max() > 0.2
    np.testing.assert_allclose(gathered(pan()).log_gain, wanted, atol=0.06)


def test_frames_of_which_nothing_is_known_say_nothing_of_the_light() -> None:
    frames = [(f.pixels, f.rotation) for f in pan().frames]
    strange = [(f.pixels, None) for f in pan(8).frames[:3]]
    lights = gathered_lights(session(pan()), [*frames[:5], *strange, *frames[5:]])
    plain = gathered(pan())
    np.testing.assert_array_equal(lights.parts[0].radiance, plain.parts[0].radiance)
    np.testing.assert_allclose(lights.log_gain[[4, 8]], plain.log_gain[[4, 5]], atol=1e-6)
    assert len(lights.log_gain) == FRAMES + 3


def test_a_light_that_is_switched_parts_the_video() -> None:
    one, other = pan(), pan(8)
    lights = gathered(one, other)
    assert [part.start for part in lights.parts] == [0, FRAMES]
    for part, alone in zip(lights.parts, (gathered(one), gathered(other)), strict=True):
        logs = [np.log(p.radiance[100:150].mean(-1)) for p in (part, alone.parts[0])]
        likeness = np.corrcoef(logs[0].ravel(), logs[1].ravel())[0, 1]
        assert likeness > 0.8


def test_a_video_of_one_light_has_one_part() -> None:
    assert [part.start for part in gathered(pan(), pan()).parts] == [0]
    turned = [(f.pixels, rotation("y", 1.0) @ f.rotation) for f in pan().frames]
    assert len(gathered_lights(session(replace(pan())), turned).parts) == 1

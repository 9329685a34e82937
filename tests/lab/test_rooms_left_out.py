"""Rooms left out: none is learnt from and measured, and what their photos do not show."""

from pathlib import Path

import numpy as np

from deeplight.camera import PinholeCamera
from deeplight.evaluate.rivals.crops import Pair
from deeplight.frames import rotation, turned
from deeplight.mappings import latlong, resample
from deeplight.simulate.panorama import Place
from lab.evidence.light_masks import Scores
from lab.evidence.rooms_left_out import beyond, parts_of, set_aside, unit_of

NAMES = [*(f"hall_{n}" for n in range(23)), "brown_a", "brown_b", "studio_small_a"]


def room(name: str, split: str) -> Place:
    return Place(Path(name), name, "indoor", split, "CC0", synthetic_ground=False)


ROOMS = [
    *(room(name, "train") for name in [*NAMES, "brown_b"]),
    *(room(f"attic_{n}", "val") for n in range(5)),
    *(room(f"cave_{n}", "test") for n in range(7)),
]
UNITS = np.array([unit_of(place) for place in ROOMS])


def test_units_are_left_out_whole_and_every_split_is_spread_over_the_parts() -> None:
    parts = parts_of(ROOMS, 5)
    for unit in np.unique(UNITS):
        assert len(np.unique(parts[unit == UNITS])) == 1
    assert len(np.unique(parts[np.char.startswith(UNITS, "brown")])) == 1
    for split in ("train", "val", "test"):
        units = {(parts[n], UNITS[n]) for n, place in enumerate(ROOMS) if place.split == split}
        counts = np.bincount([part for part, _ in units], minlength=5)
        assert counts.max() - counts.min() <= 1
    np.testing.assert_array_equal(parts_of(ROOMS, 5), parts)


def test_rooms_that_choose_the_step_are_whole_units_of_the_training() -> None:
    for seed in range(5):
        aside = set_aside(UNITS, 4, seed)
        assert len(np.unique(UNITS[aside])) == 4
        assert not set(UNITS[aside]) & set(UNITS[~aside])


def view(elevation_rad: float) -> Pair:
    photo, place = np.zeros((60, 80, 3), np.uint8), np.zeros((64, 128, 3), np.float32)
    return Pair(photo, place, 0, np.ones(3), elevation_rad, fov_rad=1.0)


def test_a_photo_shows_the_texels_that_its_rays_hit_and_no_others() -> None:
    camera = PinholeCamera(80, 60, 1.0)
    for elevation in (-0.7, 0.0, 0.4):
        unseen = beyond(view(elevation)).astype(np.float64)
        rays = turned(camera.rays(), rotation("x", elevation))
        middle = resample.sample_latlong(np.repeat(unseen[..., None], 3, axis=2), rays)[9:-9, 9:-9]
        assert middle.max() < 0.01
        solid = latlong.solid_angles(*unseen.shape)
        seen = 1 - (unseen * solid).sum() / solid.sum()
        assert abs(seen - camera.share_of_sphere) < 0.1 * camera.share_of_sphere


def test_of_lights_that_a_photo_shows_none_are_looked_for_beyond_it() -> None:
    unseen = beyond(view(0.0))
    within, outside = np.full((2, 32, 64), 0.01)
    within[15:17, 31:33] = 90.0
    outside[4:6, 3:5] = 90.0
    answers = [within + 2 * outside, within, outside]
    scores = Scores.of(answers, [within, outside, outside], np.array([1, 2, 1]), [unseen] * 3)
    own, chance = (part[:, 0] for part in scores.found)
    np.testing.assert_allclose(own, [np.nan, 0, 1], atol=1e-6)
    np.testing.assert_allclose(chance, [np.nan, 1, 0], atol=1e-6)
    assert np.isnan(scores.off_deg[0][0])
    np.testing.assert_allclose(scores.off_deg[0][2], 0, atol=1e-3)

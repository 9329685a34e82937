"""Laws of gathered light, on pans of a place that is known: seen pixels, power, turning, memory."""

import math
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from deeplight.camera_response import LUMINANCE
from deeplight.environment import Environment
from deeplight.errors import ConfigError, InputError, ShapeError
from deeplight.frames import rotation, world_from_camera
from deeplight.fuse.merge import likely_factor, share_of, usual_factor
from deeplight.fuse.session import CHANGED, NEAR_RAD, PATIENCE, Session
from deeplight.fuse.steady import CLEARLY, ENOUGH_SEEN, ROOM, Kept, Steadily
from deeplight.mappings import latlong, mirror_ball, resample
from lab.pans import Pan, Sweep, Troubles, film_pan

pytestmark = pytest.mark.needs("cv2")

RING = Sweep(16)
IDEAL = Troubles(shake_rad=0.0, response=False)
GREY = np.full((32, 32, 3), np.log(0.4), np.float32)
HEIGHT = 96


@lru_cache
def place(seed: int = 3, lamp: float = 0.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    panorama = np.exp(rng.normal(-1, 0.9, (16, 32, 3)))
    panorama *= np.exp(np.sin(np.arange(32) * np.pi / 16))[None, :, None]  # one side is bright
    panorama = resample.sample_latlong(panorama.astype(np.float32), latlong.directions(128, 256))
    if lamp:
        panorama[50:60] = lamp  # a strip of light all round
    return panorama


@lru_cache
def pan(sweep: Sweep = RING, troubles: Troubles = IDEAL, seed: int = 3, lamp: float = 0) -> Pan:
    return film_pan(place(seed, lamp), sweep, troubles, np.random.default_rng(2), (192, 108))


def gathered(filmed: Pan, count: int | None = None, estimate: np.ndarray = GREY) -> Session:
    session = Session(filmed.camera.vertical_fov_rad, lambda _: estimate)
    for frame in filmed.frames[:count]:
        change = (frame.log_gain - filmed.frames[0].log_gain).astype(np.float32)
        session.add(frame.pixels, frame.rotation, estimate + change)
    return session


def error_where_seen(session: Session, filmed: Pan) -> float:
    found = session.environment(height=HEIGHT)
    assert found.seen is not None
    wanted = resample.shrink_latlong(filmed.truth(), HEIGHT)
    known = found.seen > 0.99
    return float(np.median(np.abs(np.log(found.radiance / wanted))[known]))


def test_seen_pixels_are_the_truth_whatever_the_automatics_did() -> None:
    filmed = pan()
    assert np.ptp([frame.log_gain for frame in filmed.frames], axis=0).max() > 0.2
    assert error_where_seen(gathered(filmed), filmed) < 0.03


def test_wrong_rotations_show() -> None:
    filmed = pan()
    turned = [
        replace(f, rotation=rotation("y", 0.1 * k) @ f.rotation)
        for k, f in enumerate(filmed.frames)
    ]
    mixed = replace(filmed, frames=turned)
    assert error_where_seen(gathered(mixed), filmed) > 0.04


def test_gains_are_those_of_the_camera() -> None:
    filmed = pan()
    wanted = [frame.log_gain - filmed.frames[0].log_gain for frame in filmed.frames]
    np.testing.assert_allclose(gathered(filmed).gains, wanted, atol=0.04)


def test_a_darker_exposure_says_what_clips_in_another() -> None:
    """A lamp brighter than white: two of three frames clip it, the third is three stops darker."""
    sweep = Sweep(3, turn_deg=12, bracket_stops=(0.0, 0.0, -3.0))
    filmed = pan(sweep, replace(IDEAL, exposure=0.0), 3, 60.0)
    white = np.exp(filmed.frames[0].log_gain).max() * 60.0
    assert 1.5 < white < 7.5
    bracketed, alike = (gathered(filmed, count) for count in (3, 2))
    shared = latlong.directions(HEIGHT, 2 * HEIGHT) @ -(
        filmed.frames[0].rotation.T @ filmed.frames[1].rotation[:, 2]
    )
    peaks = [
        s.environment(height=HEIGHT).radiance[shared > np.cos(0.35)].max()
        for s in (bracketed, alike)
    ]
    assert abs(peaks[0] / white - 1) < 0.15
    assert abs(peaks[1] / white - 1) > 0.15


def test_clipped_lamps_get_more_where_the_estimates_have_more() -> None:
    filmed = pan(Sweep(1), IDEAL, 3, 300.0)
    weight = latlong.solid_angles(HEIGHT, 2 * HEIGHT)[..., None]
    powers = []
    for value in (0.2, 0.8, 3.2):
        bright = np.full_like(GREY, np.log(value))
        found = gathered(filmed, estimate=bright).environment(height=HEIGHT)
        powers.append(
            float(((found.radiance - value * (1 - found.seen[..., None])) * weight).sum())
        )
    assert powers[0] < powers[1] < powers[2]
    brightest = latlong.directions(HEIGHT, 2 * HEIGHT)[found.radiance.max(-1) > 2 * 3.2]
    wanted = latlong.directions(128, 256)[55, 0, 1]
    assert len(brightest)
    assert np.abs(brightest @ filmed.frames[0].rotation[1] - wanted).max() < 0.16


def test_what_is_usual_and_the_estimates_together_say_how_bright_a_lamp_is() -> None:
    usual = math.exp(1.2)
    assert likely_factor(1.0, 0.0, usual, usual) == pytest.approx(usual, rel=0.03)  # both say so
    assert likely_factor(1.0, 0.0, 1e-3, usual) < usual
    assert 1.0 < likely_factor(1.0, 9.0, 4.0, usual) < usual  # little is missing
    assert usual < likely_factor(1.0, 0.0, 6.0, usual) < 6.0  # some is
    sun = likely_factor(0.01, 3.0, 100.0, usual)  # nothing usual explains what is missing
    assert 1e3 < sun < 1e4


def test_what_clips_overhead_is_usually_brighter_than_a_window() -> None:
    sines = np.linspace(-1, 1, 41)
    factors = usual_factor(sines)
    assert (np.diff(factors) >= 0).all()
    assert factors[0] == factors[sines < 0.25].max() < 0.5 * factors[-1]
    white = np.full((96, 54, 3), 255, np.uint8)
    powers = []
    for pitch in (0.0, 0.9):
        session = Session(1.1, lambda _: GREY)
        for yaw in (0.0, np.pi):  # up is what most frames agree on
            session.add(white // 3, world_from_camera(yaw, 0.0))
        session.add(white, world_from_camera(np.pi / 2, pitch))
        powers.append(float(session.environment(height=HEIGHT).lighting.power().sum()))
    assert powers[1] > 1.15 * powers[0]


def test_one_view_keeps_its_estimate_where_it_did_not_look() -> None:
    ball = (GREY + 0.5 * mirror_ball.pixel_directions(32)[..., 1:2]).astype(np.float32)
    found = gathered(pan(), 1, ball).environment(height=HEIGHT)
    assert found.seen is not None
    behind = latlong.directions(HEIGHT, 2 * HEIGHT)[..., 2] > 0.5
    wanted = np.exp(np.log(0.4) + 0.5 * latlong.directions(HEIGHT, 2 * HEIGHT)[..., 1])
    np.testing.assert_allclose(found.radiance[behind][:, 0], wanted[behind], rtol=0.05)
    assert found.seen[behind].max() == 0


def test_power_that_views_disagree_on_is_a_lamp_above_and_none_below() -> None:
    session = Session(pan().camera.vertical_fov_rad, lambda _: GREY)
    for k, frame in enumerate(pan().frames[:2]):
        session.add(frame.pixels, frame.rotation, GREY + np.float32(1.5 * k))
    found = session.environment(height=32)
    assert found.seen is not None
    rises = latlong.directions(32, 64) @ pan().frames[0].rotation[1]
    above, below = (
        found.radiance[(found.seen == 0) & side].max(-1) for side in (rises > 0.15, rises < -0.15)
    )
    assert below.max() < 2 * np.median(below)
    assert above.max() > 5 * np.median(above)


def test_views_without_overlap_are_tied_by_their_estimates() -> None:
    """A front and a back camera: the back one is exposed four times as long."""
    session = Session(1.1, lambda _: GREY)
    picture = np.full((192, 108, 3), 100, np.uint8)
    session.add(picture, np.eye(3))
    session.add(picture, rotation("y", np.pi), GREY + np.float32(np.log(4)))
    assert abs(session.gains[1].mean() - np.log(4)) < 0.3


def test_light_turns_with_the_frame_it_is_asked_in() -> None:
    session = gathered(pan())
    turn = rotation("y", 2 * np.pi * 12 / (2 * HEIGHT))
    one = session.environment(np.eye(3), height=HEIGHT)
    other = session.environment(turn, height=HEIGHT)
    turned = one.turned(turn.T)
    close = np.abs(np.log(turned.radiance / other.radiance)) < 0.1
    assert close.mean() > 0.97


def test_the_unit_is_the_frame_asked_for() -> None:
    session = gathered(pan())
    first, other = (session.environment(log_gain=g, height=32) for g in (None, session.gains[4]))
    ratio = other.radiance / first.radiance
    np.testing.assert_allclose(np.log(ratio).mean((0, 1)), session.gains[4], atol=0.05)


@lru_cache
def turning() -> list[tuple[Environment, Environment, np.ndarray]]:
    """Shown while one turns, steadily and not, each in its frame's white, and that white; the
    estimates are too bright and too dark by turns."""
    session = Session(pan().camera.vertical_fov_rad, lambda _: GREY)
    shown = []
    for k, frame in enumerate(pan().frames[:6]):
        change = frame.log_gain - pan().frames[0].log_gain + 0.8 * (-1) ** k
        gain = session.add(frame.pixels, frame.rotation, GREY + change.astype(np.float32)).log_gain
        steady, plain = (
            session.environment(frame.rotation, gain, 16, steady=steady) for steady in (True, False)
        )
        shown.append((steady, plain, gain))
    return shown


def log_powers(which: int) -> np.ndarray:
    weight = latlong.solid_angles(16, 32)
    powers = [
        np.einsum("hwc,hw,c->", shown[which].radiance * np.exp(-shown[2]), weight, LUMINANCE)
        for shown in turning()
    ]
    return np.log(powers)


def test_a_steady_light_moves_less_and_is_never_far_from_what_is_believed() -> None:
    steady, plain = (log_powers(which) for which in (0, 1))
    moves = [float(np.abs(np.diff(logs)).sum()) for logs in (steady, plain)]
    assert moves[0] < 0.7 * moves[1]
    seen = np.array([share_of(own.seen) for _, own, _ in turning() if own.seen is not None])
    room = ROOM * np.maximum(0, 1 - seen / ENOUGH_SEEN)
    assert len(seen) == len(room) == 6
    assert (np.abs(steady - plain) < room + 1e-3).all()
    assert np.abs(steady - plain).max() > 0.1  # the law above would see more room than there is


@pytest.mark.parametrize(("brighter", "moves"), [(0.95 * CLEARLY, False), (1.05 * CLEARLY, True)])
def test_a_lamp_stays_in_the_world_until_another_place_is_clearly_brighter(
    brighter: float, moves: bool
) -> None:
    kept, unit = Kept(), np.zeros(3)
    turns = [world_from_camera(0.3, 0.2), world_from_camera(-1.1, -0.4)]
    first, other = np.array([0.0, 0.6, -0.8]), np.array([0.8, 0.6, 0.0])
    Steadily(kept, unit, turns[0]).place(first, lambda _: 1.0)
    before = turns[1].T @ turns[0] @ first
    found = Steadily(kept, unit, turns[1]).place(
        other, lambda way: brighter if np.allclose(way, other) else 1.0
    )
    np.testing.assert_allclose(found, other if moves else before, atol=1e-12)
    np.testing.assert_allclose(kept.lamp, turns[1] @ found, atol=1e-12)


def test_a_steady_light_leaves_what_was_seen_alone() -> None:
    steady, plain, _ = turning()[3]
    assert steady.seen is not None
    known = steady.seen == 1
    np.testing.assert_allclose(steady.radiance[known], plain.radiance[known], rtol=1e-5)
    assert np.abs(np.log(steady.radiance / plain.radiance))[steady.seen == 0].max() > 0.05


def test_more_is_seen_with_each_view() -> None:
    shares = []
    for count in (1, 3, 16):
        seen = gathered(pan(), count).environment(height=HEIGHT).seen
        assert seen is not None
        shares.append(float((seen * latlong.solid_angles(HEIGHT, 2 * HEIGHT)).sum() / 4 / np.pi))
    assert abs(shares[0] - pan().camera.share_of_sphere) < 0.02
    assert shares[0] < shares[1] < shares[2]


def test_saved_and_loaded_it_goes_on_the_same(tmp_path: Path) -> None:
    filmed = pan()
    session = gathered(filmed, 5)
    session.save(tmp_path / "state.npz")
    loaded = Session.load(tmp_path / "state.npz", lambda _: GREY)
    for one in (session, loaded):
        one.add(filmed.frames[5].pixels, filmed.frames[5].rotation)
    a, b = (one.environment(height=HEIGHT) for one in (session, loaded))
    np.testing.assert_allclose(a.radiance, b.radiance, rtol=1e-4)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04broken", b"{}"])
def test_what_is_no_session_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "state.npz").write_bytes(content)
    with pytest.raises(ConfigError, match="session saved"):
        Session.load(tmp_path / "state.npz", lambda _: GREY)


def test_memory_is_constant_and_the_first_view_stays() -> None:
    session = Session(pan().camera.vertical_fov_rad, lambda _: GREY, most_views=4)
    for _ in range(2):
        for frame in pan().frames:
            session.add(frame.pixels, frame.rotation)
    assert len(session.views) == 4
    assert session.views[0].number == 0


def test_a_new_picture_of_the_same_direction_replaces_the_old() -> None:
    session = gathered(pan(), 3)
    frame = pan().frames[2]
    session.add(frame.pixels, frame.rotation)
    assert sorted(view.number for view in session.views) == [0, 1, 3]


@pytest.mark.parametrize(("frames", "turn_deg"), [(40, 180.0), (80, 80.0)])
def test_however_slowly_one_turns_nothing_that_was_seen_is_lost(
    frames: int, turn_deg: float
) -> None:
    filmed = pan(Sweep(frames, turn_deg=turn_deg))
    session = gathered(filmed)
    looks = np.stack([view.towards for view in session.views])
    for frame in filmed.frames:
        assert (looks @ -frame.rotation[:, 2]).max() > np.cos(NEAR_RAD)
    assert len(session.views) < 30


def test_a_place_is_kept_in_the_file(tmp_path: Path) -> None:
    filmed = pan(Sweep(24, turn_deg=24.0))
    session = gathered(filmed, 12)
    session.save(tmp_path / "state.npz")
    loaded = Session.load(tmp_path / "state.npz", lambda _: GREY)
    for frame in filmed.frames[12:]:
        assert session.add(frame.pixels, frame.rotation).views == (
            loaded.add(frame.pixels, frame.rotation).views
        )
    numbers = [[view.number for view in one.views] for one in (session, loaded)]
    assert numbers[0] == numbers[1]


def test_another_place_is_noticed_and_the_old_one_forgotten() -> None:
    session = gathered(pan())
    added = [session.add(f.pixels, f.rotation) for f in pan(seed=8).frames[:PATIENCE]]
    assert min(one.disagreement for one in added) > CHANGED
    assert [one.forgotten for one in added] == [False] * (PATIENCE - 1) + [True]
    assert len(session.views) == PATIENCE


def test_another_light_is_noticed_by_a_camera_that_stands_still() -> None:
    session, last = gathered(pan()), pan().frames[-1]
    rows, columns, _ = last.pixels.shape
    few = np.random.default_rng(0).choice([12, 40, 110, 235], (rows // 20, columns // 20, 1))
    blocks = np.repeat(np.kron(few, np.ones((20, 20, 1))), 3, 2).astype(np.uint8)
    added = [session.add(blocks, last.rotation) for _ in range(PATIENCE)]
    assert added[-1].forgotten
    assert len(session.views) == PATIENCE


def test_the_same_place_is_not_forgotten() -> None:
    session = gathered(pan())
    again = [session.add(f.pixels, f.rotation) for f in pan().frames]
    assert not any(one.forgotten for one in again)
    assert max(one.disagreement for one in again) < CHANGED / 3


def test_what_cannot_be_done_is_said() -> None:
    session = Session(1.1, lambda _: GREY)
    with pytest.raises(InputError, match="add one"):
        session.environment()
    with pytest.raises(ShapeError, match="rotation"):
        session.add(np.zeros((64, 64, 3), np.uint8), np.eye(3) * 2)
    with pytest.raises(ShapeError, match="field of view"):
        Session(0.0, lambda _: GREY)

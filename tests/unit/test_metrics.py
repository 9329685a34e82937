"""Laws of the metrics, and of averaging them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deeplight.camera_response import encode, soft_clip
from deeplight.evaluate.metrics import (
    angular_error_rgb,
    masked_l1,
    mirror_detail,
    relative_radiance_error,
)
from deeplight.evaluate.scores import Report, Scores, rendered_radiance, score
from deeplight.evaluate.summary import calibration, summarise
from deeplight.lighting import Lighting
from deeplight.reflectance import rig_bases
from deeplight.relight import relight_rig
from deeplight.sphere import PAPER_RIG, SPHERES

MASK = PAPER_RIG.views["diffuse"].mask()


def pictures(seed: int, count: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.05, 0.9, (count, 32, 32, 3)).astype(np.float32)


# -- single metrics ----------------------------------------------------------------------------


def test_a_perfect_prediction_has_no_error() -> None:
    same = pictures(0)
    assert (masked_l1(same, same, MASK) == 0).all()
    assert angular_error_rgb(same, same, MASK).degrees == pytest.approx(np.zeros(3), abs=1e-6)
    assert (relative_radiance_error(same, same, MASK) == 0).all()


def test_any_change_inside_the_mask_is_an_error() -> None:
    same = pictures(0)
    other = same.copy()
    other[0, 16, 16, 1] += 0.1
    assert masked_l1(other, same, MASK)[0] == pytest.approx(0.1 / (MASK.sum() * 3), rel=1e-4)
    assert angular_error_rgb(other, same, MASK).degrees[0] > 0
    assert relative_radiance_error(other, same, MASK)[0, 1] > 0


def test_pixels_outside_the_mask_do_not_count() -> None:
    same = pictures(0)
    other = same.copy()
    other[:, ~MASK] = np.nan
    assert (masked_l1(other, same, MASK) == 0).all()
    assert np.isfinite(angular_error_rgb(other, same, MASK).degrees).all()
    assert (relative_radiance_error(other, same, MASK) == 0).all()


def test_l1_is_symmetric_and_the_same_when_both_are_flipped() -> None:
    a, b = pictures(1), pictures(2)
    assert masked_l1(a, b, MASK) == pytest.approx(masked_l1(b, a, MASK))
    assert masked_l1(a[:, :, ::-1], b[:, :, ::-1], MASK[:, ::-1]) == pytest.approx(
        masked_l1(a, b, MASK)
    )
    assert masked_l1(a[:, :, ::-1], b, MASK) != pytest.approx(masked_l1(a, b, MASK))


@given(st.floats(1e-3, 1e3))
def test_the_angle_does_not_see_brightness(factor: float) -> None:
    a, b = pictures(1), pictures(2)
    angle = angular_error_rgb(a, b, MASK).degrees
    assert angular_error_rgb(a * np.float32(factor), b, MASK).degrees == pytest.approx(angle, 1e-4)


def test_the_angle_sees_colour() -> None:
    white = np.ones((1, 32, 32, 3), np.float32)
    red = white * np.array([1, 0, 0], np.float32)
    assert angular_error_rgb(red, white, MASK).degrees == pytest.approx([54.7356], abs=1e-3)
    green = white * np.array([0, 1, 0], np.float32)
    assert angular_error_rgb(red, green, MASK).degrees == pytest.approx([90])


@given(st.floats(1e-3, 1e3))
def test_light_twice_as_bright_is_an_error_of_one(factor: float) -> None:
    b = pictures(2).astype(np.float64)
    error = relative_radiance_error(b * factor, b, MASK)
    assert error == pytest.approx(np.full((3, 3), factor - 1), abs=1e-9 * (1 + factor))


def test_black_pixels_have_no_angle_and_are_counted() -> None:
    a, b = pictures(1), pictures(2)
    whole = angular_error_rgb(a, b, MASK)
    assert (whole.black_pixels == 0).all()
    b[0, 16, :] = 0
    a[1, 16, 16] = 0
    partly = angular_error_rgb(a, b, MASK)
    assert partly.black_pixels.tolist() == [MASK[16].sum(), 1, 0]
    assert np.isfinite(partly.degrees).all()
    none = angular_error_rgb(np.zeros_like(a), b, MASK)
    assert np.isnan(none.degrees).all()
    assert np.isnan(relative_radiance_error(a, np.zeros_like(b), MASK)).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_broken_predictions_never_look_perfect(bad: float) -> None:
    b = pictures(2)
    a = b.copy()
    a[1, 16, 16, 0] = bad
    assert not np.isfinite(masked_l1(a, b, MASK)[1])
    assert np.isnan(angular_error_rgb(a, b, MASK).degrees[1])
    assert np.isnan(relative_radiance_error(a, b, MASK)[1, 0])
    assert masked_l1(a, b, MASK)[[0, 2]].tolist() == [0, 0]


def test_detail_is_1_for_the_same_picture_and_less_for_a_blurred_one() -> None:
    sharp = pictures(3)
    assert mirror_detail(sharp, sharp, MASK) == pytest.approx(np.ones(3))
    blurred = (sharp + np.roll(sharp, 1, 1) + np.roll(sharp, 1, 2)) / 3
    assert (mirror_detail(blurred, sharp, MASK) < 0.8).all()
    assert mirror_detail(sharp, blurred, MASK) == pytest.approx(
        1 / mirror_detail(blurred, sharp, MASK)
    )
    outside = sharp.copy()
    outside[:, ~MASK] = 7
    assert mirror_detail(outside, sharp, MASK) == pytest.approx(np.ones(3))


def test_a_flat_or_broken_picture_has_no_detail_to_compare_with() -> None:
    sharp, flat = pictures(3), np.full((3, 32, 32, 3), 0.5, np.float32)
    assert (mirror_detail(flat, sharp, MASK) == 0).all()
    assert np.isnan(mirror_detail(sharp, flat, MASK)).all()
    broken = sharp.copy()
    broken[1, 16, 16] = np.nan
    assert np.isnan(mirror_detail(broken, sharp, MASK)).tolist() == [False, True, False]


# -- rendering and scoring a batch -------------------------------------------------------------


def log_radiance(seed: int, count: int = 4) -> np.ndarray:
    return np.random.default_rng(seed).normal(-1, 1, (count, 32, 32, 3)).astype(np.float32)


def filmed_in(q: np.ndarray) -> dict[str, np.ndarray]:
    radiance = rendered_radiance(rig_bases(PAPER_RIG), q)
    return {name: encode(soft_clip(linear)) for name, linear in radiance.items()}


def test_rendering_a_batch_is_relighting_one_by_one() -> None:
    q = log_radiance(0)
    batch = rendered_radiance(rig_bases(PAPER_RIG), q)
    for number in range(len(q)):
        one = relight_rig(PAPER_RIG, Lighting.from_log_radiance(q[number]))
        for name in SPHERES:
            np.testing.assert_allclose(batch[name][number], one[name], rtol=1e-4, atol=1e-6)


def test_the_true_light_scores_zero_and_another_does_not() -> None:
    bases = rig_bases(PAPER_RIG)
    q = log_radiance(0)
    right = score(rendered_radiance(bases, q), filmed_in(q), bases)
    wrong = score(rendered_radiance(bases, log_radiance(1)), filmed_in(q), bases)
    for name in SPHERES:
        assert right.l1[name] == pytest.approx(np.zeros(4), abs=1e-6)
        assert (wrong.l1[name] > 1e-3).all()
    assert right.theta_rgb_deg == pytest.approx(np.zeros(4), abs=1e-3)
    assert (wrong.theta_rgb_deg > 0.1).all()


def test_double_light_is_twice_the_radiance_of_the_diffuse_sphere() -> None:
    bases = rig_bases(PAPER_RIG)
    q = log_radiance(0) - 3  # dark enough that nothing clips
    found = score(rendered_radiance(bases, q + np.float32(np.log(2))), filmed_in(q), bases)
    assert found.relative_radiance == pytest.approx(np.ones((4, 3)), abs=1e-3)
    assert found.theta_rgb_deg == pytest.approx(np.zeros(4), abs=1e-2)


# -- averages and intervals --------------------------------------------------------------------


def scores_of(l1: np.ndarray) -> Scores:
    count = len(l1)
    by_sphere: Mapping[str, np.ndarray] = dict.fromkeys(SPHERES, l1)
    return Scores(by_sphere, l1 * 10, np.stack([l1] * 3, -1), np.zeros(count, np.int64))


def report_of(**l1: np.ndarray) -> Report:
    count = len(next(iter(l1.values())))
    places = np.array([f"place-{number % 6}" for number in range(count)])
    scenes = np.array(["indoor" if number % 6 < 3 else "outdoor" for number in range(count)])
    keys = tuple(f"key-{number}" for number in range(count))
    scores = {name: scores_of(values) for name, values in l1.items()}
    return Report(
        "val",
        np.arange(count),
        keys,
        places,
        scenes,
        np.zeros(count),
        scores,
        true_radiance=np.linspace(0.1, 2, count),
        takes=np.array(["take"] * count),
        frames=np.arange(count),
        world_from_camera=np.full((count, 3, 3), np.nan),
    )


def find(report: Report, estimator: str, scene: str, metric: str = "l1_diffuse"):
    return next(
        s
        for s in summarise(report, ["model"], resamples=300)
        if (s.estimator, s.scene, s.metric) == (estimator, scene, metric)
    )


def test_means_by_scene_and_their_intervals() -> None:
    values = np.random.default_rng(0).uniform(0.1, 0.5, 60)
    report = report_of(model=values, mean_spheres=values * 2)
    both = find(report, "model", "both")
    assert (both.examples, both.undefined, both.places) == (60, 0, 6)
    assert both.mean.value == pytest.approx(values.mean())
    assert both.mean.low < both.mean.value < both.mean.high
    assert both.sd == pytest.approx(values.std())
    indoor = find(report, "model", "indoor")
    assert indoor.mean.value == pytest.approx(values[report.scenes == "indoor"].mean())
    assert indoor.places == 3


def test_a_ratio_is_paired() -> None:
    """Twice the error everywhere is a ratio of exactly 2, however much the places differ."""
    values = np.random.default_rng(0).uniform(0.1, 0.5, 60)
    ratio = find(report_of(model=values * 2, mean_spheres=values), "model", "both").ratio
    assert ratio["mean_spheres"].value == pytest.approx(2)
    assert ratio["mean_spheres"].low == pytest.approx(ratio["mean_spheres"].high)
    twisted = report_of(model=values[::-1].copy(), mean_spheres=values)
    other = find(twisted, "model", "both").ratio["mean_spheres"]
    assert other.low < other.high


def test_a_difference_is_paired() -> None:
    """0.1 less everywhere is 0.1 less on any places, however much these differ."""
    values = np.random.default_rng(0).uniform(0.2, 0.5, 60)
    found = find(report_of(model=values - 0.1, other=values), "model", "both").difference["other"]
    assert (found.value, found.low, found.high) == pytest.approx((-0.1, -0.1, -0.1))
    assert find(report_of(model=values, other=values - 0.1), "other", "both").difference == {}


def test_the_median_of_resampled_places_is_the_plain_one_in_the_middle() -> None:
    values = np.random.default_rng(1).gamma(1.0, 1.0, 61)
    found = find(report_of(model=values), "model", "both").median
    assert found.value == pytest.approx(np.median(values))
    assert found.low < found.value < found.high
    even = find(report_of(model=values[:60]), "model", "both").median
    assert even.value == pytest.approx(np.median(values[:60]))


def test_calibration_bins_by_true_brightness() -> None:
    values = np.random.default_rng(0).uniform(0.1, 0.5, 60)
    report = report_of(model=values)
    error = np.log2(report.true_radiance)  # dim scenes too dark, bright ones too bright
    scores = replace(report.scores["model"], more={"energy_stops": error})
    bins = calibration(replace(report, scores={"model": scores}), bins=4, resamples=50)
    assert [b.examples for b in bins] == [15] * 4
    assert np.all(np.diff([b.energy_stops.value for b in bins]) > 0)
    assert bins[0].low == pytest.approx(0.1)
    assert calibration(report, bins=4, resamples=50) == []


def test_frames_of_one_place_do_not_narrow_the_interval() -> None:
    by_place = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    few, many = np.tile(by_place, 2), np.tile(by_place, 200)
    width = [
        (lambda mean: mean.high - mean.low)(find(report_of(model=v), "model", "both").mean)
        for v in (few, many)
    ]
    assert width[0] == pytest.approx(width[1])


def test_undefined_values_are_left_out_and_counted() -> None:
    values = np.random.default_rng(0).uniform(0.1, 0.5, 60)
    holes = values.copy()
    holes[[3, 7]] = np.nan
    found = find(report_of(model=holes, mean_spheres=values), "model", "both")
    assert (found.examples, found.undefined) == (58, 2)
    assert found.mean.value == pytest.approx(np.delete(values, [3, 7]).mean())
    assert found.ratio["mean_spheres"].value == pytest.approx(1)
    nothing = find(report_of(model=np.full(60, np.nan)), "model", "both")
    assert np.isnan(nothing.mean.value)
    assert nothing.undefined == 60

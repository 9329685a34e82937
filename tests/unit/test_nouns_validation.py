"""Bad input to a noun raises its error, in words one can act on; values cannot be changed."""

import dataclasses
import pickle
import warnings
from collections.abc import Callable

import numpy as np
import pytest

from deeplight import frames, harmonics, reflectance, relight
from deeplight.camera import PinholeCamera
from deeplight.camera_response import CameraResponse
from deeplight.errors import (
    DeepLightError,
    ImageFileError,
    InputError,
    MissingExtraError,
    ModelError,
    ShapeError,
)
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, mirror_ball, resample
from deeplight.sphere import PAPER_RIG, Rig, SphereView

ONES = np.ones((8, 8, 3), np.float32)


def spoilt(value: float) -> np.ndarray:
    radiance = ONES.copy()
    radiance[4, 4, 0] = value
    return radiance


BAD: dict[str, Callable[[], object]] = {
    "camera without pixels": lambda: PinholeCamera(0, 10, 1.0),
    "camera without a view": lambda: PinholeCamera(10, 10, 0.0),
    "camera seeing behind itself": lambda: PinholeCamera(10, 10, np.pi),
    "gamma of 0": lambda: CameraResponse(gamma=0),
    "negative clip": lambda: CameraResponse(soft_clip_n=-1),
    "white balance of 0": lambda: CameraResponse(white_balance=(1.0, 0.0, 1.0)),
    "light with a nan": lambda: Lighting(spoilt(np.nan)),
    "light with an inf": lambda: Lighting(spoilt(np.inf)),
    "negative light": lambda: Lighting(spoilt(-1e-3)),
    "log radiance that overflows": lambda: Lighting.from_log_radiance(spoilt(200)),
    "sphere frame that mirrors": lambda: SphereView(frames.MIRROR_X),
    "sphere frame that scales": lambda: SphereView(2 * np.eye(3)),
    "sphere touching the lens": lambda: SphereView(angular_radius_rad=1.5),
    "sphere of negative size": lambda: SphereView(angular_radius_rad=-0.1),
    "crop without pixels": lambda: SphereView(size=0),
    "rig without a mirror": lambda: Rig("two", {"diffuse": SphereView()}),
    "unknown material": lambda: reflectance.analytic_basis("velvet", SphereView()),
    "basis of another size": lambda: reflectance.ReflectanceBasis(
        np.zeros((4, 4), np.float32), SphereView(size=4), 8
    ),
    "basis with a nan": lambda: reflectance.ReflectanceBasis(
        np.full((16, 64), np.nan, np.float32), SphereView(size=4), 8
    ),
    "light of another size than the basis": lambda: relight.relight(
        reflectance.analytic_basis("mirror", SphereView(size=8), 16), Lighting(ONES)
    ),
    "panorama of half the sphere": lambda: resample.ball_from_latlong(ONES, 8),
    "looking straight up": lambda: frames.looking_at(frames.UP),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_raises_shape_error_that_says_what_to_do(name: str) -> None:
    with pytest.raises(ShapeError) as caught:
        BAD[name]()
    error = caught.value
    assert isinstance(error, InputError)
    assert error.expected
    assert error.do
    assert str(error) == f"expected {error.expected}; got {error.got}; {error.do}"
    assert "\n" not in str(error)


def test_errors_come_back_whole_from_a_worker_process() -> None:
    for error in (
        ShapeError("a", "b", "c"),
        ImageFileError("a", "b", "c"),
        ModelError("x", "", ""),
    ):
        back = pickle.loads(pickle.dumps(error))
        assert type(back) is type(error)
        assert str(back) == str(error)
    extra = pickle.loads(pickle.dumps(MissingExtraError("render", "Mitsuba")))
    assert (extra.extra, extra.needed_for) == ("render", "Mitsuba")


def test_a_missing_extra_names_the_command() -> None:
    assert 'pip install ".[capture]"' in str(MissingExtraError("capture", "video"))


def test_every_error_of_ours_is_caught_by_its_roots() -> None:
    assert issubclass(ShapeError, InputError)
    assert issubclass(MissingExtraError, InputError)
    assert issubclass(InputError, DeepLightError)


@pytest.mark.parametrize(
    ("value", "field"),
    [
        (Lighting(ONES), "radiance"),
        (SphereView(), "size"),
        (PAPER_RIG, "name"),
        (PinholeCamera(4, 4, 1.0), "width"),
        (CameraResponse(), "gamma"),
        (reflectance.analytic_basis("mirror", SphereView(size=8), 8), "weights"),
        (harmonics.dominant_light(Lighting(ONES)), "share"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_values_are_frozen(value: object, field: str) -> None:
    if isinstance(value, str):
        return
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(value, field, None)


@pytest.mark.parametrize(
    "array",
    [
        Lighting(ONES).radiance,
        SphereView().ball_from_camera,
        SphereView().alpha(),
        reflectance.analytic_basis("diffuse", SphereView(size=8), 8).weights,
        mirror_ball.coverage(8),
        latlong.directions(4, 8),
        harmonics.dominant_light(Lighting(ONES)).direction,
        harmonics.dominant_light(Lighting(ONES)).irradiance,
    ],
    ids=[
        "radiance",
        "ball_from_camera",
        "alpha",
        "weights",
        "coverage",
        "latlong directions",
        "direction",
        "irradiance",
    ],
)
def test_arrays_that_are_kept_cannot_be_written_to(array: np.ndarray) -> None:
    with pytest.raises(ValueError, match="read-only"):
        array[...] = 0


@pytest.mark.parametrize(
    "make",
    [
        lambda: Lighting(ONES),
        lambda: SphereView(frames.rotation("y", 0.3), 0.1, 8),
        lambda: Rig.from_dict(PAPER_RIG.to_dict()),
        lambda: reflectance.ReflectanceBasis(np.ones((16, 16)), SphereView(size=4), 4),
        lambda: harmonics.dominant_light(Lighting(ONES)),
    ],
    ids=["Lighting", "SphereView", "Rig", "ReflectanceBasis", "DominantLight"],
)
def test_values_that_hold_arrays_are_equal_to_themselves_alone(make: Callable[[], object]) -> None:
    one, other = make(), make()
    assert one == one  # with arrays compared, this would raise
    assert one != other
    assert len({one, other}) == 2


def test_too_bright_log_radiance_is_reported_once_by_its_error() -> None:
    too_bright = spoilt(200)
    with warnings.catch_warnings(action="error"), pytest.raises(ShapeError):
        Lighting.from_log_radiance(too_bright)


def test_lighting_keeps_its_own_copy() -> None:
    mine = ONES.copy()
    light = Lighting(mine)
    mine[:] = 7
    assert (light.radiance <= 1).all()
    assert mine.flags.writeable


def test_a_view_leaves_its_callers_matrix_writable() -> None:
    matrix = np.eye(3)
    view = SphereView(matrix)
    matrix[0, 0] = 5
    np.testing.assert_array_equal(view.ball_from_camera, np.eye(3))


def test_corners_off_the_disc_mean_nothing() -> None:
    radiance = ONES.copy()
    radiance[0, 0] = np.nan
    assert Lighting(radiance).radiance[0, 0].tolist() == [0, 0, 0]


def test_control_characters_of_damaged_files_are_written_out() -> None:
    error = InputError("a channel R", "channels R, \x02\x1b[31m", "export it")
    assert str(error) == "expected a channel R; got channels R, \\x02\\x1b[31m; export it"

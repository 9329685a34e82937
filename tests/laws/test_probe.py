"""Light between mappings: directions stay, power stays, and wrong shapes are refused."""

import numpy as np
import pytest

from deeplight.errors import ShapeError
from deeplight.frames import normalised
from deeplight.mappings import angular_map, cube, latlong, layouts

HEIGHT = 128
DIRECTIONS = latlong.directions(HEIGHT, 2 * HEIGHT) + np.float32(2)
SQUARE = ("mirror-ball", "angular")
IN_PARTS = ("cross", "horizontal-cross", "strip", "column")


def sun(direction: tuple[float, float, float], radius_deg: float = 2.0) -> np.ndarray:
    cosine = latlong.directions(256, 512) @ normalised(np.array(direction, float)).astype(
        np.float32
    )
    lit = cosine > np.cos(np.radians(radius_deg))
    return np.where(lit[..., None], np.float32(1e4), np.float32(0)) * np.ones(3, np.float32)


def power(radiance: np.ndarray) -> float:
    return float((radiance[..., 0] * latlong.solid_angles(*radiance.shape[:2])).sum())


@pytest.mark.parametrize("mapping", [*IN_PARTS, "angular", "latlong"])
def test_every_direction_comes_back(mapping) -> None:
    size = HEIGHT // 2 if mapping in IN_PARTS else HEIGHT
    picture = layouts.probe_from_latlong(DIRECTIONS, mapping, size)
    back = layouts.latlong_from_probe(picture, mapping)
    np.testing.assert_allclose(back, DIRECTIONS, atol=0.02)


@pytest.mark.parametrize("mapping", [*IN_PARTS, "angular"])
def test_a_mirrored_picture_would_be_found(mapping) -> None:
    """The twin."""
    size = HEIGHT // 2 if mapping in IN_PARTS else HEIGHT
    picture = layouts.probe_from_latlong(DIRECTIONS, mapping, size)[:, ::-1]
    back = layouts.latlong_from_probe(np.ascontiguousarray(picture), mapping)
    assert np.abs(back - DIRECTIONS).max() > 0.5


def test_the_mirror_ball_comes_back_but_for_its_rim() -> None:
    ball = layouts.probe_from_latlong(DIRECTIONS, "mirror-ball", HEIGHT)
    back = layouts.latlong_from_probe(ball, "mirror-ball")
    error = np.abs(back - DIRECTIONS)
    assert error.mean() < 0.005
    assert error[DIRECTIONS[..., 2] > 1.1].max() < 0.05  # 25 degrees off straight ahead


@pytest.mark.parametrize("direction", [(0, 1, 0), (1, 1, 1), (0.3, -0.2, -1), (0.5, 0.2, 1)])
@pytest.mark.parametrize("mapping", ["cube", "angular"])
def test_a_suns_power_is_kept(mapping, direction) -> None:
    light = sun(direction)
    if mapping == "cube":
        faces = layouts.cube_from_latlong(light, 64)
        whole = float((faces[..., 0] * cube.solid_angles(64)).sum())
        assert whole == pytest.approx(power(light), rel=0.03)
        back = layouts.latlong_from_cube(faces)
    else:
        back = layouts.latlong_from_probe(layouts.angular_from_latlong(light, 128), "angular")
    assert power(back) == pytest.approx(power(light), rel=0.03)


def test_positions_are_the_directions_pixels() -> None:
    face, row, column = cube.position(cube.directions(8), 8)
    np.testing.assert_array_equal(face, np.arange(6)[:, None, None] * np.ones((6, 8, 8)))
    np.testing.assert_allclose(row, np.arange(8)[None, :, None] * np.ones((6, 8, 8)), atol=1e-9)
    np.testing.assert_allclose(column, np.arange(8)[None, None] * np.ones((6, 8, 8)), atol=1e-9)
    on_disc = angular_map.on_disc(16)
    row, column = angular_map.position(angular_map.directions(16), 16)
    np.testing.assert_allclose(row[on_disc], np.nonzero(on_disc)[0], atol=1e-9)
    np.testing.assert_allclose(column[on_disc], np.nonzero(on_disc)[1], atol=1e-9)


def test_the_angular_maps_middle_is_the_view_and_its_right_is_plus_x() -> None:
    directions = angular_map.directions(64)
    np.testing.assert_allclose(directions[32, 32], [0, 0, -1], atol=0.08)
    np.testing.assert_allclose(directions[32, 47], [1, 0, 0], atol=0.08)
    np.testing.assert_allclose(directions[16, 32], [0, 1, 0], atol=0.08)


@pytest.mark.parametrize(
    ("shape", "mapping"),
    [
        ((64, 128), "latlong"),
        ((64, 48), "cross"),
        ((48, 64), "horizontal-cross"),
        ((16, 96), "strip"),
        ((96, 16), "column"),
    ],
)
def test_a_shape_gives_its_mapping(shape, mapping) -> None:
    assert layouts.mapping_of(*shape) == mapping


@pytest.mark.parametrize(("shape", "said"), [((64, 64), "angular"), ((64, 100), "crop")])
def test_other_shapes_are_refused(shape, said) -> None:
    with pytest.raises(ShapeError, match=said):
        layouts.mapping_of(*shape)


def test_a_cross_of_the_wrong_sides_is_refused() -> None:
    with pytest.raises(ShapeError, match="3 by 4 squares"):
        layouts.latlong_from_probe(np.ones((64, 47, 3), np.float32), "cross")

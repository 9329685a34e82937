"""The tangent frustum of section 3.1: geometry checked against points on a real sphere."""

import numpy as np
import pytest

from deeplight import frames
from deeplight.camera import BACKGROUND_FRACTION, TRAINED_CAMERA
from deeplight.mappings import mirror_ball
from deeplight.sphere import PAPER_RIG, SPHERES, Rig, SphereView, rig_in_frame

TILTED = SphereView(frames.looking_at(np.array([0.3, -0.5, -1.0])), np.radians(12))
VIEWS = {**PAPER_RIG.views, "tilted": TILTED, "distant": SphereView()}
NEAR = {name: view for name, view in VIEWS.items() if view.angular_radius_rad > 0}


def centre_of(view: SphereView) -> np.ndarray:
    """Where a sphere of radius 1 stands, camera frame."""
    return view.ball_from_camera.T @ frames.VIEW / np.sin(view.angular_radius_rad)


def silhouette_of(view: SphereView, points: int = 360) -> np.ndarray:
    """Directions from the camera that just touch the sphere."""
    around = np.linspace(0, 2 * np.pi, points, endpoint=False)
    sin, cos = np.sin(view.angular_radius_rad), np.cos(view.angular_radius_rad)
    cone = np.stack([sin * np.cos(around), sin * np.sin(around), np.full(points, -cos)], axis=-1)
    return cone @ view.ball_from_camera


@pytest.mark.parametrize("name", NEAR)
def test_normals_are_points_of_the_sphere_the_camera_sees_there(name: str) -> None:
    view = NEAR[name]
    inside = np.hypot(*mirror_ball.grid(view.size)) <= 1
    points = centre_of(view) + view.normals()[inside]
    towards_camera = -points / np.linalg.norm(points, axis=-1, keepdims=True)
    np.testing.assert_allclose(towards_camera, view.views()[inside], atol=1e-6)
    assert ((view.normals() * view.views()).sum(-1)[inside] >= 0).all()  # the near side


@pytest.mark.parametrize("name", NEAR)
def test_crop_positions_are_the_tangent_cameras_rays(name: str) -> None:
    """Half image size = tan(asin(R / d)): the crop is a pinhole aimed at the centre."""
    view = NEAR[name]
    u, v = mirror_ball.grid(view.size)
    t = np.tan(view.angular_radius_rad)
    plane = np.stack([u * t, v * t, -np.ones_like(u)], axis=-1) @ view.ball_from_camera
    rays = plane / np.linalg.norm(plane, axis=-1, keepdims=True)
    inside = np.hypot(u, v) <= 1
    np.testing.assert_allclose(rays[inside], -view.views()[inside], atol=1e-6)


@pytest.mark.parametrize("name", NEAR)
def test_the_silhouette_touches_all_four_edges_of_the_crop(name: str) -> None:
    view = NEAR[name]
    in_ball = silhouette_of(view) @ view.ball_from_camera.T
    u, v = (in_ball[:, i] / -in_ball[:, 2] / np.tan(view.angular_radius_rad) for i in (0, 1))
    np.testing.assert_allclose([u.min(), u.max(), v.min(), v.max()], [-1, 1, -1, 1], atol=1e-9)
    np.testing.assert_allclose(np.hypot(u, v), 1, atol=1e-9)  # a circle again


@pytest.mark.parametrize("name", VIEWS)
def test_the_mirror_law_holds_at_every_position(name: str) -> None:
    view = VIEWS[name]
    normals, views, reflected = view.normals(), view.views(), view.reflected()
    np.testing.assert_allclose(np.linalg.norm(reflected, axis=-1), 1, atol=1e-6)
    np.testing.assert_allclose((reflected * normals).sum(-1), (views * normals).sum(-1), atol=1e-6)
    np.testing.assert_allclose(np.cross(reflected + views, normals), 0, atol=1e-6)


def test_a_distant_sphere_on_the_axis_is_the_mirror_ball() -> None:
    np.testing.assert_allclose(
        SphereView().reflected(), mirror_ball.pixel_directions(32), atol=1e-12
    )


def test_a_near_sphere_tends_to_the_distant_one() -> None:
    near = SphereView(angular_radius_rad=1e-4)
    inside = np.hypot(*mirror_ball.grid(32)) < 0.99
    np.testing.assert_allclose(near.normals()[inside], SphereView().normals()[inside], atol=1e-3)


def test_mask_is_inside_alpha_and_alpha_is_the_disc() -> None:
    view = SphereView()
    assert view.alpha().sum() * (2 / 32) ** 2 == pytest.approx(np.pi, rel=1e-4)
    assert (view.alpha()[view.mask()] > 0.999).all()
    corners = np.hypot(*mirror_ball.grid(32)) + np.hypot(1, 1) / 32
    assert view.mask().sum() == (corners <= 1.0001).sum() == 732


@pytest.mark.parametrize("name", SPHERES)
def test_the_paper_rig_lies_in_the_lower_fifth_and_inside_the_frame(name: str) -> None:
    row, column = TRAINED_CAMERA.pixel_of_directions(silhouette_of(PAPER_RIG.views[name]))
    assert row.min() > BACKGROUND_FRACTION * TRAINED_CAMERA.height
    assert row.max() < TRAINED_CAMERA.height - 1
    assert column.min() > 0
    assert column.max() < TRAINED_CAMERA.width - 1


def test_the_paper_rigs_spheres_do_not_touch_and_stand_60_cm_away() -> None:
    centres = [centre_of(PAPER_RIG.views[name]) for name in SPHERES]
    for i, j in ((0, 1), (1, 2), (0, 2)):
        assert np.linalg.norm(centres[i] - centres[j]) > 2  # radii
    for name in SPHERES:
        assert 0.04 / np.sin(PAPER_RIG.views[name].angular_radius_rad) == pytest.approx(0.60)


def test_the_paper_rigs_frames_are_pitched_down_and_differ_in_yaw() -> None:
    """Per-sphere frames: some 25 degrees below the axis, some 10 degrees apart."""
    towards = [PAPER_RIG.views[name].ball_from_camera.T @ frames.VIEW for name in SPHERES]
    pitch = np.degrees([np.arcsin(d[1]) for d in towards])
    yaw = np.degrees([np.arctan2(d[0], -d[2]) for d in towards])
    assert (pitch < -23).all()
    assert (pitch > -30).all()
    np.testing.assert_allclose(np.diff(yaw), 12, atol=1.5)


def test_mirrored_twice_is_the_same_rig_and_once_is_not() -> None:
    twice = PAPER_RIG.mirrored().mirrored()
    for name in SPHERES:
        np.testing.assert_array_equal(
            twice.views[name].ball_from_camera, PAPER_RIG.views[name].ball_from_camera
        )
    once = PAPER_RIG.mirrored().views["mirror"].ball_from_camera
    np.testing.assert_allclose(once, PAPER_RIG.views["diffuse"].ball_from_camera, atol=1e-12)
    assert np.linalg.det(once) == pytest.approx(1)


def test_a_rig_survives_json() -> None:
    back = Rig.from_dict(PAPER_RIG.to_dict())
    assert back.name == PAPER_RIG.name
    for name in SPHERES:
        np.testing.assert_array_equal(
            back.views[name].ball_from_camera, PAPER_RIG.views[name].ball_from_camera
        )
        assert back.views[name].angular_radius_rad == PAPER_RIG.views[name].angular_radius_rad


def test_a_rig_in_the_middle_of_the_frame_looks_straight_ahead() -> None:
    rig = rig_in_frame("centred", dict.fromkeys(SPHERES, (0.0, 0.0)), 0.04, 0.6)
    np.testing.assert_allclose(rig.views["mirror"].ball_from_camera, np.eye(3), atol=1e-12)

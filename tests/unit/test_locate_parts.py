"""Each step of finding the spheres by itself, on drawn pictures."""

import pickle
from itertools import permutations
from pathlib import Path

import cv2
import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.camera_response import encode
from deeplight.capture.candidates import (
    Candidate,
    completed,
    find_candidates,
    separation_rad,
    triples,
)
from deeplight.capture.conic import Cone, pixel_scale
from deeplight.capture.located import NotLocated, TagRig, cones_of
from deeplight.capture.materials import brightest, name_spheres
from deeplight.capture.motion import Evidence, persistent_edges
from deeplight.capture.refine import SphereOutline, refine, refine_by_sides, split_cost
from deeplight.capture.rig_file import read_rig_file, write_rig_file
from deeplight.capture.sizes import alike_sizes, expected_radius
from deeplight.capture.tag import cones_next_to_tag, tag_corners
from deeplight.errors import DataSetError
from deeplight.frames import looking_at, normalised, rotation, turned
from deeplight.lighting import Lighting
from deeplight.reflectance import analytic_basis
from deeplight.relight import relight
from deeplight.sphere import PAPER_RIG, SPHERES, SphereView

CAMERA = PinholeCamera(180, 320, np.radians(66))


def covered(cone: Cone, camera: PinholeCamera = CAMERA) -> np.ndarray:
    """Share of each pixel inside the outline, with a sharp edge of about a pixel."""
    angle = np.arccos(np.clip(camera.rays() @ cone.direction, -1, 1))
    slope = np.hypot(*np.gradient(angle))
    return np.clip((cone.angular_radius_rad - angle) / slope + 0.5, 0, 1)


def frames_of(cones: list[Cone], count: int = 12, seed: int = 0) -> list[np.ndarray]:
    """Flat discs that stay before a texture that differs in every frame."""
    rng = np.random.default_rng(seed)
    result = []
    for _ in range(count):
        coarse = rng.uniform(20, 235, (20, 12)).astype(np.float32)
        frame = cv2.resize(coarse, (CAMERA.width, CAMERA.height), interpolation=cv2.INTER_CUBIC)
        for i, cone in enumerate(cones):
            share = covered(cone)
            frame = frame * (1 - share) + share * (60 + 60 * i)
        result.append(np.clip(frame + rng.normal(0, 1.5, frame.shape), 0, 255).astype(np.uint8))
    return result


def cone_at(x: float, y: float, degrees: float) -> Cone:
    return Cone(normalised(np.array([x, y, -1.0])), float(np.radians(degrees)))


THREE = [cone_at(-0.2, -0.4, 4.0), cone_at(0.01, -0.42, 4.1), cone_at(0.22, -0.4, 3.9)]


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.7])
@pytest.mark.parametrize("growth", [0.0, 0.4])
def test_refine_follows_a_shift_and_a_growth_of_part_of_a_pixel(
    shift: float, growth: float
) -> None:
    pixel = 1 / pixel_scale(CAMERA)
    true = cone_at(0.1 + shift * pixel, -0.4, 4.0 + np.degrees(growth * pixel))
    start = cone_at(0.1 + 2 * pixel, -0.4 - 1.5 * pixel, 4.2)
    outline = refine(start, frames_of([true]), CAMERA)
    assert separation_rad(outline.cone, true) < 0.12 * pixel
    assert abs(outline.cone.angular_radius_rad - true.angular_radius_rad) < 0.12 * pixel
    assert outline.support > 0.8


def test_refine_ignores_a_stalk_and_a_hand_in_some_frames() -> None:
    frames = frames_of([THREE[1]])
    (row,), (column,) = CAMERA.pixel_of_directions(THREE[1].direction[None])
    for i, frame in enumerate(frames):
        cv2.line(frame, (int(column), int(row) + 15), (int(column), 319), 200, 5)
        if i % 4 == 0:
            cv2.circle(frame, (int(column) - 20, int(row)), 18, 90, -1)
    outline = refine(cone_at(0.012, -0.415, 4.3), frames, CAMERA)
    assert separation_rad(outline.cone, THREE[1]) * pixel_scale(CAMERA) < 0.25
    assert outline.cone.angular_radius_rad == pytest.approx(THREE[1].angular_radius_rad, rel=0.015)


def test_an_outline_that_is_not_there_has_no_support() -> None:
    assert refine(cone_at(0.0, 0.3, 4.0), frames_of(THREE), CAMERA).support < 0.15


def test_a_faint_outline_is_seen_by_spokes_together() -> None:
    """A disc six levels from what is around it, in noise of four: a picture far too dark."""
    rng, share = np.random.default_rng(2), covered(THREE[1])
    frames = [
        np.clip(20 + 6 * share + rng.normal(0, 4, share.shape), 0, 255).astype(np.uint8)
        for _ in range(24)
    ]
    there = refine(cone_at(0.013, -0.417, 4.2), frames, CAMERA)
    assert there.together > 0.6 > 2 * there.support
    assert separation_rad(there.cone, THREE[1]) * pixel_scale(CAMERA) < 1.5
    for x, y in ((0.0, 0.3), (-0.2, 0.1), (0.2, 0.5), (0.1, 0.0)):  # nothing is there
        assert refine(cone_at(x, y, 4.0), frames, CAMERA).together < 0.4


@pytest.mark.parametrize("support", [0.5, 1.0])
def test_a_highlight_is_not_taken_for_a_sphere(support: float) -> None:
    """It is where less of an outline is seen than at the other sphere's size, and only there."""
    silver, diffuse = THREE[1], cone_at(0.22, -0.4, 4.1)
    inside = Cone(silver.direction, 0.78 * silver.angular_radius_rad)
    frames = frames_of([silver, diffuse])
    share = covered(inside)
    frames = [np.round(frame * (1 - share) + 240 * share).astype(np.uint8) for frame in frames]
    named = {
        "matte_silver": SphereOutline(inside, support, 1.0),
        "diffuse": SphereOutline(diffuse, 0.99, 1.0),
    }
    found = alike_sizes(named, frames, CAMERA)
    assert found["diffuse"] is named["diffuse"]
    radius = found["matte_silver"].cone.angular_radius_rad
    wanted = silver if support < 0.9 else inside
    assert radius == pytest.approx(wanted.angular_radius_rad, rel=0.02)


def found_in(frames: list[np.ndarray]) -> list[Cone]:
    x, y = persistent_edges(frames)
    options = triples(find_candidates(Evidence(x, y, 1.0), CAMERA))
    return [c.cone for c in options[0][1]] if options else []


def test_three_discs_that_stay_are_found_and_flipping_flips_them() -> None:
    frames = frames_of(THREE, 16)
    found = sorted(found_in(frames), key=lambda c: c.direction[0])
    flipped = sorted(found_in([f[:, ::-1].copy() for f in frames]), key=lambda c: -c.direction[0])
    assert len(found) == len(flipped) == 3
    for cone, other, true in zip(found, flipped, THREE, strict=True):
        assert separation_rad(cone, true) * pixel_scale(CAMERA) < 1.0
        mirrored = Cone(other.direction * [-1, 1, 1], other.angular_radius_rad)
        assert separation_rad(cone, mirrored) * pixel_scale(CAMERA) < 0.5


def test_two_discs_are_not_three() -> None:
    assert found_in(frames_of(THREE[:2], 16)) == []


def test_circles_that_a_mirror_shows_are_not_spheres() -> None:
    """Three alike inside a clearer, larger circle are its reflections; next to it they count."""
    small = [Candidate(cone_at(x, -0.4, 1.5), 0.4) for x in (-0.09, 0.0, 0.09)]
    around = Candidate(cone_at(0.0, -0.4, 7.0), 0.7)
    assert triples([around, *small]) == []
    assert len(triples([Candidate(cone_at(0.0, 0.4, 7.0), 0.7), *small])) == 1


def test_a_bar_is_completed_from_two_spheres() -> None:
    places = np.array([[-0.2, -0.4, -1.0], [0.01, -0.41, -1.02], [0.22, -0.42, -1.04]])
    reach = np.linalg.norm(places, axis=1)
    bar = [
        Cone(normalised(at), float(np.arcsin(0.07 / d)))
        for at, d in zip(places, reach, strict=True)
    ]
    for missing in range(3):
        two = [Candidate(cone, 0.8) for i, cone in enumerate(bar) if i != missing]
        thirds = [three[2] for three in completed(two, CAMERA)]
        off = [separation_rad(third, bar[missing]) for third in thirds]
        assert min(off) < 1e-6
        third = thirds[int(np.argmin(off))]
        assert third.angular_radius_rad == pytest.approx(bar[missing].angular_radius_rad, rel=1e-6)
    assert completed([Candidate(bar[0], 0.8)], CAMERA) == []


@pytest.mark.parametrize("off", [-0.04, 0.0, 0.04])
def test_a_rim_without_an_edge_is_found_by_its_two_sides(off: float) -> None:
    """Smooth inside, busy outside, of one mean brightness: what a mirror ball looks like."""
    rng = np.random.default_rng(3)
    frames = []
    for _ in range(12):
        noise = rng.uniform(0, 1, (CAMERA.height, CAMERA.width)).astype(np.float32)
        world = 110 + 400 * (cv2.GaussianBlur(noise, (0, 0), 1.2) - 0.5)
        ball = 110 + 8 * (cv2.GaussianBlur(noise, (0, 0), 1.2) - 0.5)
        alpha = covered(THREE[1])
        frames.append(np.clip(world * (1 - alpha) + ball * alpha, 0, 255).astype(np.uint8))
    size = THREE[1].angular_radius_rad
    start = cone_at(0.004, -0.404, np.degrees(size * (1 + off)))
    held = refine_by_sides(start, frames, CAMERA, 0.001)
    assert separation_rad(held.cone, THREE[1]) * pixel_scale(CAMERA) < 1.0
    assert abs(held.cone.angular_radius_rad - size) * pixel_scale(CAMERA) < 1.0
    stiff = refine_by_sides(start, frames, CAMERA, 1e6)
    blur = 0.5 / pixel_scale(CAMERA)
    assert stiff.cone.angular_radius_rad == pytest.approx(size * (1 + off) - blur, rel=2e-3)


def test_a_bright_ring_inside_the_rim_is_not_the_rim() -> None:
    """A mirror before dark ground: its rim shows more of it, and a horizon ends 6 px inside."""
    rng = np.random.default_rng(4)
    offsets = np.arange(-16, 16.1, 0.5)
    ground = 60 + cv2.GaussianBlur(rng.normal(0, 25, (288, len(offsets))), (0, 0), 1.5)
    profiles = np.where(offsets > 0, ground, np.where(offsets < -6, 100.0, 58.0))
    profiles += rng.normal(0, 1, profiles.shape)
    places, plain = split_cost(profiles.reshape(12, 24, -1), offsets)
    _, ringed = split_cost(profiles.reshape(12, 24, -1), offsets, ringed=True)
    assert abs(places[ringed.sum(axis=0).argmin()]) < 1
    assert places[plain.sum(axis=0).argmin()] == pytest.approx(-6, abs=1)


def lit_frames(order: tuple[str, ...], stops: float) -> tuple[list[Cone], list[np.ndarray]]:
    """Three spheres in one light with a lamp and a window, pasted where the cones are."""
    rng = np.random.default_rng(5)
    radiance = cv2.resize(rng.uniform(0.02, 0.5, (8, 8, 3)), (16, 16)).astype(np.float32)
    radiance[2:4, 6:8] = 6.0
    radiance[9:12, 3:5] = 1.5
    lighting = Lighting(radiance * 2.0**stops)
    frame = np.full((CAMERA.height, CAMERA.width, 3), 90, np.uint8)
    for name, cone in zip(order, THREE, strict=True):
        view = SphereView(looking_at(cone.direction), cone.angular_radius_rad, 16)
        ball = relight(analytic_basis(name, view, 16), lighting)
        pixels = encode(np.minimum(ball, 1.0)) * 255
        rays = turned(CAMERA.rays(), view.ball_from_camera)
        half = np.tan(cone.angular_radius_rad)
        u, v = rays[..., 0] / -rays[..., 2] / half, rays[..., 1] / -rays[..., 2] / half
        column, row = (u + 1) * 8 - 0.5, (1 - v) * 8 - 0.5
        seen = cv2.remap(
            pixels, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR
        )
        inside = covered(cone) > 0.5
        frame[inside] = seen[inside].astype(np.uint8)
    return list(THREE), [frame]


@pytest.mark.parametrize(
    ("order", "stops"),
    [(order, 0.0) for order in permutations(SPHERES)] + [(SPHERES, -2.0), (SPHERES[::-1], 1.5)],
)
def test_names_follow_the_spheres_in_any_order_and_exposure(
    order: tuple[str, ...], stops: float
) -> None:
    naming = name_spheres(*lit_frames(order, stops), CAMERA)
    assert naming.names == order
    assert naming.confidence > 0.8


def test_a_clipped_lamp_is_made_as_bright_as_both_spheres_say() -> None:
    rng = np.random.default_rng(6)
    basis = rng.uniform(0, 1, (60, 20)) ** 6 / 20
    light = rng.uniform(0.05, 0.4, (20, 3))
    true = light.copy()
    true[7] = 90.0  # seen as white, 1.0
    light[[3, 7, 12]] = true[[3, 12]] = 1.0
    true[7] = 90.0
    free = np.isin(np.arange(20), [3, 7, 12])
    seen = basis @ true
    clipped = (seen >= 1).any(axis=1)
    made = brightest(basis, light, free, np.minimum(seen, 1), clipped)
    dark = ~clipped
    assert dark.sum() > 10
    assert np.abs(encode(made[dark]) - encode(seen[dark])).max() < 0.01
    without = brightest(basis, light, np.zeros(20, bool), np.minimum(seen, 1), clipped)
    assert np.abs(encode(without[dark]) - encode(seen[dark])).max() > 0.1


def test_three_alike_have_no_sure_names() -> None:
    cones, frames = lit_frames(SPHERES, 0.0)
    frames[0][:] = 128
    assert name_spheres(cones, frames, CAMERA).confidence < 0.8


def test_a_rig_file_gives_the_rig_back(tmp_path: Path) -> None:
    write_rig_file(tmp_path / "rig.json", PAPER_RIG)
    again = read_rig_file(tmp_path / "rig.json")
    assert not isinstance(again, TagRig)
    assert again.to_dict() == PAPER_RIG.to_dict()
    write_rig_file(tmp_path / "tag.json", TAG_RIG)
    tag = read_rig_file(tmp_path / "tag.json")
    assert isinstance(tag, TagRig)
    assert tag.tag_id == TAG_RIG.tag_id
    assert all((tag.centres_m[n] == TAG_RIG.centres_m[n]).all() for n in SPHERES)


@pytest.mark.parametrize(
    "text",
    ["", "[]", "3", "{", '{"name": "x"}', '{"tag": {}, "spheres": {}}', '{"tag": 1}', "[" * 99_999]
    + ['{"name": "x", "spheres": {"mirror": {"ball_from_camera": [[NaN]]}}}'],
)
def test_a_broken_rig_file_is_one_line(text: str, tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text(text)
    with pytest.raises(DataSetError) as caught:
        read_rig_file(tmp_path / "rig.json")
    assert "\n" not in str(caught.value)


TAG_RIG = TagRig(
    7,
    0.05,
    {name: np.array([0.1 * (i - 1), 0.08, 0.01]) for i, name in enumerate(SPHERES)},
    dict.fromkeys(SPHERES, 0.08),
)
TAG_CAMERA = PinholeCamera(540, 960, np.radians(66))


def drawn_tag(camera_from_tag: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """A grey frame with tag 7 of 5 cm in it, by homography."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    pixels = np.pad(cv2.aruco.generateImageMarker(family, 7, 200), 25, constant_values=255)
    half = 0.025 * 250 / 200
    square = half * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    row, column = TAG_CAMERA.pixel_of_directions(square @ camera_from_tag.T + origin)
    source = np.array([[-0.5, -0.5], [249.5, -0.5], [249.5, 249.5], [-0.5, 249.5]], np.float32)
    target = np.stack([column, row], axis=1).astype(np.float32)
    matrix = cv2.getPerspectiveTransform(source, target)
    size = (TAG_CAMERA.width, TAG_CAMERA.height)
    return cv2.warpPerspective(pixels, matrix, size, flags=cv2.INTER_AREA, borderValue=150)


def test_a_drawn_tag_shows_where_the_spheres_are() -> None:
    camera_from_tag = rotation("y", 0.25) @ rotation("x", -0.3)
    origin = np.array([0.02, -0.15, -0.55])
    frame = drawn_tag(camera_from_tag, origin)
    corners = tag_corners([frame], 7)
    assert corners is not None
    cones = cones_next_to_tag(corners, TAG_RIG, TAG_CAMERA)
    assert cones is not None
    for name, cone in cones.items():
        true = camera_from_tag @ TAG_RIG.centres_m[name] + origin
        assert np.degrees(np.arccos(cone.direction @ normalised(true))) < 0.5
        expected = np.arcsin(0.04 / np.linalg.norm(true))
        assert cone.angular_radius_rad == pytest.approx(expected, rel=0.03)
    assert tag_corners([frame], 8) is None


def test_the_mirror_is_expected_as_large_as_the_others_or_in_their_row() -> None:
    even = {n: SphereOutline(c, 1.0, 1.0) for n, c in cones_of(PAPER_RIG).items()}
    radius = PAPER_RIG.views["mirror"].angular_radius_rad
    assert expected_radius(even) == pytest.approx(radius, rel=1e-9)
    # The same centres on a plane across the view: those at the side are farther away.
    flat = {
        n: Cone(c.direction, float(np.arcsin(0.07 * -c.direction[2])))
        for n, c in cones_of(PAPER_RIG).items()
    }
    row = {n: SphereOutline(c, 1.0, 1.0) for n, c in flat.items()}
    assert expected_radius(row) == pytest.approx(flat["mirror"].angular_radius_rad, rel=1e-3)


def test_not_located_travels_between_processes_with_its_picture() -> None:
    error = NotLocated("a", "b", "c", np.zeros((2, 2, 3), np.uint8))
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert again.overlay.shape == (2, 2, 3)

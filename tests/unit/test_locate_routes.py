"""Each way of finding the spheres, through `locate`, on tiny drawn clips."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.camera_response import encode
from deeplight.capture.conic import Cone, moved, pixel_scale
from deeplight.capture.locate import LocateSettings, NotLocated, TagRig, locate
from deeplight.capture.located import cones_of, moved_together, rig_of
from deeplight.capture.materials import Naming
from deeplight.capture.rig_file import read_rig_file
from deeplight.errors import DataSetError
from deeplight.frames import looking_at, normalised, turned
from deeplight.io.video import VideoFrame
from deeplight.lighting import Lighting
from deeplight.reflectance import analytic_basis
from deeplight.relight import relight
from deeplight.sphere import SPHERES, Rig, SphereView

CAMERA = PinholeCamera(360, 640, np.radians(66))
CENTRES_M = {name: np.array([0.13 * (i - 1), -0.1, -0.55]) for i, name in enumerate(SPHERES)}
CONES = {
    name: Cone(normalised(at), float(np.arcsin(0.04 / np.linalg.norm(at))))
    for name, at in CENTRES_M.items()
}
TAG_M, TAG_AT_M = 0.05, np.array([0.0, -0.2, -0.55])  # larger than life: the frame is small
TAG = TagRig(
    7,
    TAG_M,
    {name: at - TAG_AT_M for name, at in CENTRES_M.items()},
    dict.fromkeys(SPHERES, 0.08),
)


class Drawn(VideoFrame):
    """A frame that is not from a file."""

    def __init__(self, number: int, time_s: float, pixels: np.ndarray) -> None:
        vars(self).update(number=number, time_s=time_s, pixels=pixels)

    @cached_property
    def luma(self) -> np.ndarray:
        return cv2.cvtColor(self.rgb(), cv2.COLOR_RGB2GRAY)

    def averaged_luma(self, average: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        return average(self.luma)

    def rgb(self) -> np.ndarray:
        return np.asarray(vars(self)["pixels"])


def paste(frame: np.ndarray, name: str, cone: Cone) -> None:
    """A sphere of that material in a room with a lamp and a window."""
    radiance = np.random.default_rng(5).uniform(0.02, 0.5, (16, 16, 3)).astype(np.float32)
    radiance[2:4, 6:8], radiance[9:12, 3:5] = 6.0, 1.5
    view = SphereView(looking_at(cone.direction), cone.angular_radius_rad, 16)
    ball = encode(np.minimum(relight(analytic_basis(name, view, 16), Lighting(radiance)), 1)) * 255
    rays = turned(CAMERA.rays(), view.ball_from_camera)
    half = np.tan(cone.angular_radius_rad)
    u, v = rays[..., 0] / -rays[..., 2] / half, rays[..., 1] / -rays[..., 2] / half
    at = ((u + 1) * 8 - 0.5).astype(np.float32), ((1 - v) * 8 - 0.5).astype(np.float32)
    seen = cv2.remap(ball.astype(np.float32), *at, cv2.INTER_LINEAR, borderMode=1)
    angle = np.arccos(np.clip(CAMERA.rays() @ cone.direction, -1, 1))
    share = np.clip((cone.angular_radius_rad - angle) * pixel_scale(CAMERA) + 0.5, 0, 1)[..., None]
    frame[:] = frame * (1 - share) + seen * share


def paste_tag(frame: np.ndarray) -> None:
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    scale = pixel_scale(CAMERA) / -TAG_AT_M[2]
    side = round(TAG_M * scale * 1.25)
    pixels = np.pad(cv2.aruco.generateImageMarker(family, 7, 200), 25, constant_values=255)
    (row,), (column,) = CAMERA.pixel_of_directions(TAG_AT_M[None])
    top, left = round(row - (side - 1) / 2), round(column - (side - 1) / 2)
    small = cv2.resize(pixels, (side, side), interpolation=cv2.INTER_AREA)
    frame[top : top + side, left : left + side] = small[..., None]


def clip(cones: dict[str, Cone], tag: bool = False, moving: bool = True) -> Iterator[Drawn]:
    """Ten frames of spheres before a coarse texture that goes by."""
    rng = np.random.default_rng(3)
    world = cv2.resize(rng.uniform(20, 235, (40, 40, 3)).astype(np.float32), (800, 800))
    rig = np.zeros((640, 360, 3), np.float32)
    held = np.zeros_like(rig)
    for name, cone in cones.items():
        paste(rig, name, cone)
        ones = np.zeros_like(rig)
        angle = np.arccos(np.clip(CAMERA.rays() @ cone.direction, -1, 1))
        ones += np.clip((cone.angular_radius_rad - angle) * pixel_scale(CAMERA) + 0.5, 0, 1)[
            ..., None
        ]
        held = np.maximum(held, ones)
    for number in range(10):
        step = 12 * number * moving
        frame = world[step : step + 640, step : step + 360] * (1 - held) + rig
        if tag:
            paste_tag(frame)
        noisy = frame + rng.normal(0, 1.0, frame.shape)
        pixels = np.clip(noisy, 0, 255).astype(np.uint8)
        yield Drawn(number, number / 30, pixels)  # type: ignore[arg-type]


@lru_cache(maxsize=1)
def usual() -> tuple[Drawn, ...]:
    """The spheres where they belong; drawn once."""
    return tuple(clip(CONES))


def found(frames: Iterable[Drawn], rig: Rig | TagRig | None) -> dict[str, Cone]:
    return cones_of(locate(iter(frames), CAMERA, LocateSettings(rig=rig)).rig)  # type: ignore[arg-type]


def off_px(found: dict[str, Cone], true: dict[str, Cone] = CONES) -> float:
    """The largest error of a centre or a radius."""
    f = pixel_scale(CAMERA)
    return max(
        f
        * max(
            float(np.linalg.norm(found[n].direction - c.direction)),
            abs(found[n].angular_radius_rad - c.angular_radius_rad),
        )
        for n, c in true.items()
    )


def test_a_saved_rig_is_found_again_where_it_slipped_by_two_pixels() -> None:
    slip = np.array([2.0, -1.0]) / pixel_scale(CAMERA)
    now = {name: moved(cone, slip, 0.0) for name, cone in CONES.items()}
    saved = rig_of(CONES, "saved")
    slipped = found(clip(now), saved)
    assert off_px(slipped, now) < 0.5
    assert off_px(slipped) > 1.5
    assert off_px(found(clip(CONES, moving=False), saved)) < 0.5


@pytest.mark.parametrize("far_px", [40.0, 150.0])
def test_a_saved_rig_that_is_elsewhere_is_refused(far_px: float) -> None:
    far = {n: moved(c, np.array([0, far_px / pixel_scale(CAMERA)]), 0.0) for n, c in CONES.items()}
    with pytest.raises(NotLocated, match="a saved rig whose") as caught:
        found(usual(), rig_of(far, "far"))
    assert caught.value.overlay is not None
    assert "\n" not in str(caught.value)


def test_a_saved_rig_with_other_materials_in_its_places_is_refused() -> None:
    swapped = dict(zip(SPHERES, [CONES[n] for n in SPHERES[::-1]], strict=True))
    with pytest.raises(NotLocated, match="other materials"):
        found(usual(), rig_of(swapped, "swapped"))


def test_one_outline_gone_astray_does_not_move_a_rig() -> None:
    bad = {**CONES, "mirror": moved(CONES["mirror"], np.array([0.01, 0.0]), 0.005)}
    assert off_px(moved_together(CONES, bad)) < 1e-9
    shifted = {n: moved(c, np.array([0.01, 0.0]), 0.0) for n, c in CONES.items()}
    assert off_px(moved_together(CONES, shifted)) > 1.0


def test_a_tag_shows_where_the_spheres_are() -> None:
    assert off_px(found(clip(CONES, tag=True, moving=False), TAG)) < 1.0


def test_a_missing_tag_and_another_tag_are_reported() -> None:
    for frames, rig in ((usual(), TAG), (clip(CONES, tag=True), replace(TAG, tag_id=8))):
        with pytest.raises(NotLocated, match="no AprilTag 36h11 number") as caught:
            found(frames, rig)
        assert caught.value.overlay is not None


def test_two_spheres_are_not_a_rig() -> None:
    with pytest.raises(NotLocated) as caught:
        found(clip({name: CONES[name] for name in SPHERES[:2]}), None)
    assert caught.value.overlay is not None


@pytest.mark.parametrize(("error", "moving", "is_found"), [
    (0.24, True, True), (0.26, True, False), (0.24, False, False),
])  # fmt: skip
def test_clear_outlines_may_be_lit_in_other_ways(
    error: float, moving: bool, is_found: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bright paint, or a lamp that one of them does not see: but only where the world moves."""
    named = Naming(SPHERES, 1.0, error)
    in_order = [CONES[name] for name in SPHERES]

    def in_their_order(cones: list[Cone], *_: object) -> Naming:
        near = [int(np.argmax([c.direction @ o.direction for o in in_order])) for c in cones]
        return replace(named, names=tuple(SPHERES[i] for i in near))

    monkeypatch.setattr("deeplight.capture.locate.name_spheres", in_their_order)
    frames = tuple(clip(CONES, moving=moving))
    if is_found:
        assert off_px(found(frames, None)) < 3
    else:
        with pytest.raises(NotLocated):
            found(frames, None)


def test_nothing_that_moves_and_no_spheres_is_reported_with_a_picture() -> None:
    with pytest.raises(NotLocated) as caught:
        found(clip({}, moving=False), None)
    assert caught.value.overlay is not None


@pytest.mark.parametrize(
    "text",
    [
        '{"status": "ok", "spheres": {"mirror": {"direction": [0, 0, -1]}}}',
        '{"version": 1, "rig": {}}',
        '{"tag": {"id": 0, "size_m": -1}, "spheres": {}}',
        '{"tag": {"family": "25h9", "id": 0, "size_m": 1}, "spheres": {}}',
    ],
)
def test_another_json_file_is_one_line(text: str, tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text(text)
    with pytest.raises(DataSetError, match="a rig file") as caught:
        read_rig_file(tmp_path / "other.json")
    assert "\n" not in str(caught.value)

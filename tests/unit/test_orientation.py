"""A labelled panorama, turned for each tool, is seen right through the tool's own formula."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from deeplight.errors import InputError
from deeplight.io.orientation import TOOLS, turned_for
from deeplight.mappings import latlong

Formula = Callable[[float, float, float], tuple[float, float]]

# (u, v) of a direction in the tool's own axes, from the left and from the top of the picture.
FORMULAS: dict[str, Formula] = {
    # Cycles kernel/camera/projection.h, direction_to_equirectangular (v up there).
    "blender": lambda x, y, z: (
        0.5 - math.atan2(y, x) / (2 * math.pi),
        0.5 - math.atan2(z, math.hypot(x, y)) / math.pi,
    ),
    # three.js shader chunk equirectUv (v up there).
    "three": lambda x, y, z: (
        math.atan2(z, x) / (2 * math.pi) + 0.5,
        0.5 - math.asin(y) / math.pi,
    ),
    # Mitsuba 3 envmap.cpp: u = atan2(x, -z) / 2 pi, wrapped; v = acos(y) / pi.
    "mitsuba": lambda x, y, z: (
        (math.atan2(x, -z) / (2 * math.pi)) % 1,
        math.acos(y) / math.pi,
    ),
    # Unity Skybox/Panoramic, ToRadialCoords (v up there: 1 - latitude / pi).
    "unity": lambda x, y, z: (
        0.5 - math.atan2(z, x) / (2 * math.pi),
        math.acos(y) / math.pi,
    ),
    # Unreal TextureCompressorModule: the cube's "world" swaps y and z, then LookupLongLat.
    "usd": lambda x, y, z: (
        0.5 - math.atan2(x, z) / (2 * math.pi),
        0.5 - math.asin(y) / math.pi,
    ),
    "unreal": lambda x, y, z: (
        (1 + math.atan2(x, -y) / math.pi) / 2,
        math.acos(z) / math.pi,
    ),
}

OURS = {
    "right": (1, 0, 0),
    "left": (-1, 0, 0),
    "up": (0, 1, 0),
    "down": (0, -1, 0),
    "view": (0, 0, -1),
    "back": (0, 0, 1),
    "ahead on the upper right": (0.6, 0.48, -0.64),
    "behind on the lower left": (-0.48, -0.64, 0.6),
}


def labelled(height: int = 64) -> np.ndarray:
    """Each texel's colour is its own direction in our camera frame."""
    return latlong.directions(height, 2 * height).copy()


def looked_up(tool: str, picture: np.ndarray, ours: tuple[float, float, float]) -> np.ndarray:
    """What the tool shows where its axes have our direction `ours`."""
    axes = TOOLS[tool]
    right, up, view = (np.array(axis, float) for axis in (axes.right, axes.up, axes.view))
    theirs = ours[0] * right + ours[1] * up - ours[2] * view
    u, v = FORMULAS[tool](*theirs)
    height, width, _ = picture.shape
    row = min(int(v * height), height - 1)
    return picture[row, int(u * width) % width]


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("name", OURS)
def test_each_tool_sees_every_direction_where_it_is(tool: str, name: str) -> None:
    seen = looked_up(tool, turned_for(labelled(), tool), OURS[name])
    assert seen @ np.array(OURS[name]) > math.cos(math.radians(5))


@pytest.mark.parametrize("tool", TOOLS)
def test_a_picture_turned_for_another_tool_is_noticed(tool: str) -> None:
    other = "unreal" if tool != "unreal" else "unity"
    seen = looked_up(tool, turned_for(labelled(), other), OURS["view"])
    assert seen @ np.array(OURS["view"]) < 0.5


@pytest.mark.parametrize("tool", TOOLS)
def test_the_tools_axes_are_at_right_angles_and_its_hand_is_the_known_one(tool: str) -> None:
    axes = TOOLS[tool]
    matrix = np.array([axes.right, axes.up, np.negative(axes.view)], float)
    left_handed = tool in ("unity", "unreal")
    assert np.linalg.det(matrix) == pytest.approx(-1 if left_handed else 1)


def test_turning_resamples_nothing() -> None:
    picture = labelled()
    for tool in TOOLS:
        turned = turned_for(picture, tool)
        np.testing.assert_array_equal(np.sort(turned, axis=1), np.sort(picture, axis=1))


def test_an_unknown_tool_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"blender.*unreal"):
        turned_for(labelled(), "maya")


def test_mitsubas_own_camera_sees_the_photos_view() -> None:
    """Not the formula but the renderer: identity camera and environment, colour = direction."""
    mitsuba = pytest.importorskip("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    film = {"type": "hdrfilm", "width": 9, "height": 9, "rfilter": {"type": "box"}}
    scene = mitsuba.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path"},
            "sensor": {"type": "perspective", "fov": 60, "film": film},
            "light": {
                "type": "envmap",
                "bitmap": mitsuba.Bitmap(turned_for(labelled(256) + 2, "mitsuba")),
            },
        }
    )
    seen = np.array(mitsuba.render(scene, spp=16)) - 2
    half = math.tan(math.radians(30)) * 8 / 9
    for (row, column), (x, y) in {(4, 4): (0, 0), (4, 8): (half, 0), (0, 4): (0, half)}.items():
        ray = np.array([x, y, -1.0]) / math.hypot(x, y, 1)
        np.testing.assert_allclose(seen[row, column], ray, atol=0.03)

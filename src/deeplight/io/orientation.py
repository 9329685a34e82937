"""Equirectangular environments as each tool expects them.

A tool's default environment puts some fixed direction of its own axes into the picture's centre
column. Turning the environment so that the photo's view lies where the tool's own camera looks
is then a shift of columns by whole quarter turns: exact, nothing is resampled. In all of these
tools the picture is seen from inside, right of centre being on the right, left-handed or not.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from deeplight.errors import InputError
from deeplight.io.lighting_file import Turn


@dataclass(frozen=True)
class Tool:
    """How one tool looks at an equirectangular environment.

    Attributes:
        name: what `--for` calls it.
        right, up, view: where our camera's +X, +Y and -Z lie on the tool's axes.
        centre: the tool's direction in the environment's centre column.
        source: where its mapping is written down.
    """

    name: str
    right: tuple[int, int, int]
    up: tuple[int, int, int]
    view: tuple[int, int, int]
    centre: tuple[int, int, int]
    source: str

    @property
    def view_u(self) -> float:
        """Column of our view direction in a picture for this tool, 0 (left) to 1 (right)."""
        centre, view, right = (np.array(axis) for axis in (self.centre, self.view, self.right))
        angle_right_of_view = np.arctan2(centre @ right, centre @ view)
        return float((0.5 - angle_right_of_view / (2 * np.pi)) % 1.0)

    @property
    def axes(self) -> str:
        """Our axes in the tool's, in words."""
        ours = (("+X", self.right), ("+Y", self.up), ("-Z", self.view))
        return ", ".join(f"our {name} is its {_axis(axis)}" for name, axis in ours)

    @property
    def turn(self) -> Turn:
        """How an environment for this tool is turned, as lighting files record it."""
        return Turn(self.name, self.view_u, self.axes)


def _axis(axis: tuple[int, int, int]) -> str:
    (index,) = np.flatnonzero(axis)
    return f"{'+' if axis[index] > 0 else '-'}{'XYZ'[index]}"


TOOLS = {
    tool.name: tool
    for tool in (
        Tool(
            "blender",
            right=(1, 0, 0),
            up=(0, 0, 1),
            view=(0, 1, 0),
            centre=(1, 0, 0),
            source="Cycles, direction_to_equirectangular: u = -atan2(y, x) / 2 pi + 1/2",
        ),
        Tool(
            "three",
            right=(1, 0, 0),
            up=(0, 1, 0),
            view=(0, 0, -1),
            centre=(1, 0, 0),
            source="three.js, equirectUv: u = atan2(z, x) / 2 pi + 1/2",
        ),
        Tool(
            "mitsuba",
            right=(-1, 0, 0),
            up=(0, 1, 0),
            view=(0, 0, 1),
            centre=(0, 0, 1),
            source="Mitsuba 3.9 envmap, measured; its cameras look along +Z with +X to the left",
        ),
        Tool(
            "unity",
            right=(1, 0, 0),
            up=(0, 1, 0),
            view=(0, 0, 1),
            centre=(1, 0, 0),
            source="Skybox/Panoramic shader, ToRadialCoords: u = 1/2 - atan2(z, x) / 2 pi",
        ),
        Tool(
            "unreal",
            right=(0, 1, 0),
            up=(0, 0, 1),
            view=(1, 0, 0),
            centre=(0, -1, 0),
            source="TextureCompressorModule, LookupLongLat: u = (1 + atan2(x, -y) / pi) / 2",
        ),
        Tool(
            "usd",
            right=(1, 0, 0),
            up=(0, 1, 0),
            view=(0, 0, -1),
            centre=(0, 0, 1),
            source="UsdLux DomeLight: OpenEXR's latlong, longitude atan2(x, z) from pi down to -pi",
        ),
    )
}
"""The tools that take an equirectangular environment, by name."""


def turned_for(
    latlong: Float32[np.ndarray, "height width 3"], tool: str
) -> Float32[np.ndarray, "height width 3"]:
    """Turn our environment (centre = the view) into the one that `tool` expects.

    Raises:
        InputError: no such tool, or the width is no multiple of 4.
    """
    return _turn_for(tool).of(latlong)


def turned_from(
    latlong: Float32[np.ndarray, "height width 3"], tool: str
) -> Float32[np.ndarray, "height width 3"]:
    """Turn an environment made for `tool` back into ours; undoes `turned_for`.

    Raises:
        InputError: no such tool, or the width is no multiple of 4.
    """
    return Turn(view_u=(1 - _turn_for(tool).view_u) % 1).of(latlong)


def _turn_for(tool: str) -> Turn:
    if tool not in TOOLS:
        raise InputError(f"one of {', '.join(sorted(TOOLS))}", repr(tool), "name one of them")
    return TOOLS[tool].turn


CUBE_TOOLS = {
    "three": "three.js CubeTextureLoader: px shows our -X, nx our +X; all seen from inside",
    "webxr": "OpenGL cube map in the camera's axes, as WebXR's getReflectionCubeMap gives it",
}
"""The tools that take six faces, and how they want them."""

GLTF_SIGN = np.array([1, -1, 1, 1, -1, -1, 1, 1, 1], np.float32)
"""How EXT_lights_image_based is read, since its text leaves it open: Babylon.js 9, measured.

Its harmonics are our all-positive ones with 1, 4 and 5 negated.
"""


def gltf_faces(
    faces: Float32[np.ndarray, "6 size size 3"],
) -> Float32[np.ndarray, "6 size size 3"]:
    """Turn our six faces into those of EXT_lights_image_based: three.js's, upside down each."""
    return faces_for(faces, "three")[:, ::-1]


def faces_for(
    faces: Float32[np.ndarray, "6 size size 3"], tool: str | None
) -> Float32[np.ndarray, "6 size size 3"]:
    """Turn our six faces (`cube.FACES`, seen from inside) into those that `tool` loads, or back.

    OpenGL's faces are seen from outside, so each is ours mirrored: left-right at the sides,
    up-down at the top and bottom. three.js looks its cubes up with x negated, which makes them
    inside views again, with +X and -X changed and the top and bottom turned half way round. Doing
    either twice gives the same faces again.

    Raises:
        InputError: the tool loads no six faces, or its way is not known.
    """
    if tool is None:
        return faces
    if tool == "webxr":
        return np.concatenate([faces[:2, :, ::-1], faces[2:4, ::-1], faces[4:, :, ::-1]])
    if tool == "three":
        return np.stack([faces[1], faces[0], *np.rot90(faces[2:4], 2, axes=(1, 2)), *faces[4:]])
    got = f"'{tool}', which loads a latlong"
    raise InputError(f"a cube for {' or '.join(CUBE_TOOLS)}", got, "leave out the cube or the tool")

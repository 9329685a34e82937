"""Light probes: one panorama in the mappings that files and tools use.

A picture of all directions is a latlong, a mirror ball, an angular map or a cube: six faces apart,
in a strip, or unfolded into a cross. In every cross the view (-Z) is the face in the middle, +X on
its right, +Y above it. Between mappings light is averaged or interpolated, never only looked up.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np
from jaxtyping import Float

from deeplight.errors import ShapeError
from deeplight.mappings import angular_map, cube, latlong, mirror_ball, resample

Mapping = Literal[
    "latlong", "mirror-ball", "angular", "cube", "cross", "horizontal-cross", "strip", "column"
]
LARGEST_BALL = 1024
"""A larger mirror ball is averaged down before it is unwrapped."""

# Where each face lies in a picture of several, in faces from the top left; its half turns.
_PLACES: dict[str, dict[int, tuple[int, int, int]]] = {
    "cross": {
        2: (0, 1, 0), 1: (1, 0, 0), 5: (1, 1, 0), 0: (1, 2, 0), 3: (2, 1, 0), 4: (3, 1, 1),
    },
    "horizontal-cross": {
        2: (0, 1, 0), 1: (1, 0, 0), 5: (1, 1, 0), 0: (1, 2, 0), 4: (1, 3, 0), 3: (2, 1, 0),
    },
    "strip": {face: (0, face, 0) for face in range(6)},
    "column": {face: (face, 0, 0) for face in range(6)},
}  # fmt: skip
_GRIDS = {"cross": (4, 3), "horizontal-cross": (3, 4), "strip": (1, 6), "column": (6, 1)}
_VALUES_AT_A_TIME = 2**22

Picture = Float[np.ndarray, "height width 3"]
NewPicture = Float[np.ndarray, "new_height new_width 3"]
Faces = Float[np.ndarray, "6 face face 3"]


def mapping_of(height: int, width: int) -> str:
    """The mapping that a picture's shape implies.

    Raises:
        ShapeError: a square, which may be either disc, or a shape of no mapping.
    """
    if height > 0 and width == 2 * height:
        return "latlong"
    for name, (rows, columns) in _GRIDS.items():
        if height * columns == width * rows and height % rows == 0:
            return name
    got = f"{width} x {height}"
    if height == width:
        raise ShapeError("the mapping of a square picture", got, "say mirror-ball or angular")
    raise ShapeError(
        "twice as wide as high, a square, a 3:4 or 4:3 cross or a row of six squares",
        got,
        "crop it to the full sphere",
    )


def folded(picture: Picture, mapping: str) -> Faces:
    """The six faces of `cube.FACES` out of a cross or a strip.

    Raises:
        ShapeError: the picture's sides are not those of the mapping.
    """
    rows, columns = _GRIDS[mapping]
    size = picture.shape[0] // rows
    if size == 0 or picture.shape[:2] != (rows * size, columns * size):
        got = f"{picture.shape[1]} x {picture.shape[0]}"
        raise ShapeError(f"a {mapping} of {columns} by {rows} squares", got, "crop it to them")
    faces = np.empty((6, size, size, 3), picture.dtype)
    for face, (row, column, half_turns) in _PLACES[mapping].items():
        square = picture[row * size : (row + 1) * size, column * size : (column + 1) * size]
        faces[face] = np.rot90(square, 2 * half_turns)
    return faces


def unfolded(faces: Faces, mapping: str) -> NewPicture:
    """A cross or a strip of six faces; what no face covers is black."""
    rows, columns = _GRIDS[mapping]
    size = faces.shape[1]
    picture = np.zeros((rows * size, columns * size, 3), faces.dtype)
    for face, (row, column, half_turns) in _PLACES[mapping].items():
        square = np.rot90(faces[face], 2 * half_turns)
        picture[row * size : (row + 1) * size, column * size : (column + 1) * size] = square
    return picture


def latlong_from_probe(picture: Picture, mapping: str) -> NewPicture:
    """The panorama that a picture of any mapping shows, about as fine as the picture.

    Raises:
        ShapeError: the picture's sides are not those of the mapping.
    """
    if mapping in _GRIDS:
        return latlong_from_cube(folded(picture, mapping))
    height, width, _ = picture.shape
    wanted = (height, (2 if mapping == "latlong" else 1) * height)
    if (height, width) != wanted:
        shape = "twice as wide as high" if mapping == "latlong" else "square"
        raise ShapeError(f"a {mapping} picture, {shape}", f"{width} x {height}", "crop it")
    if mapping == "mirror-ball":
        size = min(height, LARGEST_BALL)
        small = resample.shrink(picture, size, size)
        return resample.latlong_from_ball(small, max(size, 64))
    if mapping == "angular":
        whole = _spread_off_disc(picture)
        return _seen_from_inside(
            height, lambda d: _bilinear(whole, *angular_map.position(d, height))
        )
    return picture


def latlong_from_cube(faces: Faces) -> NewPicture:
    """The panorama that six faces show, as fine as they are at their centres."""
    size = faces.shape[1]

    def look_up(directions: np.ndarray) -> np.ndarray:
        face, row, column = cube.position(directions, size)
        return _bilinear(faces, row, column, face)

    return _seen_from_inside(2 * size, look_up)


def probe_from_latlong(radiance: Picture, mapping: str, size: int) -> NewPicture:
    """A panorama as a picture of another mapping; all but `cube`, which is six pictures.

    Args:
        radiance: the panorama.
        mapping: any `Mapping` but that.
        size: rows of a latlong, side of a disc, side of a face of a cube.
    """
    if mapping == "latlong":
        return resized(radiance, size)
    if mapping == "mirror-ball":
        return resample.ball_from_latlong(radiance, size)
    if mapping == "angular":
        return angular_from_latlong(radiance, size)
    return unfolded(cube_from_latlong(radiance, size), mapping)


def cube_from_latlong(radiance: Picture, size: int) -> Faces:
    """The six faces of `cube.FACES`; each pixel the mean over what it sees."""
    samples = _samples(size)  # along a pixel, each about a texel wide at the face's centre
    radiance = _no_finer_than(radiance, samples * size)
    fine = cube.directions(samples * size)
    faces = [resample.shrink(_look_up(radiance, d), size, size) for d in fine]
    return np.stack(faces)


def angular_from_latlong(radiance: Picture, size: int) -> NewPicture:
    """The angular map of a panorama; black off the disc, where it says nothing."""
    samples = _samples(size // 2)
    radiance = _no_finer_than(radiance, samples * size // 2)
    picture = resample.shrink(_look_up(radiance, angular_map.directions(size, samples)), size, size)
    picture[~angular_map.on_disc(size)] = 0
    return picture


def resized(radiance: Picture, height: int) -> NewPicture:
    """A panorama of `height` rows: averaged if that is fewer, else interpolated."""
    if height <= len(radiance):
        return _no_finer_than(radiance, height)
    return resample.sample_latlong(radiance, latlong.directions(height, 2 * height))


def _no_finer_than(radiance: Picture, height: int) -> NewPicture:
    if len(radiance) > height:
        return resample.shrink_latlong(radiance, height).astype(np.float32)
    return radiance


def _seen_from_inside(height: int, look_up: Callable[[np.ndarray], np.ndarray]) -> NewPicture:
    """A panorama of `height` rows, twice supersampled, of what `look_up` shows in directions."""
    fine = latlong.directions(2 * height, 4 * height)
    strips = np.array_split(fine, max(1, fine.size // _VALUES_AT_A_TIME))
    radiance = np.concatenate([look_up(strip) for strip in strips])
    return resample.shrink_latlong(radiance, height).astype(np.float32)


def _look_up(radiance: Picture, directions: np.ndarray) -> np.ndarray:
    strips = np.array_split(directions, max(1, directions.size // _VALUES_AT_A_TIME))
    return np.concatenate([resample.sample_latlong(radiance, strip) for strip in strips])


def _spread_off_disc(picture: Picture) -> NewPicture:
    """The picture with pixels off the disc set to what lies inward of them at the rim."""
    size = len(picture)
    u, v = mirror_ball.grid(size)
    inward = np.minimum(1, (1 - 1.5 / size) / np.maximum(np.hypot(u, v), 1e-9))
    inward[angular_map.on_disc(size)] = 1
    column, row = (((a * inward + 1) * (size / 2)).astype(int) for a in (u, -v))
    return picture[row, column]


def _samples(size: int) -> int:
    return 4 if size <= 256 else 2  # what memory allows


def _bilinear(
    pictures: np.ndarray, row: np.ndarray, column: np.ndarray, which: np.ndarray | None = None
) -> np.ndarray:
    """Interpolate square pictures, held at their edges; `which` of several for each place."""
    size = pictures.shape[-2]
    row, column = np.clip(row, 0, size - 1), np.clip(column, 0, size - 1)
    top, left = row.astype(np.int32), column.astype(np.int32)
    down, right = (row - top)[..., None], (column - left)[..., None]
    result = 0
    for dr, wr in ((0, 1 - down), (1, down)):
        for dc, wc in ((0, 1 - right), (1, right)):
            place = (np.minimum(top + dr, size - 1), np.minimum(left + dc, size - 1))
            corner = pictures[place if which is None else (which, *place)]
            result = result + corner * (wr * wc)
    return np.asarray(result, np.float32)

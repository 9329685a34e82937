"""Photo to network input: the one definition used by data set, training, runtime and web demo.

The network was trained on one camera: a portrait 9:16 frame with a vertical field of view of 66
degrees, of which it sees the upper 80 % (`ModelContract` holds these numbers). A photo of any size,
aspect and field of view is brought to that view: on the image plane at distance 1 it is the
rectangle from +tan 33 down to -0.6 tan 33 and 9/16 tan 33 to either side, around the photo's
centre. Each of the 135 x 192 cells is the exact area average of the photo's pixels under it, in
the photo's own gamma-encoded values. Where the photo does not reach, its edge pixels go on.

A 4:3 photo lying on its side reaches 27 degrees up and down: that view would overhang it above and
leave its lowest rows out. `slid_into_photo` slides the view down along the image plane until it
does neither. Where that leaves out a fifth of a view's height or width, `looks` slides it there as
well, and `estimators.look` makes one light of what the network says of both.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float32, Shaped, UInt8

from deeplight.area_means import mean_over_cells
from deeplight.camera import (
    BACKGROUND_HEIGHT,
    BACKGROUND_WIDTH,
    TRAINED_VERTICAL_FOV_RAD,
    PinholeCamera,
)
from deeplight.contract import ModelContract
from deeplight.errors import ShapeError
from deeplight.frames import Rotation, world_from_camera

FovSource = Literal["given", "exif", "assumed"]

ASSUMED_LONG_SIDE_FOV_RAD = TRAINED_VERTICAL_FOV_RAD
"""Field of view of the photo's long side when nothing states it: a phone's main camera."""
FITS = 1.07
"""Of the photo's height: up to this a view has room in it. Higher ones gain nothing by sliding, on
validation places (`lab/evidence/photo_formats.py`)."""
LEAST_SLIDE = 1e-6
"""Of the photo's height: less is rounding."""
ROOM = 0.2
"""Of the view's height or width: a photo that shows so much more is looked at twice."""
FARTHEST = math.tan(math.radians(18))
"""To which a second look is slid, at distance 1: further off the axis squares become wedges."""


@dataclass(frozen=True)
class Framing:
    """Where the trained camera's view lies in one photo.

    The edges are in pixels of the upright photo, from its upper left corner; pixel (row, column)
    covers [row, row + 1] x [column, column + 1]. They may lie outside the photo.
    """

    photo_height: int
    photo_width: int
    top: float
    bottom: float
    left: float
    right: float
    vertical_fov_rad: float  # of the whole photo, as used
    fov_source: FovSource
    input_height: int = BACKGROUND_HEIGHT
    input_width: int = BACKGROUND_WIDTH
    down: float = 0.0  # pixels by which the view was slid below the photo's centre
    aside: float = 0.0  # and to the right of it

    @property
    def focal(self) -> float:
        """Distance in pixels at which the photo's plane stands before the camera."""
        return self.photo_height / 2 / math.tan(self.vertical_fov_rad / 2)

    @property
    def pitch_rad(self) -> float:
        """How far up the view looks from the photo's optical axis; negative where it was slid."""
        return -math.atan(self.down / math.hypot(self.focal, self.aside))

    @property
    def is_centred(self) -> bool:
        """Whether the view looks along the photo's optical axis."""
        return self.down == self.aside == 0

    @property
    def photo_from_view(self) -> Rotation:
        """Rotation of directions from the frame of what the view shows to the photo's."""
        return world_from_camera(-math.atan(self.aside / self.focal), self.pitch_rad)

    def slid(self, down: float = 0.0, aside: float = 0.0) -> "Framing":
        """Move the view by this number of pixels."""
        return replace(
            self,
            top=self.top + down,
            bottom=self.bottom + down,
            left=self.left + aside,
            right=self.right + aside,
            down=self.down + down,
            aside=self.aside + aside,
        )

    @property
    def camera(self) -> PinholeCamera:
        """Of the whole photo."""
        return PinholeCamera(self.photo_width, self.photo_height, self.vertical_fov_rad)

    @property
    def visible_fraction(self) -> float:
        """Part of the trained view that the photo shows, by image area; 1.0 is all of it."""
        rows = min(self.bottom, self.photo_height) - max(self.top, 0.0)
        columns = min(self.right, self.photo_width) - max(self.left, 0.0)
        whole = (self.bottom - self.top) * (self.right - self.left)
        return min(rows * columns / whole, 1.0)

    @property
    def used_fraction(self) -> float:
        """Part of the photo that the network sees, by area; the rest was cropped away."""
        whole = (self.bottom - self.top) * (self.right - self.left)
        return min(self.visible_fraction * whole / (self.photo_height * self.photo_width), 1.0)


def frame_photo(
    height: int,
    width: int,
    vertical_fov_rad: float | None = None,
    fov_source: FovSource = "given",
    contract: ModelContract | None = None,
) -> Framing:
    """Find the trained camera's view in an upright photo of `height` x `width` square pixels.

    The optical axis is taken to pass through the photo's centre. Without a field of view the long
    side is assumed to span 66 degrees, whatever `fov_source` says.

    Raises:
        ShapeError: the field of view is not inside (0, pi).
    """
    contract = contract or ModelContract()
    if fov_source not in get_args(FovSource):
        raise ShapeError(f"a source out of {get_args(FovSource)}", repr(fov_source), "name one")
    if vertical_fov_rad is None:
        focal = max(height, width) / 2 / math.tan(ASSUMED_LONG_SIDE_FOV_RAD / 2)  # in pixels
        vertical_fov_rad, fov_source = 2 * math.atan(height / 2 / focal), "assumed"
    elif 0 < vertical_fov_rad < math.pi:
        focal = height / 2 / math.tan(vertical_fov_rad / 2)
    else:
        got = f"{math.degrees(vertical_fov_rad):g}"
        raise ShapeError("a field of view between 0 and 180 degrees", got, "correct it")
    return Framing(
        photo_height=height,
        photo_width=width,
        top=height / 2 - focal * contract.top,
        bottom=height / 2 - focal * contract.bottom,
        left=width / 2 - focal * contract.right,
        right=width / 2 + focal * contract.right,
        vertical_fov_rad=vertical_fov_rad,
        fov_source=fov_source,
        input_height=contract.height,
        input_width=contract.width,
    )


def slid_into_photo(framing: Framing) -> Framing:
    """Slide the view down into a photo that is tall enough for it; other photos keep theirs."""
    height = framing.photo_height
    down = min(-framing.top, height - framing.bottom)
    if down < LEAST_SLIDE * height or framing.bottom - framing.top > FITS * height:
        return framing
    return framing.slid(down)


def looks(framing: Framing) -> tuple[Framing, ...]:
    """The views of a photo that the network is shown, out of the one around its centre: of a photo
    that goes on below, that one and one further down; of a wide one, one at either side.

    What two looks bring, and more of them: docs/journal.md.
    """
    height, width = framing.bottom - framing.top, framing.right - framing.left
    below, aside = framing.photo_height - framing.bottom, framing.left
    farthest = FARTHEST * framing.focal
    if below >= ROOM * height:
        return framing, framing.slid(min(below, farthest))
    if aside >= ROOM * width:
        aside = min(aside, farthest)
        return framing.slid(0, -aside), framing.slid(0, aside)
    return (framing,)


def hull(views: Sequence[Framing]) -> Framing:
    """What the views of `looks` show together, as one."""
    return replace(views[0], bottom=views[-1].bottom, right=views[-1].right)


def network_input(
    photo: Shaped[np.ndarray, "height width 3"], framing: Framing
) -> Float32[np.ndarray, "3 input_height input_width"]:
    """Average the photo over the cells of `framing` and bring it to [-0.5, 0.5].

    Args:
        photo: upright, RGB, gamma-encoded: uint8, uint16 or float in [0, 1].

    Raises:
        ShapeError: the photo's size is not that of `framing`, or its type or range is another.
    """
    cells: np.ndarray = _cell_means(photo, framing) - np.float32(0.5)
    return np.ascontiguousarray(cells.transpose(2, 0, 1))


def background(
    photo: Shaped[np.ndarray, "height width 3"], framing: Framing
) -> UInt8[np.ndarray, "input_height input_width 3"]:
    """Give the same cells as `network_input`, rounded to 8 bits: what the data set stores."""
    levels: np.ndarray = np.floor(_cell_means(photo, framing) * np.float32(255) + np.float32(0.5))
    return levels.astype(np.uint8)


def landscape_background(
    stored: UInt8[np.ndarray, "height width 3"],
) -> UInt8[np.ndarray, "input_height input_width 3"]:
    """Give the landscape network's view of a stored portrait background: its middle, enlarged.

    Section 4.3. A photo of full size brought to the landscape contract has more detail: here 135
    pixels are spread over 192.
    """
    height, width, _ = stored.shape
    portrait, landscape = ModelContract(), ModelContract.landscape()
    rows = height / (portrait.background_fraction - portrait.background_top)  # of the full frame
    framing = Framing(
        photo_height=height,
        photo_width=width,
        top=rows * (landscape.background_top - portrait.background_top),
        bottom=rows * (landscape.background_fraction - portrait.background_top),
        left=0.0,
        right=float(width),
        vertical_fov_rad=math.atan(portrait.top) - math.atan(portrait.bottom),
        fov_source="given",
        input_height=landscape.height,
        input_width=landscape.width,
    )
    return background(stored, framing)


def normalise(
    backgrounds: UInt8[np.ndarray, "*batch height width 3"],
) -> Float32[np.ndarray, "*batch 3 height width"]:
    """Bring stored backgrounds, one or a batch, to the network's layout and [-0.5, 0.5]."""
    scaled = backgrounds.astype(np.float32) / np.float32(255) - np.float32(0.5)
    return np.ascontiguousarray(np.moveaxis(scaled, -1, -3))


def _cell_means(
    photo: Shaped[np.ndarray, "height width 3"], framing: Framing
) -> Float32[np.ndarray, "input_height input_width 3"]:
    """Average the photo over the cells of `framing`; values in [0, 1]."""
    expected = (framing.photo_height, framing.photo_width, 3)
    if photo.shape != expected:
        raise ShapeError(f"a photo of shape {expected}", f"{photo.shape}", "frame this photo first")
    row_edges = np.linspace(framing.top, framing.bottom, framing.input_height + 1)
    column_edges = np.linspace(framing.left, framing.right, framing.input_width + 1)
    return mean_over_cells(photo, row_edges, column_edges)

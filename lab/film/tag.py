"""An AprilTag on the rig's bar: family 36h11 (Olson 2011; Wang and Olson 2016), a few ids.

The codes are those of the published family (github.com/AprilRobotics/apriltag, tag36h11.c);
a test has OpenCV's detector read them.
"""

import numpy as np
from jaxtyping import Float

CODES_36H11 = (0xD5D628584, 0xD97F18B49, 0xDD280910E, 0xE479E9C98)
_WHITE, _BLACK = 0.80, 0.04
CELLS = 10  # 6 of the code, a black and a white border around it
BLACK_CELLS = 8  # without the white border: the side that a rig file calls the tag's size


def tag_cells(tag_id: int) -> Float[np.ndarray, "10 10"]:
    """Reflectivity of the tag's cells, its white border included, as seen upright."""
    code = CODES_36H11[tag_id]
    bits = np.array([code >> n & 1 for n in range(36)]).reshape(6, 6)
    cells = np.pad(np.pad(bits, 1), 1, constant_values=1)
    return np.where(cells > 0, _WHITE, _BLACK)


def tag_reflectivity(
    tag_id: int, right: Float[np.ndarray, "*n"], up: Float[np.ndarray, "*n"]
) -> Float[np.ndarray, "*n"]:
    """Reflectivity at places on the plate, each -1 to 1."""
    column = np.clip((right + 1) / 2 * CELLS, 0, CELLS - 1).astype(int)
    row = np.clip((1 - up) / 2 * CELLS, 0, CELLS - 1).astype(int)
    reflectivity: np.ndarray = tag_cells(tag_id)[row, column]
    return reflectivity

"""The spheres from an AprilTag on the rig's bar (section 3.1: "marker-based tracking")."""

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera import PinholeCamera
from deeplight.capture.conic import Cone, pixel_scale
from deeplight.capture.located import TagRig
from deeplight.frames import normalised

_CAMERA_FROM_OPENCV = np.diag([1.0, -1.0, -1.0])  # OpenCV: +Y down, +Z forward


def tag_corners(
    frames: list[UInt8[np.ndarray, "height width"]], tag_id: int
) -> Float[np.ndarray, "4 2"] | None:
    """Corners (x, y) of the tag, median over the frames that show it; None if none does.

    In order: the tag's top left, top right, bottom right, bottom left.
    """
    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    detector = cv2.aruco.ArucoDetector(family, settings)
    seen = []
    for frame in frames:
        corners, ids, _ = detector.detectMarkers(frame)
        found = [] if ids is None else np.ravel(ids).tolist()
        if tag_id in found:
            seen.append(corners[found.index(tag_id)].reshape(4, 2))
    return np.median(seen, axis=0).astype(float) if seen else None


def cones_next_to_tag(
    corners: Float[np.ndarray, "4 2"],
    rig: TagRig,
    camera: PinholeCamera,
    found: dict[str, Cone] | None = None,
) -> dict[str, Cone] | None:
    """Where the rig's spheres are seen, from its tag's corners; None if no pose fits.

    A small tag alone gives its tilt badly. Spheres already `found` by their outlines give it
    well, as they are far apart; their sizes are not looked at.
    """
    half = rig.tag_size_m / 2
    square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
    matrix = _opencv_matrix(camera)
    ok, turn, place = cv2.solvePnP(
        square, corners.astype(float), matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    if ok and found:
        axes = np.array([cone.direction for cone in found.values()])
        row, column = camera.pixel_of_directions(axes)
        points = np.concatenate([square, [rig.centres_m[name] for name in found]])
        pixels = np.concatenate([corners, np.stack([column, row], axis=-1)])
        ok, turn, place = cv2.solvePnP(
            points, pixels.astype(float), matrix, None, turn, place, useExtrinsicGuess=True
        )
    if not ok:
        return None
    return _cones(rig, _CAMERA_FROM_OPENCV @ cv2.Rodrigues(turn)[0], place.ravel())


def _opencv_matrix(camera: PinholeCamera) -> Float[np.ndarray, "3 3"]:
    f = pixel_scale(camera)
    return np.array([[f, 0, (camera.width - 1) / 2], [0, f, (camera.height - 1) / 2], [0, 0, 1]])


def _cones(
    rig: TagRig, camera_from_tag: Float[np.ndarray, "3 3"], place: Float[np.ndarray, "3"]
) -> dict[str, Cone] | None:
    """The spheres' cones; `place` is the tag's middle in OpenCV's frame. None: behind or inside."""
    cones = {}
    for name, centre in rig.centres_m.items():
        at = camera_from_tag @ centre + _CAMERA_FROM_OPENCV @ place
        sine = rig.diameters_m[name] / 2 / np.linalg.norm(at)
        if at[2] >= 0 or sine >= 0.8:
            return None
        cones[name] = Cone(normalised(at), float(np.arcsin(sine)))
    return cones

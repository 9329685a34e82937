"""What is true of a film: CLIP.truth.json and CLIP.truth.npz next to CLIP.mp4.

A clip with a tag on the bar also gets CLIP.rig.json, what its builder would have measured.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8

from deeplight.camera import PinholeCamera
from deeplight.frames import Rotation, looking_at
from deeplight.io.atomic import replacing
from deeplight.simulate.panorama import Place
from deeplight.sphere import CROP_SIZE, SPHERES, SphereView
from lab.film.clip import Clip, FilmFrame
from lab.film.parts import Box
from lab.film.rig import FilmRig, ellipse_px
from lab.film.tag import BLACK_CELLS, CELLS

VERSION = 1


def truth_paths(clip: Path) -> tuple[Path, Path]:
    """The .json and the .npz next to a clip."""
    return clip.with_suffix(".truth.json"), clip.with_suffix(".truth.npz")


class TruthWriter:
    """What is true of each frame, collected; small numbers and crops only."""

    def __init__(self, clip: Clip, place: Place) -> None:
        self._clip, self._place = clip, place
        self._frames: list[dict[str, Any]] = []
        self._crops: list[UInt8[np.ndarray, "3 size size 3"]] = []
        self._lighting: dict[int, np.ndarray] = {}

    def add(self, frame: FilmFrame) -> None:
        """Note the next frame, also one that was dropped."""
        if frame.true_lighting is not None:
            self._lighting[len(self._frames)] = frame.true_lighting
        self._crops.append(frame.crops)
        self._frames.append(
            {
                "time_s": round(frame.time_s, 6),
                "log_gain": [round(g, 6) for g in frame.log_gain],
                "world_from_camera": frame.world_from_camera.round(8).tolist(),
                "position_m": frame.position_m.round(6).tolist(),
                "motion_blur_px": round(frame.motion_blur_px, 4),
                "dropped": frame.dropped,
                "covered": {name: round(share, 4) for name, share in frame.covered.items()},
            }
        )

    def write(self, video: Path) -> None:
        """Write the files, .truth.json last: a clip with one is finished.

        Raises:
            OSError: they cannot be written.
        """
        described, arrays = truth_paths(video)
        if self._clip.rig.tag_id is not None:
            with replacing(video.with_suffix(".rig.json")) as temporary:
                temporary.write_text(json.dumps(measured_rig(self._clip.rig), indent=1) + "\n")
        with replacing(arrays) as temporary:
            np.savez_compressed(
                temporary,
                crops=np.stack(self._crops),
                true_lighting=np.stack(list(self._lighting.values())).astype(np.float32),
                true_lighting_frames=np.array(list(self._lighting), np.int64),
            )
        with replacing(described) as temporary:
            temporary.write_text(json.dumps(self._described(), indent=1) + "\n")

    def _described(self) -> dict[str, Any]:
        clip, place = self._clip, self._place
        camera = clip.camera
        return {
            "version": VERSION,
            "camera": {
                "width": camera.width,
                "height": camera.height,
                "vertical_fov_deg": float(np.degrees(camera.vertical_fov_rad)),
            },
            "place": place.name,
            "scene": place.scene,
            "split": place.split,
            "licence": place.licence,
            "source": place.path.name,
            "trouble": list(clip.troubles),
            "rig": {
                "name": clip.rig.name,
                "tag_id": clip.rig.tag_id,
                "spheres": true_spheres(clip.rig, camera, clip.upright_from_phone),
            },
            "frames": self._frames,
        }


def measured_rig(rig: FilmRig) -> dict[str, Any]:
    """The rig file of a rig with a tag: its sphere centres in the tag's frame (docs/locate.md)."""
    assert rig.plate is not None
    assert isinstance(rig.plate.shape, Box)
    box = rig.plate.shape
    face = box.centre_m + box.half_size_m[2] * box.box_from_camera[2]
    spheres = {
        name: {
            "centre_m": (box.box_from_camera @ (rig.centres_m[name] - face)).round(6).tolist(),
            "diameter_m": 2 * rig.radius_m,
        }
        for name in SPHERES
    }
    size = 2 * box.half_size_m[0] * BLACK_CELLS / CELLS
    tag = {"family": "36h11", "id": rig.tag_id, "size_m": round(float(size), 6)}
    return {"tag": tag, "spheres": spheres}


def true_spheres(
    rig: FilmRig, camera: PinholeCamera, upright_from_phone: Rotation
) -> dict[str, dict[str, Any]]:
    """Where each sphere is, in the frame of the upright picture's camera."""
    result = {}
    for name in SPHERES:
        centre = upright_from_phone @ rig.centres_m[name]
        distance = float(np.linalg.norm(centre))
        angle = float(np.arcsin(rig.radius_m / distance))
        view = SphereView(looking_at(centre), angle, CROP_SIZE)
        (row,), (column,) = camera.pixel_of_directions(centre[None])
        (x, y), axes, turn = ellipse_px(view, camera)
        result[name] = {
            "direction": (centre / distance).tolist(),
            "angular_radius_rad": angle,
            "centre_px": [float(column), float(row)],
            "ellipse_px": {"centre": [x, y], "axes": list(axes), "angle_deg": turn},
            "diameter_m": 2 * rig.radius_m,
            "distance_m": distance,
        }
    return result

"""Frames in, one light out: rotations found or given, then gathered in a `Session`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees, radians

import numpy as np
from jaxtyping import Float

from deeplight.environment import Environment
from deeplight.errors import ConfigError, ImageFileError, ShapeError
from deeplight.estimators.network import NetworkEstimator
from deeplight.frames import UP, Rotation, normalised, rotation
from deeplight.fuse.frame import (
    SourceFrame,
    field_of_view,
    frame_of,
    scaled,
    unknown_fov,
    with_fields_of_view,
)
from deeplight.fuse.poses import nearest_rotation
from deeplight.fuse.session import Session
from deeplight.fuse.track import Tracked, track
from deeplight.fuse.view import HEIGHT
from deeplight.io.kept_folder import KeptFolder
from deeplight.io.photo_like import PhotoLike, as_photo

_LEVEL_SPREAD = 0.02  # least spread of where cameras' right sides point, to find up from it
_MISSES_RAD = radians(0.6)  # after a step of 30 cm in a room at most 0.37
FRONT_FROM_BACK = rotation("y", np.pi)
"""The front camera looks the other way; what was to the right is to the left."""


@dataclass(frozen=True)
class FuseSettings:
    """How to fuse.

    Attributes:
        fov_deg: vertical field of view of the first frame, upright; the others are then the same
            camera's. None to take each frame's from EXIF data, and else to assume 66 degrees along
            the long side and refine that.
        frame: the frame (its place among those given) whose camera and white the light is in; None
            for the first one that can be placed.
        level: turn the result so that +Y is against gravity.
        height: rows of the panorama.
    """

    fov_deg: float | None = None
    frame: int | None = None
    level: bool = False
    height: int = HEIGHT


@dataclass(frozen=True, eq=False)
class Fused:
    """One light, and where it comes from.

    Attributes:
        environment: the light.
        placed: frames that went into it, in the order given.
        rotations: of the placed ones: `frame_from_camera`, the environment's frame.
        log_gain: ln of each kept view's exposure and white balance, by frame number.
        dropped: frames that could not be placed.
        vertical_fov_rad: as used, of the frame whose camera the light is in.
        notes: what the user should know.
        session: everything, to go on with.
        front: the front camera's photo that went into it as well.
    """

    environment: Environment
    placed: tuple[SourceFrame, ...]
    rotations: Float[np.ndarray, "placed 3 3"]
    log_gain: dict[int, Float[np.ndarray, "3"]]
    dropped: tuple[SourceFrame, ...]
    vertical_fov_rad: float
    notes: tuple[str, ...]
    session: Session
    front: SourceFrame | None = None


def fuse_views(
    photos: Sequence[PhotoLike],
    rotations: Sequence[Rotation] | None = None,
    estimator: NetworkEstimator | None = None,
    settings: FuseSettings = FuseSettings(),
) -> Environment:
    """Make one light out of several photos of one place.

    Args:
        photos: files, Pillow images or upright RGB pixels, in the order they were taken.
        rotations: world_from_camera of each, upright picture (+X right, +Y up, -Z the view); left
            out, they are found from the pictures.
        estimator: left out, the shipped model.
        settings: which frame's camera the result is in, and more.

    Returns:
        The light relative to that frame's white, and how much of it was seen.

    Raises:
        InputError: a photo cannot be used, or no two of them could be placed.
        OSError: a file cannot be read.
    """
    from deeplight.estimators.open import open_model

    if rotations is not None and len(rotations) != len(photos):
        got = f"{len(rotations)} for {len(photos)} photos"
        raise ShapeError("a rotation for each photo", got, "give as many")
    frames = []
    for number, photo in enumerate(photos):
        opened = as_photo(photo)
        name = opened.source.name if opened.source else f"photo {number}"
        frames.append(frame_of(opened, name, number))
    frames = with_fields_of_view(frames, settings.fov_deg and radians(settings.fov_deg))
    if rotations is not None:
        turns = (np.asarray(turn, float) for turn in rotations)
        frames = [replace(f, world_from_camera=turn) for f, turn in zip(frames, turns, strict=True)]
    return fuse_frames(frames, estimator or open_model(), settings).environment


def fuse_frames(
    frames: Sequence[SourceFrame],
    estimator: NetworkEstimator,
    settings: FuseSettings = FuseSettings(),
    front: SourceFrame | None = None,
    kept: KeptFolder | None = None,
) -> Fused:
    """Place frames and fuse them.

    Args:
        frames: with their rotations, or all without, and so their fields of view
            (`with_fields_of_view`).
        estimator: the network.
        settings: how; the field of view is the frames'.
        front: a photo of the front camera, taken with the first frame.
        kept: where a run that was killed has left rotations and estimates of these frames.

    Raises:
        ConfigError: no such frame, or level cannot be found.
        ImageFileError: nothing can be placed, the frame asked for among it.
    """
    if not frames:
        raise ImageFileError("photos to fuse", "none", "give some")
    if not 0 <= (settings.frame or 0) < len(frames):
        got = f"{settings.frame} of {len(frames)} frames"
        raise ConfigError("--frame among the frames used, from 0", got, "give another number")
    turns, fovs, notes = _placed(frames, front is not None, kept)
    asked = min(turns) if settings.frame is None else settings.frame
    if asked not in turns:
        got = f"{frames[asked].name}, which could not be placed"
        raise ImageFileError("a frame that shows what others show", got, "give another --frame")
    if settings.frame is None and asked > 0:
        notes.append(f"the light is in the camera of {frames[asked].name}: none before was placed")
    fov = fovs[asked]
    session = Session(fov, lambda pixels: _estimated(estimator, pixels, fov))
    estimates = _estimates(frames, fovs, list(turns), estimator, kept)
    for k in (asked, *(k for k in turns if k != asked)):
        frame = frames[k]
        added = session.add(frame.pixels, turns[k], estimates[k], frame.log_exposure, fovs[k])
        if added.forgotten:
            notes.append(f"until {frame.name} light or place changed: what was before is left out")
    if front is not None:
        _add_front(session, front, turns[asked], estimator)
    world_from_frame = turns[asked]
    if settings.level:
        world_from_frame = _levelled(frames, turns, asked)
    environment = session.environment(world_from_frame, height=settings.height)
    if settings.level:
        environment = replace(environment, frame="level")
    dropped = tuple(frame for k, frame in enumerate(frames) if k not in turns)
    return Fused(
        environment,
        tuple(frames[k] for k in turns),
        np.stack([world_from_frame.T @ turn for turn in turns.values()]),
        dict(zip((v.number for v in session.views), session.gains, strict=True)),
        dropped,
        fov,
        (*notes, *dict.fromkeys(note for frame in frames for note in frame.notes)),
        session,
        front,
    )


def _placed(
    frames: Sequence[SourceFrame], single: bool, kept: KeptFolder | None
) -> tuple[dict[int, Rotation], list[float], list[str]]:
    """Rotations of the frames that could be placed, by their place; all fields of view; notes."""
    fovs = [field_of_view(frame) for frame in frames]
    given = {k: f.world_from_camera for k, f in enumerate(frames)}
    turns = {k: turn for k, turn in given.items() if turn is not None}
    if turns:
        return turns, fovs, []
    if len(frames) == 1 and single:
        return {0: np.eye(3)}, fovs, []
    known = frames[0].vertical_fov_rad is not None
    found = _tracked(frames, fovs, known, kept)
    if not found.rotations:
        if len(frames) == 1:
            wanted = "several photos, a panorama, or a clip in which the camera turns"
            do = "turn while filming, or use `deeplight estimate`"
            raise ImageFileError(wanted, f"one picture, {frames[0].name}", do)
        got = f"{len(frames)} pictures of which no two show the same thing"
        do = "turn slower so that neighbours overlap by a third, or give --poses"
        raise ImageFileError("pictures that overlap", got, do)
    notes = []
    if found.zooms:
        by = f"by {max(found.zooms.values()) / min(found.zooms.values()):.2f}"
        notes.append(f"the camera zoomed {by} or walked on: each frame has its own field of view")
    if found.residual_rad > _MISSES_RAD:
        off = f"{degrees(found.residual_rad):.1f} degrees"
        notes.append(
            f"no turning fits the pictures, off by {off}: wrong --fov, zoomed, stretched, walked?"
        )
    fovs = [scaled(fov, found.scale / found.zooms.get(k, 1)) for k, fov in enumerate(fovs)]
    if known:
        return found.rotations, fovs, notes
    first = fovs[min(found.rotations)]
    return found.rotations, fovs, [*notes, unknown_fov(first, found=found.scale != 1)]


def _tracked(
    frames: Sequence[SourceFrame], fovs: Sequence[float], known: bool, kept: KeptFolder | None
) -> Tracked:
    """Rotations from the pictures, or those that were kept."""
    held = None if kept is None else kept.arrays("tracked")
    if held is not None:
        places = (int(place) for place in held["places"])
        turns = dict(zip(places, held["rotations"], strict=True))
        zooms = dict(zip(turns, held["zooms"].tolist(), strict=False))  # of none if it has not
        return Tracked(turns, float(held["scale"]), float(held["residual"]), zooms)
    found = track((frame.pixels for frame in frames), fovs, known)
    if kept is not None and found.rotations:
        kept.keep(
            "tracked",
            places=np.array(list(found.rotations)),
            rotations=np.stack(list(found.rotations.values())),
            scale=np.array(found.scale),
            residual=np.array(found.residual_rad),
            zooms=np.array(list(found.zooms.values())),
        )
    return found


def _estimates(
    frames: Sequence[SourceFrame],
    fovs: Sequence[float],
    chosen: Sequence[int],
    estimator: NetworkEstimator,
    kept: KeptFolder | None,
) -> dict[int, np.ndarray]:
    """What the network gives for each of the chosen frames, or what was kept of it."""
    held = None if kept is None else kept.arrays("estimates")
    if held is None:
        logs = [_estimated(estimator, frames[k].pixels, fovs[k]) for k in chosen]
        held = {"logs": np.stack(logs)}
        if kept is not None:
            kept.keep("estimates", **held)
    return dict(zip(chosen, held["logs"], strict=True))


def _estimated(estimator: NetworkEstimator, pixels: np.ndarray, fov: float) -> np.ndarray:
    radiance = estimator.estimate(pixels, degrees(fov)).radiance
    result: np.ndarray = np.log(np.maximum(radiance, 1e-6))
    return result


def _add_front(
    session: Session, front: SourceFrame, back: Rotation, estimator: NetworkEstimator
) -> None:
    fov = field_of_view(front)
    estimate = _estimated(estimator, front.pixels, fov)
    # Another sensor: what its file says of exposure is on another scale.
    session.add(front.pixels, back @ FRONT_FROM_BACK, estimate, vertical_fov_rad=fov)


def _levelled(frames: Sequence[SourceFrame], turns: dict[int, Rotation], frame: int) -> Rotation:
    """`world_from_frame` whose +Y is up and whose -Z is the frame's view made level."""
    felt = [turn @ up for k, turn in turns.items() if (up := frames[k].up) is not None]
    if all(f.world_from_camera is not None for f in frames):
        up = UP  # of every pose file's world
    elif felt:
        up = normalised(np.sum(felt, axis=0))
    else:
        up = _up_of(np.stack(list(turns.values())))
    view = -turns[frame][:, 2]
    back = up * (up @ view) - view
    if np.linalg.norm(back) < 0.1:
        raise ConfigError("a --frame not looking straight up or down", "one that does", "choose")
    back = back / np.linalg.norm(back)
    return nearest_rotation(np.stack([np.cross(up, back), up, back], axis=1))


def _up_of(turns: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "3"]:
    """The direction to which the cameras' right sides are level: people hold phones straight."""
    spread, axes = np.linalg.eigh(np.einsum("nij,nkj->ik", turns[:, :, :1], turns[:, :, :1]))
    if spread[1] < _LEVEL_SPREAD * len(turns):
        got = "frames that all look one way"
        raise ConfigError(
            "frames from several sides or with EXIF tilt, to know what is level",
            got,
            "give --poses",
        )
    up = axes[:, 0]
    result: np.ndarray = up * np.sign(up @ turns[:, :, 1].mean(0))
    return result

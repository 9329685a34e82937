"""A clip's rotations from its own metadata, if the pictures do not contradict them.

Nobody says whether a track's axes are those of the stored or of the upright picture; clocks may be
off, sensors drift, and files are cut. So some pairs of pictures are matched: neighbours, and such
as look the same way again later. Whichever axes fit the pictures are taken; if none do, the
metadata are left aside and said to be wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees, exp, radians, tan
from pathlib import Path

import numpy as np

from deeplight.errors import ImageFileError
from deeplight.frames import Rotation, rotation
from deeplight.fuse.adjust import Pair, rays_of
from deeplight.fuse.frame import SourceFrame, field_of_view, scaled, unknown_fov
from deeplight.fuse.poses import Poses, angle_between, nearest_rotation
from deeplight.fuse.track import features_of, matched
from deeplight.io.camera_motion import CameraMotion, camera_motion_of
from deeplight.io.video import facts

_PAIRS = 24  # of each kind that are matched
_NEAR_RAD, _LATER = radians(15), 8  # the same way again, and by how many pictures later at least
_WRONG_RAD, _DRIFT_RAD = radians(1.5), radians(5)
"""Medians of neighbours and of what looks the same way again, above which pictures are right."""
_WRONG_SHARE, _NOISE_RAD = 0.3, radians(0.5)
"""Neighbours may not be off by more than this share of their turn, and that much, either."""
_LOG_SCALES = np.linspace(-0.5, 0.7, 121)  # ln, of an assumed field of view's tangent
_SCALE_COSTS_RAD = radians(0.7)  # by so much better a field of view of e times the tangent must fit


@dataclass(frozen=True)
class _Check:
    """How well rotations fit the pictures.

    Attributes:
        wrong_rad: median angle by which neighbours are off, or what comes after a while.
        fits: within what is allowed.
        log_scale: ln of what the assumed field of view's tangent is multiplied by, to fit best.
    """

    wrong_rad: float
    fits: bool
    log_scale: float


def with_motion(
    frames: Sequence[SourceFrame], path: Path, fov_rad: float | None
) -> tuple[list[SourceFrame], tuple[str, ...]]:
    """Give a clip's frames the rotations of its metadata; as they are, without or with wrong ones.

    Args:
        frames: of the clip, without rotations.
        path: of the clip.
        fov_rad: vertical field of view of the upright frames; None if unknown. Then it is found.

    Returns:
        The frames, all of them with or without a rotation, and what the user should know.

    Raises:
        OSError, InputError: the clip cannot be read any more.
    """
    try:
        motion = camera_motion_of(path)
    except ImageFileError as error:
        return list(frames), (f"rotations from the pictures: got {error.got}",)
    if motion is None or len(frames) < 2:
        return list(frames), ()
    turned_deg = facts(path).rotation_deg
    axes = {0: np.eye(3), turned_deg: rotation("z", -radians(turned_deg))}
    found = [_turns(motion, turn, frames) for turn in axes.values()]
    poses = [turns for turns in found if turns is not None]
    if not poses:
        return list(frames), (f"{motion.format} metadata of a part of the clip only: not used",)
    return _with_turns(frames, poses, fov_rad, f"{motion.format} metadata")


def checked(frames: Sequence[SourceFrame]) -> tuple[list[SourceFrame], tuple[str, ...]]:
    """Look whether the pictures contradict rotations that somebody gave; find the field of view.

    Args:
        frames: with those rotations, and all or none with fields of view.

    Returns:
        The frames, with the field of view that fits best if nothing says it, and what the user
        should know: a line, if the pictures contradict the rotations.
    """
    turns = [f.world_from_camera for f in frames if f.world_from_camera is not None]
    if len(turns) < max(2, len(frames)):
        return list(frames), ()
    fovs, unknown = [field_of_view(f) for f in frames], frames[0].vertical_fov_rad is None
    pairs = _pairs(frames, turns, fovs)
    check = _checked(pairs, turns, unknown) if pairs else _Check(0.0, True, 0.0)
    notes: list[str] = []
    if not check.fits:
        off = f"{degrees(check.wrong_rad):.1f} degrees"
        notes.append(
            f"the poses contradict the pictures by {off}: other axes, order, times or --fov?"
        )
    elif unknown and pairs:
        fovs = [scaled(fov, exp(check.log_scale)) for fov in fovs]
    if unknown:
        notes.append(unknown_fov(fovs[0], found=check.fits and bool(pairs)))
    return [replace(f, vertical_fov_rad=fov) for f, fov in zip(frames, fovs, strict=True)], (
        *notes,
    )


def _with_turns(
    frames: Sequence[SourceFrame],
    poses: Sequence[Sequence[Rotation]],
    fov_rad: float | None,
    source: str,
) -> tuple[list[SourceFrame], tuple[str, ...]]:
    """The frames with those of several rotations that fit the pictures, or without."""
    fov = fov_rad or field_of_view(frames[0])
    pairs = _pairs(frames, poses[0], [fov] * len(frames))
    if not pairs:
        note = f"rotations from {source}, which the pictures show too little to confirm"
        return _placed(frames, poses[0], fov_rad), (note,)
    checks = [_checked(pairs, turns, fov_rad is None) for turns in poses]
    best = min(range(len(checks)), key=lambda k: checks[k].wrong_rad)
    off = f"{degrees(checks[best].wrong_rad):.1f} degrees"
    if not checks[best].fits:
        return list(frames), (f"{source} contradict the pictures by {off}: rotations from these",)
    notes = [f"rotations from {source}; the pictures agree within {off}"]
    if fov_rad is None:
        fov = scaled(fov, exp(checks[best].log_scale))
        notes.append(unknown_fov(fov, found=True))
    return _placed(frames, poses[best], fov), tuple(notes)


def _placed(
    frames: Sequence[SourceFrame], turns: Sequence[Rotation], fov_rad: float | None
) -> list[SourceFrame]:
    return [
        replace(frame, world_from_camera=turn, vertical_fov_rad=fov_rad)
        for frame, turn in zip(frames, turns, strict=True)
    ]


def _turns(
    motion: CameraMotion, stored_from_upright: Rotation, frames: Sequence[SourceFrame]
) -> list[Rotation] | None:
    """World from each upright frame; None if the track has no rotation of one of them."""
    times = motion.times_s
    step = float(np.median(np.diff(times)))  # a sample is good for so long
    ends = np.concatenate([[times[0] - step], times, [times[-1] + step]])
    inner = motion.rotations @ stored_from_upright
    poses = Poses(np.concatenate([inner[:1], inner, inner[-1:]]), None, ends)
    found = [poses.at(frame.number, frame.time_s) for frame in frames]
    turns = [turn for turn in found if turn is not None]
    return turns if len(turns) == len(frames) else None


def _pairs(
    frames: Sequence[SourceFrame], turns: Sequence[Rotation], fovs_rad: Sequence[float]
) -> list[Pair]:
    """Some neighbours, and some that by these rotations look the same way again."""
    looks = np.stack(turns)
    cosine = (np.einsum("iab,jab->ij", looks, looks) - 1) / 2
    count = len(frames)
    again = np.argwhere(np.triu(cosine > np.cos(_NEAR_RAD), _LATER))
    neighbours = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    tried = [
        (int(first), int(second))
        for kind in (neighbours, again)
        for first, second in kind[:: max(1, -(-len(kind) // _PAIRS))]
    ]
    needed = sorted({k for pair in tried for k in pair})
    features = {k: features_of(frames[k].pixels, tan(fovs_rad[k] / 2)) for k in needed}
    found = (matched(features, *pair) for pair in tried)
    return [pair for pair in found if pair is not None]


def _checked(pairs: Sequence[Pair], turns: Sequence[Rotation], fov_free: bool) -> _Check:
    """How far the pictures' own rotations are off, at the field of view with which they fit."""
    best, least = _Check(np.inf, False, 0.0), np.inf
    for log_scale in _LOG_SCALES if fov_free else [0.0]:
        near: list[tuple[float, float]] = []
        later: list[tuple[float, float]] = []
        for pair in pairs:
            step = turns[pair.first].T @ turns[pair.second]
            seen = nearest_rotation(rays_of(pair.one, log_scale).T @ rays_of(pair.other, log_scale))
            kind = near if pair.second - pair.first < _LATER else later
            kind.append((angle_between(step, seen), angle_between(step, np.eye(3))))
        wrong, turned = np.median(near or [(0, 0)], axis=0)
        drift = np.median([off for off, _ in later] or [0])
        if wrong + drift + _SCALE_COSTS_RAD * abs(log_scale) < least:
            least = wrong + drift + _SCALE_COSTS_RAD * abs(log_scale)
            most = np.clip(_WRONG_SHARE * turned, _NOISE_RAD, _WRONG_RAD)
            fits = bool(wrong < most and drift < _DRIFT_RAD)
            best = _Check(float(max(wrong, drift)), fits, float(log_scale))
    return best

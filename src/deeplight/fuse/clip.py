"""The frames of a clip that are worth placing, found stretch by stretch.

A stretch of `STRETCH_S` is looked through without knowing the others, so it does not matter which
process does it and when: several workers, or a run that goes on after a kill, find the same frames.
"""

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np

from deeplight import jobs
from deeplight.fuse.choose import moving
from deeplight.fuse.frame import SourceFrame, frame_of
from deeplight.io.kept_folder import KeptFolder
from deeplight.io.photos import Photo
from deeplight.io.video import VideoFrame, facts, video_frames

STRETCH_S = 10.0
_ALL = "counts"
_WHOLE = 0.9  # of the frames that a file claims; cuts that hide some are no damage


def clip_frames(path: Path, kept: KeptFolder | None, workers: int = 1) -> Iterator[SourceFrame]:
    """The frames of a clip that show something new, in order.

    Args:
        path: of the clip.
        kept: where finished stretches lie; left out, nothing is kept and one process does it all.
        workers: processes; 0 is one per core.

    Raises:
        InputError, OSError: the clip cannot be read.
    """
    if kept is None:
        count = 0
        for _, group in _stretches(video_frames(path)):
            stretch = _Stretch.of(group)
            yield from stretch.frames(count)
            count += stretch.count
        return
    counts = _counts(path, kept, workers)
    notes = _missing(path, sum(counts.values()))
    before = 0
    for number, count in counts.items():
        for frame in _Stretch.kept(kept, number).frames(before):
            yield replace(frame, notes=(*frame.notes, *notes))
        before += count


def _missing(path: Path, frames: int) -> tuple[str, ...]:
    """What to say of a clip of which this number of frames were whole."""
    claimed = facts(path).frames or 0
    if frames > _WHOLE * claimed:
        return ()
    return (f"damaged: {claimed - frames} of {claimed} frames are left out",)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Frames chosen of a stretch, and how many there were in all.

    Attributes:
        chosen: numbered from the stretch's first frame.
    """

    chosen: tuple[SourceFrame, ...]
    count: int

    @classmethod
    def of(cls, stills: Iterator[VideoFrame]) -> "_Stretch":
        first = next(stills)
        last = first.number

        def counted() -> Iterator[VideoFrame]:
            nonlocal last
            yield first
            for still in stills:
                last = still.number
                yield still

        chosen = [_frame(still, still.number - first.number) for still in moving(counted())]
        return cls(tuple(chosen), last - first.number + 1)

    @classmethod
    def kept(cls, folder: KeptFolder, number: int) -> "_Stretch":
        held = folder.arrays(_name(number))
        if held is None:
            raise OSError(f"{folder.folder}: what was kept of the clip is gone; run it again")
        notes = tuple(str(note) for note in held["notes"])
        places = zip(held["pixels"], held["numbers"].tolist(), held["times"].tolist(), strict=True)
        chosen = [SourceFrame("", pixels, k, time_s, notes=notes) for pixels, k, time_s in places]
        return cls(tuple(chosen), int(held["count"]))

    def keep(self, folder: KeptFolder, number: int) -> None:
        folder.keep(
            _name(number),
            pixels=np.stack([frame.pixels for frame in self.chosen]),
            numbers=np.array([frame.number for frame in self.chosen]),
            times=np.array([frame.time_s for frame in self.chosen]),
            notes=np.array(self.chosen[0].notes, np.str_),
            count=np.array(self.count),
        )

    def frames(self, before: int) -> Iterator[SourceFrame]:
        """Numbered from the clip's first frame, if that many came before."""
        for f in self.chosen:
            number = before + f.number
            yield SourceFrame(f"frame {number}", f.pixels, number, f.time_s, notes=f.notes)


@dataclass(frozen=True)
class _Part:
    """Stretches for one process: from `first`, and before `end`."""

    path: Path
    folder: KeptFolder
    first: int
    end: float


def _counts(path: Path, kept: KeptFolder, workers: int) -> dict[int, int]:
    """How many frames each stretch has, in order; those that are missing are filled in."""
    held = kept.arrays(_ALL)
    if held is None:
        counts = _look_through(path, kept, workers)
        kept.keep(_ALL, counts=np.array(counts, int).reshape(-1, 2))
        return dict(counts)
    return dict(held["counts"].tolist())


def _look_through(path: Path, kept: KeptFolder, workers: int) -> list[tuple[int, int]]:
    """Fill in the stretches that are missing: their numbers and how many frames each has."""
    length_s = facts(path).duration_s if workers != 1 else None
    stretches = 1 if length_s is None else max(1, math.ceil(length_s / STRETCH_S))
    most = min(workers or os.cpu_count() or 1, stretches)
    cuts = [round(k * stretches / most) for k in range(most)]
    parts = [
        _Part(path, kept, first, end)
        for first, end in zip(cuts, [*cuts[1:], math.inf], strict=True)
    ]
    found: set[tuple[int, int]] = set()
    for done in jobs.run(parts, _done, jobs.Engine(workers=most)):
        if done.error is not None:
            raise done.error
        found |= set(done.result or ())
    return sorted(found)


def _done(part: _Part) -> list[tuple[int, int]]:
    """Look through one process's stretches; give numbers and counts of those that have frames."""
    found, start = [], part.first
    while start < part.end and part.folder.has(_name(start)):
        found.append((start, _counted(part.folder, start)))
        start += 1
    if start == part.end:
        return found
    # Not "start" itself: a clip whose clock does not begin at 0 has its first frames anywhere.
    stills = video_frames(part.path, start * STRETCH_S if start else -math.inf)
    for number, group in _stretches(stills):
        if number >= part.end:
            break
        found.append((number, _counted(part.folder, number, group)))
    return found


def _counted(folder: KeptFolder, number: int, stills: Iterator[VideoFrame] | None = None) -> int:
    """How many frames a stretch has, which is kept then; without stills it is already."""
    if stills is None or folder.has(_name(number)):
        return _Stretch.kept(folder, number).count
    stretch = _Stretch.of(stills)
    stretch.keep(folder, number)
    return stretch.count


def _stretches(stills: Iterator[VideoFrame]) -> Iterator[tuple[int, Iterator[VideoFrame]]]:
    return groupby(stills, lambda still: max(0, int(still.time_s // STRETCH_S)))


def _name(number: int) -> str:
    return f"stretch_{number:06d}"


def _frame(still: VideoFrame, number: int) -> SourceFrame:
    return frame_of(Photo(still.rgb(), None, notes=still.notes), "", number, still.time_s)

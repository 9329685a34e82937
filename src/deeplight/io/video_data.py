"""What a video's other tracks hold: time codes, what a camera's sensors said."""

from pathlib import Path
from typing import NamedTuple

from deeplight.io.video import opened

MOST_BYTES = 2**26
"""Of a track that are read: an hour of a camera's sensors has a third of that."""


class DataPacket(NamedTuple):
    """A sample of a track that is neither picture nor sound; its length is 0 if unknown."""

    time_s: float
    length_s: float
    content: bytes


def data_tracks(path: Path) -> list[list[DataPacket]]:
    """The samples of each such track, at most `MOST_BYTES` of it; the film itself is not read.

    Raises:
        OSError, ImageFileError, MissingExtraError: as `video.video_frames`.
    """
    with opened(path) as film:
        from av.stream import Discard

        for stream in film.container.streams:
            stream.discard = Discard.default if stream.type == "data" else Discard.all
        others = [stream for stream in film.container.streams if stream.type == "data"]
        tracks: dict[int, list[DataPacket]] = {stream.index: [] for stream in others}
        size = dict.fromkeys(tracks, 0)
        for packet in film.container.demux(others) if others else ():
            at, tick_s = packet.stream.index, packet.stream.time_base
            if packet.pts is None or not packet.size or size[at] > MOST_BYTES or not tick_s:
                continue
            size[at] += packet.size
            length_s = float((packet.duration or 0) * tick_s)
            tracks[at].append(DataPacket(float(packet.pts * tick_s), length_s, bytes(packet)))
        return list(tracks.values())

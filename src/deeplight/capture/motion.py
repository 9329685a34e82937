"""What moves in a clip and what stays: the rig is still in the frame while the world goes by.

One pass over the clip keeps a bounded sample of frames, spread evenly over it. Optical flow between
neighbouring frames shows how fast the world moves; a gradient that is the same at the same
pixel in frame after frame belongs to the rig.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera import PinholeCamera
from deeplight.io.video import VideoFrame

WORKING_SIDE = 320  # pixels, roughly, of the shorter side where flow and edges are looked at
KEPT = 24  # frames kept of a clip: at least this number, if it has them, and at most twice
_PAIR_EVERY = 4  # kept frames from one pair for optical flow to the next
_LARGE_FRAME = 2.1e6  # pixels (1080 x 1920) above which fewer frames are kept
_SOFT_STEP = 2.0  # grey levels per working pixel below which a gradient is mostly noise


@dataclass(frozen=True, eq=False)
class Sample:
    """Frames spread evenly over a clip.

    Attributes:
        stills: the kept frames, in order.
        small: the same, at the working scale.
        pairs: some neighbouring frames, at the working scale.
        count: how many frames the clip has.
    """

    stills: list[VideoFrame]
    small: list[UInt8[np.ndarray, "height width"]]
    pairs: list[tuple[UInt8[np.ndarray, "height width"], UInt8[np.ndarray, "height width"]]]
    count: int

    def working_camera(self, camera: PinholeCamera) -> PinholeCamera:
        """The camera of the small frames."""
        height, width = self.small[0].shape
        return PinholeCamera(width, height, camera.vertical_fov_rad)


@dataclass(frozen=True, eq=False)
class Evidence:
    """What the sampled frames say about every working pixel.

    Attributes:
        edge_x, edge_y: a vector across the edge that stays there; its length is 0 where
            gradients come and go and nears 1 where every frame has the same edge.
        travel_px: how far the moving half of the picture moved in the whole clip, working pixels.
    """

    edge_x: Float[np.ndarray, "height width"]
    edge_y: Float[np.ndarray, "height width"]
    travel_px: float

    @property
    def strength(self) -> Float[np.ndarray, "height width"]:
        """How steadily an edge stays at each pixel, 0 to 1."""
        return np.hypot(self.edge_x, self.edge_y)


def gather(stills: Iterable[VideoFrame]) -> Sample:
    """Read a clip once and keep an even sample of it; memory does not grow with its length.

    Every `step`-th frame is kept; when twice the wanted number has come together every other
    one is dropped again and the step doubles.
    """
    kept: list[tuple[VideoFrame, np.ndarray, np.ndarray | None]] = []
    step, count, shrink, wanted = 1, 0, 1, KEPT
    previous: VideoFrame | None = None
    for still in stills:
        if not count:
            shrink = max(1, round(min(still.luma.shape) / WORKING_SIDE))
            wanted = int(np.clip(KEPT * _LARGE_FRAME / still.luma.size, 8, KEPT))
        if count % step == 0:
            paired = previous is not None and len(kept) % _PAIR_EVERY == 0
            before = shrunk(previous.luma, shrink) if previous and paired else None
            kept.append((still, shrunk(still.luma, shrink), before))
            if len(kept) >= 2 * wanted:
                kept, step = kept[::2], 2 * step
        previous, count = still, count + 1
    pairs = [(before, after) for _, after, before in kept if before is not None]
    return Sample([s for s, _, _ in kept], [a for _, a, _ in kept], pairs, count)


def shrunk(luma: UInt8[np.ndarray, "h w"], factor: int) -> UInt8[np.ndarray, "height width"]:
    """The picture at a whole fraction of its size, as an area average."""
    size = (round(luma.shape[1] / factor), round(luma.shape[0] / factor))
    return cv2.resize(luma, size, interpolation=cv2.INTER_AREA)


def evidence(sample: Sample) -> Evidence:
    """Look at the sampled frames for edges that stay and for motion."""
    edge_x, edge_y = persistent_edges(sample.small)
    return Evidence(edge_x, edge_y, flow_speed(sample.pairs) * sample.count)


def persistent_edges(
    frames: list[UInt8[np.ndarray, "height width"]],
) -> tuple[Float[np.ndarray, "height width"], Float[np.ndarray, "height width"]]:
    """The vector across the edge that every frame has at each pixel.

    Gradients are first brought to length 0 to 1, so that one bright lamp passing by does not
    count more than an edge that stays. Two averages over the frames are made and the longer is
    taken: of the vectors, and of their orientation (twice their angle), because an outline can be
    darker than what is behind it in one frame and lighter in the next.
    """
    sums = [np.zeros(frames[0].shape, np.float32) for _ in range(4)]
    for frame in frames:
        soft = cv2.GaussianBlur(frame.astype(np.float32), (0, 0), 0.8)
        x = cv2.Sobel(soft, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
        y = cv2.Sobel(soft, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)
        length = cv2.magnitude(x, y)
        x, y = x / (length + _SOFT_STEP), y / (length + _SOFT_STEP)
        length = cv2.magnitude(x, y) + 1e-6
        terms = (x, y, (x * x - y * y) / length, 2 * x * y / length)
        for total, term in zip(sums, terms, strict=True):
            total += term
    x, y, cosine, sine = (total / len(frames) for total in sums)
    signed, unsigned = np.hypot(x, y), np.hypot(cosine, sine)
    angle = np.where(signed >= unsigned, np.arctan2(y, x), np.arctan2(sine, cosine) / 2)
    length = np.maximum(signed, unsigned)
    return length * np.cos(angle), length * np.sin(angle)


def flow_speed(
    pairs: list[tuple[UInt8[np.ndarray, "height width"], UInt8[np.ndarray, "height width"]]],
) -> float:
    """Length of the optical flow in the faster part of the picture, pixels per frame."""
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    typical = []
    for one, other in pairs:
        start = np.zeros((*one.shape, 2), np.float32)
        dx, dy = np.moveaxis(flow.calc(one, other, start), -1, 0)
        typical.append(np.percentile(np.hypot(dx[::4, ::4], dy[::4, ::4]), 75))
    return float(np.mean(typical)) if typical else 0.0

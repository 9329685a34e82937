"""What moves in a clip and what stays: the rig is still in the frame while the world goes by.

One pass over the clip keeps a bounded sample of frames, spread evenly over it. Optical flow between
neighbouring frames tells how fast the world moves; a gradient that is the same at the same
pixel in frame after frame belongs to the rig.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera import PinholeCamera
from deeplight.io.video import Still

WORKING_SIDE = 320  # pixels of the shorter side where flow and edges are looked at
KEPT = 24  # frames kept of a clip: at least so many, if it has them, and at most twice
_LARGE_FRAME = 2.1e6  # pixels (1080 x 1920) above which fewer frames are kept
_SOFT_STEP = 2.0  # grey levels per working pixel below which a gradient is mostly noise


@dataclass(frozen=True, eq=False)
class Sample:
    """Frames spread evenly over a clip.

    Attributes:
        stills: the kept frames, in order.
        small: the same, at the working scale.
        before: the frame before each of them, at the working scale.
        scale: working pixels per pixel.
        count: how many frames the clip has.
    """

    stills: list[Still]
    small: list[UInt8[np.ndarray, "height width"]]
    before: list[UInt8[np.ndarray, "height width"]]
    scale: float
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
        speed: mean length of the optical flow, working pixels per frame.
        travel_px: how far the moving half of the picture moved in the whole clip, working pixels.
    """

    edge_x: Float[np.ndarray, "height width"]
    edge_y: Float[np.ndarray, "height width"]
    speed: Float[np.ndarray, "height width"]
    travel_px: float

    @property
    def strength(self) -> Float[np.ndarray, "height width"]:
        """How steadily an edge stays at each pixel, 0 to 1."""
        return np.hypot(self.edge_x, self.edge_y)


def gather(stills: Iterable[Still]) -> Sample:
    """Read a clip once and keep an even sample of it; memory does not grow with its length.

    Every `step`-th frame is kept; when twice the wanted number has come together every other
    one is dropped again and the step doubles.
    """
    kept: list[tuple[Still, np.ndarray, np.ndarray]] = []
    step, count, scale, wanted = 1, 0, 1.0, KEPT
    previous: Still | None = None
    for still in stills:
        if not count:
            scale = min(1.0, WORKING_SIDE / min(still.luma.shape))
            wanted = int(np.clip(KEPT * _LARGE_FRAME / still.luma.size, 8, KEPT))
        if count % step == 0:
            kept.append((still, shrunk(still.luma, scale), shrunk((previous or still).luma, scale)))
            if len(kept) >= 2 * wanted:
                kept, step = kept[::2], 2 * step
        previous, count = still, count + 1
    return Sample(
        [s for s, _, _ in kept], [a for _, a, _ in kept], [b for *_, b in kept], scale, count
    )


def shrunk(luma: UInt8[np.ndarray, "h w"], scale: float) -> UInt8[np.ndarray, "height width"]:
    """The picture at the working scale, as an area average."""
    if scale >= 1:
        return luma.copy()
    size = (round(luma.shape[1] * scale), round(luma.shape[0] * scale))
    return cv2.resize(luma, size, interpolation=cv2.INTER_AREA)


def evidence(sample: Sample) -> Evidence:
    """Look at the sampled frames for edges that stay and for motion."""
    edge_x, edge_y = persistent_edges(sample.small)
    speed, typical = flow_speed(sample.small, sample.before)
    return Evidence(edge_x, edge_y, speed, typical * sample.count)


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
    frames: list[UInt8[np.ndarray, "height width"]],
    before: list[UInt8[np.ndarray, "height width"]],
) -> tuple[Float[np.ndarray, "height width"], float]:
    """Mean optical flow of each pixel and of the moving half of the picture, pixels per frame."""
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    start = np.zeros((*frames[0].shape, 2), np.float32)
    speeds = []
    for one, other in zip(before[1:], frames[1:], strict=True):  # the first has nothing before it
        dx, dy = np.moveaxis(flow.calc(one, other, start.copy()), -1, 0)
        speeds.append(cv2.magnitude(dx, dy))
    if not speeds:
        return np.zeros(frames[0].shape, np.float32), 0.0
    typical = [np.percentile(speed[::4, ::4], 75) for speed in speeds]
    return np.mean(speeds, axis=0), float(np.mean(typical))

"""Examples as the shipped network's frozen encoder has them, computed once and kept on the disk.

Features of every photo and of its mirror image (float16, mapped into memory), the spheres filmed
with it, how the camera was held, and the light: the true one where the data set has it, else the
one that explains the 8-bit spheres, so that no HDR enters what is learnt from.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float16, Float32, Int64, UInt8

from deeplight.dataset import DataSet, SplitIndex
from deeplight.evaluate.light_metrics import brightest
from deeplight.io.atomic import replacing
from deeplight.lighting import LIGHTING_SIZE
from deeplight.preprocess import normalise
from deeplight.solve import light_from_spheres
from deeplight.sphere import SPHERES
from deeplight.training.network.generator import Generator

CHUNK = 8  # photos that the encoder sees at once: more leave the processor's cache


@dataclass(frozen=True, eq=False)
class FrozenViews:
    """Examples of one split.

    Attributes:
        features: of the photo and of its mirror image.
        taken: ln radiance that was taken out of the photo (`Generator.evenly_bright`).
        spheres: bytes, in the order of `SPHERES`.
        world_from_camera: how the camera was held.
        log_gain: ln of exposure and white balance, by channel.
        main_light: unit direction in the camera frame, NaN where none stands out.
        light: the true radiance where the split has it, else empty.
        places, takes: names.
    """

    features: Float16[np.ndarray, "n 2 channels rows columns"]
    taken: Float32[np.ndarray, "n 1"]
    spheres: UInt8[np.ndarray, "n sphere size size 3"]
    world_from_camera: Float32[np.ndarray, "n 3 3"]
    log_gain: Float32[np.ndarray, "n 3"]
    main_light: Float32[np.ndarray, "n 3"]
    light: Float32[np.ndarray, "m light light 3"]
    places: np.ndarray
    takes: np.ndarray

    def __len__(self) -> int:
        return len(self.features)

    def neighbours(self) -> Int64[np.ndarray, "pairs 2"]:
        """Numbers of frames that follow each other in a take."""
        first = np.flatnonzero(self.takes[1:] == self.takes[:-1])
        return np.stack((first, first + 1), 1)


def joined(parts: Sequence[FrozenViews]) -> FrozenViews:
    """Several data sets as one."""
    columns = {
        item.name: np.concatenate([getattr(part, item.name) for part in parts])
        for item in fields(FrozenViews)
    }
    return FrozenViews(**columns)


def frozen_views(network: Generator, data: DataSet, split: str, cache: Path) -> FrozenViews:
    """A split's examples; what `cache` holds already is read from there."""
    folder = cache / f"{data.manifest_sha256[:8]}-{split}"
    names = [item.name for item in fields(FrozenViews)]
    if not all((folder / f"{name}.npy").is_file() for name in names):
        folder.mkdir(parents=True, exist_ok=True)
        index = data.index(split)
        for columns in (_shown(network, index), _filmed(data, index)):
            for name, values in columns.items():
                with replacing(folder / f"{name}.npy") as temporary, temporary.open("wb") as file:
                    np.save(file, values)
    return FrozenViews(
        **{
            name: np.load(folder / f"{name}.npy", mmap_mode="r" if name == "features" else None)
            for name in names
        }
    )


@torch.no_grad()
def _shown(network: Generator, index: SplitIndex) -> dict[str, np.ndarray]:
    """What the encoder makes of every photo."""
    network.encoder.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    features, taken = [], []
    for rows in np.array_split(np.arange(len(index)), max(1, len(index) // CHUNK)):
        photos = normalise(np.stack([index.pixels(int(n))[0] for n in rows]))
        photo, removed = network.evenly_bright(torch.from_numpy(photos))
        both = [network.features(view) for view in (photo, photo.flip(-1))]
        features.append(torch.stack(both, 1).half().numpy())
        taken.append(torch.zeros(len(rows), 1) if removed is None else removed)
    return {"features": np.concatenate(features), "taken": torch.cat(taken).numpy()}


def _filmed(data: DataSet, index: SplitIndex) -> dict[str, np.ndarray]:
    """Everything else of every example."""
    spheres, poses, gains, lights, true = [], [], [], [], []
    for number in range(len(index)):
        example = index[number]
        spheres.append(np.stack([example.spheres[name] for name in SPHERES]))
        details = example.meta.details
        poses.append(np.array(details["world_from_camera"], np.float32))
        gains.append(np.array(details["log_gain"], np.float32))
        if example.true_lighting is None:
            bases = data.bases(example.meta.rig, LIGHTING_SIZE)
            light = light_from_spheres(example.spheres, bases).radiance
        else:
            light = example.true_lighting
            true.append(light)
        lights.append(brightest(light[None]).directions[0].astype(np.float32))
    shape = (0, LIGHTING_SIZE, LIGHTING_SIZE, 3)
    return {
        "spheres": np.stack(spheres),
        "world_from_camera": np.stack(poses),
        "log_gain": np.stack(gains),
        "main_light": np.stack(lights),
        "light": np.stack(true).astype(np.float32) if true else np.zeros(shape, np.float32),
        "places": index.places,
        "takes": index.takes,
    }

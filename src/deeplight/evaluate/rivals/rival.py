"""A rival: its settings, its file, its answers. `lessons` trains it."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from jaxtyping import Float, UInt8
from safetensors import safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from deeplight.errors import ModelError
from deeplight.evaluate.rivals import gardner_2017, hold_geoffroy_2017
from deeplight.evaluate.rivals.crops import ViewPlan
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.mappings import resample

Name = Literal["gardner_2017", "hold_geoffroy_2017"]


@dataclass(frozen=True)
class RivalConfig:
    """How a rival is trained.

    Attributes:
        name: which.
        photo_size: height and width of its photos.
        encoder: the paper's, or ours, which starts from trained weights.
        width: channels as a share of the paper's.
        frozen_blocks: of our encoder; they keep the weights they started from and run once for all
            steps.
        dropout: part of the features, and of the dense layer's answers, left out of a step.
        learning_rate, batch_size, weight_decay: of Adam (AdamW where weights decay).
        steps: of training.
        epoch_steps: what Gardner's filter counts as one epoch; 0 is the number of pairs.
        views: what is seen of each panorama.
        mirrored: whether every view is learnt from its mirror image, too.
        cosine: whether the learning rate falls to a hundredth, along a cosine.
        precision: of training; bfloat16 convolutions take under half the time of a processor that
            has them, weights and losses stay float32.
        seed: of everything drawn.
    """

    name: Name
    photo_size: tuple[int, int]
    learning_rate: float
    batch_size: int
    views: ViewPlan
    encoder: gardner_2017.Encoder = "published"
    width: float = 1.0
    steps: int = 2000
    epoch_steps: int = 0
    seed: int = 0
    frozen_blocks: int = 0
    dropout: float = 0.0
    weight_decay: float = 0.0
    mirrored: bool = False
    cosine: bool = False
    precision: Literal["32-true", "bf16-mixed"] = "32-true"


_LANDSCAPE = ViewPlan(135, 101, per_panorama=40, elevation_deg=0)
"""Of the detail that a data set's middle has (see `preprocess.landscape_background`)."""
_OURS: dict[str, Any] = {
    "encoder": "ours",
    "frozen_blocks": 16,
    "dropout": 0.5,
    "weight_decay": 0.3,
    "mirrored": True,
    "cosine": True,
}

_PUBLISHED: dict[str, Any] = {"mirrored": True, "cosine": True, "precision": "bf16-mixed"}

PRESETS = {
    "gardner_2017": RivalConfig(
        "gardner_2017", (192, 256), 0.005, 64, replace(_LANDSCAPE, per_panorama=56), **_PUBLISHED
    ),
    "hold_geoffroy_2017": RivalConfig(
        "hold_geoffroy_2017", (240, 320), 0.001, 64, _LANDSCAPE, **_PUBLISHED
    ),
    "gardner_2017-ours": RivalConfig(
        "gardner_2017",
        (144, 192),
        0.001,
        48,
        replace(_LANDSCAPE, per_panorama=56),
        width=0.12,
        **_OURS,
    ),
    "hold_geoffroy_2017-ours": RivalConfig(
        "hold_geoffroy_2017", (144, 192), 0.001, 64, _LANDSCAPE, width=0.0625, **_OURS
    ),
}
"""Networks as published; and with the encoder of our landscape network. All see its views."""


@dataclass(eq=False)
class Rival:
    """A rival with its weights and what it needs to turn answers into light.

    Attributes:
        scale: factor to the light's radiance that makes the training pairs' mean power right.
        facts: numbers of the training set: median luminance, or the parameters' standard.
        history: step, loss on training pairs and on held-out ones, as training went.
    """

    config: RivalConfig
    network: nn.Module
    facts: dict[str, list[float]]
    scale: float = 1.0
    history: list[list[float]] = field(default_factory=list)

    def panorama(
        self, photo: UInt8[np.ndarray, "height width 3"]
    ) -> Float[np.ndarray, "rows columns 3"]:
        """The light of a photo in the camera's frame, relative to the camera's white."""
        self.network.eval()
        inputs = inputs_of([photo], self.config.photo_size)
        with torch.no_grad():
            first, second = (answer[0].numpy() for answer in self.network(inputs))
        if self.config.name == "gardner_2017":
            pixels = photo.astype(np.float32) / 255
            light = gardner_2017.radiance_of(first.transpose(1, 2, 0), second[0], pixels)
        else:
            standard = hold_geoffroy_2017.Standard(
                np.array(self.facts["mean"]), np.array(self.facts["spread"])
            )
            light = hold_geoffroy_2017.radiance_of(
                *hold_geoffroy_2017.sky_of(first, second, standard)
            )
        return np.asarray(light * self.scale, np.float32)

    def save(self, path: Path) -> None:
        """Write weights and facts to a .safetensors file, whole or not at all."""
        stored = {
            "config": asdict(self.config),
            "facts": self.facts,
            "scale": self.scale,
            "history": self.history,
        }
        with replacing(path) as temporary:
            weights = {k: v.contiguous() for k, v in self.network.state_dict().items()}
            save_file(weights, temporary, {"rival": json.dumps(stored)})


@reads_as(ModelError)
def load_rival(path: Path) -> Rival:
    """Read a file that `Rival.save` wrote.

    Raises:
        OSError: there is no such file.
        ModelError: it is another file, or damaged.
    """
    path.stat()
    try:
        with safe_open(path, "pt") as file:
            stored = json.loads((file.metadata() or {})["rival"])
            weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        views = stored["config"]["views"]
        stored["config"]["views"] = ViewPlan(**{**views, "fov_deg": tuple(views["fov_deg"])})
        stored["config"]["photo_size"] = tuple(stored["config"]["photo_size"])
        config = RivalConfig(**stored["config"])
        network = new_network(config)
        network.load_state_dict(weights)
        return Rival(config, network, stored["facts"], stored["scale"], stored["history"])
    except Exception as error:  # safetensors has its own kind
        raise ModelError("a trained rival", f"{path}: {error}", "train one") from None


def new_network(config: RivalConfig) -> nn.Module:
    """The rival's network before training."""
    shape = (config.photo_size, config.encoder, config.width, config.frozen_blocks, config.dropout)
    network: nn.Module
    if config.name == "gardner_2017":
        network = gardner_2017.Gardner2017(*shape)
    else:
        network = hold_geoffroy_2017.HoldGeoffroy2017(*shape)
    if config.encoder == "published":  # 0.85 of the time, on a CPU
        network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return network


def inputs_of(
    photos: Sequence[UInt8[np.ndarray, "height width 3"]] | UInt8[np.ndarray, "n height width 3"],
    size: tuple[int, int],
) -> Float[Tensor, "n 3 photo_height photo_width"]:
    """Photos at the network's size, -0.5 to 0.5."""
    fitting = [
        photo if photo.shape[:2] == size else resample.shrink(photo, *size) for photo in photos
    ]
    pixels = np.stack(fitting).astype(np.float32) / np.float32(255) - np.float32(0.5)
    return torch.from_numpy(np.ascontiguousarray(pixels.transpose(0, 3, 1, 2)))

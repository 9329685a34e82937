"""Train a rival on panoramas of training places, keep it in a file, and let it answer photos."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float, UInt8
from safetensors import safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from deeplight.camera_response import LUMINANCE
from deeplight.errors import ConfigError, ModelError
from deeplight.evaluate.rivals import gardner_2017, hold_geoffroy_2017
from deeplight.evaluate.rivals.crops import Pair, Views
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.mappings import resample

Name = Literal["gardner_2017", "hold_geoffroy_2017"]


@dataclass(frozen=True)
class RivalConfig:
    """How a rival is trained; defaults are the paper's where it states a number.

    Attributes:
        name: which.
        photo_size: height and width of its photos.
        encoder: of Gardner 2017: the paper's, or ours.
        width: channels as a share of the paper's.
        learning_rate, batch_size: of Adam.
        steps: of training.
        epoch_steps: what Gardner's filter counts as one epoch; 0 is the number of pairs.
        views: what is seen of each panorama.
        seed: of everything drawn.
    """

    name: Name
    photo_size: tuple[int, int]
    learning_rate: float
    batch_size: int
    views: Views
    encoder: gardner_2017.Encoder = "published"
    width: float = 1.0
    steps: int = 2000
    epoch_steps: int = 0
    seed: int = 0


PRESETS = {
    "gardner_2017": RivalConfig(
        "gardner_2017", (192, 256), 0.005, 64, Views(256, 192, elevation_deg=30)
    ),
    "gardner_2017-ours": RivalConfig(
        "gardner_2017", (144, 192), 0.001, 64, Views(192, 144, elevation_deg=30), encoder="ours"
    ),
    "hold_geoffroy_2017": RivalConfig(
        "hold_geoffroy_2017",
        (240, 320),
        0.01,
        128,
        Views(320, 240, per_panorama=7, elevation_deg=20, fov_deg=(35.0, 68.0)),
    ),
    "hold_geoffroy_2017-same-camera": RivalConfig(
        "hold_geoffroy_2017", (144, 192), 0.001, 64, Views(192, 144, elevation_deg=30)
    ),
}
"""As published, and with the camera (Gardner: and the encoder) of our landscape network."""


@dataclass(eq=False)
class Rival:
    """A rival with its weights and what it needs to turn answers into light.

    Attributes:
        scale: factor to the light's radiance that makes the training pairs' mean power right.
        facts: numbers of the training set: median luminance, or the parameters' standard.
    """

    config: RivalConfig
    network: nn.Module
    facts: dict[str, list[float]]
    scale: float = 1.0
    losses: list[float] = field(default_factory=list)

    def panorama(
        self, photo: UInt8[np.ndarray, "height width 3"]
    ) -> Float[np.ndarray, "rows columns 3"]:
        """The light of a photo in the camera's frame, relative to the camera's white."""
        self.network.eval()
        inputs = _inputs([photo], self.config.photo_size)
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
        header = {"config": asdict(self.config), "facts": self.facts, "scale": self.scale}
        with replacing(path) as temporary:
            weights = {k: v.contiguous() for k, v in self.network.state_dict().items()}
            save_file(weights, temporary, {"rival": json.dumps(header)})


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
            header = json.loads((file.metadata() or {})["rival"])
            weights = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        views = header["config"]["views"]
        header["config"]["views"] = Views(**{**views, "fov_deg": tuple(views["fov_deg"])})
        header["config"]["photo_size"] = tuple(header["config"]["photo_size"])
        config = RivalConfig(**header["config"])
        network = _network(config)
        network.load_state_dict(weights)
        return Rival(config, network, header["facts"], header["scale"])
    except (ValueError, KeyError, TypeError, RuntimeError) as error:
        raise ModelError("a trained rival", f"{path}: {error}", "train one") from None
    except Exception as error:  # safetensors has its own kind
        raise ModelError("a trained rival", f"{path}: {error}", "train one") from None


def train_rival(
    config: RivalConfig,
    pairs: Sequence[Pair],
    progress: Callable[[int, float], None] = lambda step, loss: None,
) -> Rival:
    """Train on all pairs; the same config and pairs give the same rival.

    Args:
        progress: called after each step with its number and loss.

    Raises:
        ConfigError: too few pairs for a batch norm.
    """
    if len(pairs) < 2:
        raise ConfigError("two or more pairs to train on", f"{len(pairs)}", "give more panoramas")
    torch.manual_seed(config.seed)
    random = np.random.default_rng(config.seed)
    rival = Rival(config, _network(config), {})
    wanted, criterion = _objective(rival, pairs)
    photos = np.stack([pair.photo for pair in pairs])
    optimiser = torch.optim.Adam(rival.network.parameters(), config.learning_rate)
    batch = min(config.batch_size, len(pairs))
    per_epoch = config.epoch_steps or max(1, len(pairs) // batch)
    rival.network.train()
    for step in range(config.steps):
        chosen = random.choice(len(pairs), batch, replace=False)
        found = rival.network(_inputs(photos[chosen], config.photo_size))
        rows = torch.from_numpy(chosen)
        value = criterion(found, (wanted[0][rows], wanted[1][rows]), step / per_epoch)
        optimiser.zero_grad()
        value.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        rival.losses.append(float(value.detach()))
        progress(step, rival.losses[-1])
    rival.scale = _calibrated(rival, pairs)
    return rival


def smaller(config: RivalConfig, width: float, photo_size: tuple[int, int]) -> RivalConfig:
    """The same rival with fewer channels and smaller photos."""
    height, across = photo_size
    views = replace(config.views, height=height, width=across)
    return replace(config, width=width, photo_size=photo_size, views=views)


Criterion = Callable[[tuple[Tensor, Tensor], tuple[Tensor, Tensor], float], Tensor]


def _objective(rival: Rival, pairs: Sequence[Pair]) -> tuple[tuple[Tensor, Tensor], Criterion]:
    """Targets of all pairs, and the loss; facts of the training set are kept with the rival."""
    if rival.config.name == "gardner_2017":
        light = torch.from_numpy(np.stack([p.panorama.transpose(2, 0, 1) for p in pairs]))
        luminance = np.stack([pair.panorama @ LUMINANCE for pair in pairs])
        median = float(np.median(luminance))
        rival.facts = {"median": [median]}
        return gardner_2017.targets(light, median), gardner_2017.loss
    bins, parameters = hold_geoffroy_2017.labels_of(pairs)
    standard = hold_geoffroy_2017.Standard.of(parameters)
    rival.facts = {"mean": standard.mean.tolist(), "spread": standard.spread.tolist()}
    plain = (parameters - standard.mean) / standard.spread
    first, second = (torch.from_numpy(values.astype(np.float32)) for values in (bins, plain))
    return (first, second), lambda found, own, epoch: hold_geoffroy_2017.loss(found, own)


def _calibrated(rival: Rival, pairs: Sequence[Pair], at_most: int = 64) -> float:
    """The factor that makes ln of the answers' mean luminance right on training pairs."""
    chosen = np.unique(np.linspace(0, len(pairs) - 1, at_most).astype(int))
    stops = [
        np.log(
            (pairs[n].panorama @ LUMINANCE).mean()
            / max((rival.panorama(pairs[n].photo) @ LUMINANCE).mean(), 1e-9)
        )
        for n in chosen
    ]
    return float(np.exp(np.median(stops)))


def _network(config: RivalConfig) -> nn.Module:
    if config.name == "gardner_2017":
        return gardner_2017.Gardner2017(config.photo_size, config.encoder, config.width)
    return hold_geoffroy_2017.HoldGeoffroy2017(config.photo_size, config.width)


def _inputs(
    photos: Sequence[UInt8[np.ndarray, "height width 3"]] | UInt8[np.ndarray, "n height width 3"],
    size: tuple[int, int],
) -> Float[Tensor, "n 3 photo_height photo_width"]:
    """Photos at the network's size, -0.5 to 0.5."""
    fitting = [
        photo if photo.shape[:2] == size else resample.shrink(photo, *size) for photo in photos
    ]
    pixels = np.stack(fitting).astype(np.float32) / np.float32(255) - np.float32(0.5)
    return torch.from_numpy(np.ascontiguousarray(pixels.transpose(0, 3, 1, 2)))

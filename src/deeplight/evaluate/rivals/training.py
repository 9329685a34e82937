"""Train a rival on views of training places; the best step on held-out views is kept."""

import hashlib
import math
import pickle
import time
from collections.abc import Callable, Sequence
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from safetensors.torch import load_file, save_file
from torch import Tensor

from deeplight.camera_response import LUMINANCE
from deeplight.errors import ConfigError, ModelError
from deeplight.evaluate.rivals import gardner_2017, hold_geoffroy_2017
from deeplight.evaluate.rivals.crops import Pair
from deeplight.evaluate.rivals.rival import (
    Rival,
    RivalConfig,
    inputs_of,
    new_network,
)
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.training.model_file import load_network
from deeplight.training.network.imagenet import load_imagenet
from deeplight.training.network.mobilenet_v2 import MobileNetV2Encoder

CHECKPOINT_EVERY = 50
VALIDATIONS = 16
_CHUNK = 64
_AT_ONCE = 8
_STATE = {"network", "optimiser", "best", "standing", "settings"}
Progress = Callable[[int, float], None]
Answer = tuple[Tensor, Tensor]


def train_rival(
    config: RivalConfig,
    pairs: Sequence[Pair],
    held_out: Sequence[Pair] = (),
    start: Path | None = None,
    checkpoint: Path | None = None,
    progress: Progress = lambda step, loss: None,
    minutes: float = 0.0,
) -> Rival:
    """Train on all pairs; the same config and pairs give the same rival.

    Args:
        held_out: of other places: the step with the least loss on them is kept (the last without).
        start: what our encoder's weights are taken from: folded MobileNetV2 weights of ImageNet
            (.npz), or a trained network of ours.
        checkpoint: file that a killed training goes on from; removed at the end. What frozen blocks
            gave is kept next to it.
        progress: called after each step with its number and loss.
        minutes: training ends after them, whatever `steps` says; 0: never.

    Raises:
        ConfigError: too few pairs for a batch norm; frozen blocks without weights to keep.
        ModelError: the file to start from, or the checkpoint, is another one or damaged.
    """
    if len(pairs) < 2:
        raise ConfigError("two or more pairs to train on", f"{len(pairs)}", "give more panoramas")
    torch.manual_seed(config.seed)
    rival = Rival(config, new_network(config), {})
    _begin(rival, start)
    kept = None if checkpoint is None else checkpoint.parent
    lessons = Lessons(rival, pairs, config.mirrored, kept)
    run = _Run(rival, lessons, Lessons(rival, held_out, kept=kept) if held_out else None)
    if checkpoint is not None and checkpoint.is_file():
        run.restore(checkpoint)
    run.to_the_end(checkpoint, progress, minutes)
    rival.scale = _calibrated(rival, pairs)
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    return rival


def _begin(rival: Rival, start: Path | None) -> None:
    """Give our encoder, where the rival has it, the weights that it starts from."""
    encoder = rival.network.encoder
    if not isinstance(encoder, MobileNetV2Encoder):
        return
    if start is None:
        if rival.config.frozen_blocks:
            raise ConfigError("weights for the frozen blocks", "none", "give --start FILE")
    elif start.suffix == ".npz":
        load_imagenet(encoder, start)
    else:
        trained = load_network(start)[0].encoder
        if [p.shape for p in trained.parameters()] != [p.shape for p in encoder.parameters()]:
            got = f"a narrower one in {start}"
            raise ModelError("a network with an encoder of full width", got, "start from another")
        encoder.load_state_dict(trained.state_dict())


class Lessons:
    """Pairs, and if wanted their mirror images: what goes in and what is wanted.

    The first ones, which are for training, give the rival the facts that its answers need.
    """

    def __init__(
        self,
        rival: Rival,
        pairs: Sequence[Pair],
        mirrored: bool = False,
        kept: Path | None = None,
    ) -> None:
        self.rival, self.kept = rival, kept
        self.pairs = [*pairs, *(pair.mirror() for pair in pairs)] if mirrored else list(pairs)
        self.labels: Answer | None = None
        if rival.config.name == "hold_geoffroy_2017":
            self._fit_skies()
        elif not rival.facts:
            some = pairs[:: max(1, len(pairs) // 256)]
            luminance = np.stack([pair.panorama @ LUMINANCE for pair in some])
            rival.facts = {"median": [float(np.median(luminance))]}

    def _fit_skies(self) -> None:
        bins, parameters = hold_geoffroy_2017.labels_of(self.pairs)
        if not self.rival.facts:
            standard = hold_geoffroy_2017.Standard.of(parameters)
            self.rival.facts = {"mean": standard.mean.tolist(), "spread": standard.spread.tolist()}
        mean, spread = (np.array(self.rival.facts[name]) for name in ("mean", "spread"))
        plain = (parameters - mean) / spread
        self.labels = (torch.tensor(bins).float(), torch.tensor(plain).float())

    @cached_property
    def features(self) -> Tensor | None:
        """What the frozen blocks, if any, give for every photo: they are run only once.

        Each place's is kept under a name made of their weights and of the photos, so that another
        training, of some of these places and others, finds it.
        """
        if not self.rival.config.frozen_blocks:
            return None
        weights = self._weights()
        by_place = groupby(self.pairs, lambda pair: (id(pair.place), pair.mirrored))
        return torch.cat([self._kept_features(list(some), weights) for _, some in by_place])

    def _kept_features(self, pairs: Sequence[Pair], weights: bytes) -> Tensor:
        digest = hashlib.sha256(weights)
        for pair in pairs:
            digest.update(pair.photo.tobytes())
        name = f"features-{digest.hexdigest()[:16]}.safetensors"
        path = None if self.kept is None else self.kept / name
        if path is not None and path.is_file():
            return read_features(path)
        found = self._frozen_answers(pairs)
        if path is not None:
            with replacing(path) as temporary:
                save_file({"features": found}, temporary)
        return found

    def _frozen_answers(self, pairs: Sequence[Pair]) -> Tensor:
        # A third of the time of large batches with channels first, on a CPU.
        encoder = self._encoder()
        encoder.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        found = []
        for first in range(0, len(pairs), _AT_ONCE):
            some = [pair.photo for pair in pairs[first : first + _AT_ONCE]]
            photos = inputs_of(some, self.rival.config.photo_size)
            features = encoder.frozen(photos.to(memory_format=torch.channels_last))
            found.append(features.half().contiguous())
        return torch.cat(found)

    def _weights(self) -> bytes:
        encoder = self._encoder()
        digest = hashlib.sha256(f"{self.rival.config.photo_size}".encode())
        for layer in encoder.features[: encoder.frozen_layers]:
            for parameter in layer.parameters():
                digest.update(parameter.detach().numpy().tobytes())
        return digest.digest()

    def _encoder(self) -> MobileNetV2Encoder:
        encoder = self.rival.network.encoder
        assert isinstance(encoder, MobileNetV2Encoder)
        return encoder

    def answer(self, rows: Int[np.ndarray, " n"]) -> Answer:
        """What the network makes of these photos."""
        network: Any = self.rival.network
        if self.features is None:
            halved = self.rival.config.precision == "bf16-mixed"
            with torch.autocast("cpu", torch.bfloat16, enabled=halved):
                photos = [self.pairs[row].photo for row in rows]
                answer: Answer = network(inputs_of(photos, self.rival.config.photo_size))
            return answer
        features = self.features[torch.from_numpy(rows)].float()
        return network.heads(self._encoder().learnt(features))

    def loss(self, rows: Int[np.ndarray, " n"], epoch: float) -> Float[Tensor, ""]:
        """The paper's loss of these pairs."""
        found = self.answer(rows)
        if self.labels is not None:
            chosen = torch.from_numpy(rows)
            wanted = (self.labels[0][chosen], self.labels[1][chosen])
            return hold_geoffroy_2017.loss(found, wanted)
        light = np.stack([self.pairs[row].panorama.transpose(2, 0, 1) for row in rows])
        targets = gardner_2017.targets(torch.from_numpy(light), self.rival.facts["median"][0])
        return gardner_2017.loss(found, targets, epoch)

    @torch.no_grad()
    def mean_loss(self, epoch: float) -> float:
        """Over all pairs, the network in evaluation mode."""
        rows = np.array_split(np.arange(len(self.pairs)), -(-len(self.pairs) // _CHUNK))
        sums = [float(self.loss(some, epoch)) * len(some) for some in rows]
        return sum(sums) / len(self.pairs)


@reads_as(ModelError)
def read_features(path: Path) -> Tensor:
    """Features that an earlier training kept.

    Raises:
        ModelError: the file is damaged.
    """
    return load_file(path)["features"]


class _Run:
    """A training as it goes."""

    def __init__(self, rival: Rival, lessons: Lessons, held_out: Lessons | None) -> None:
        config = rival.config
        self.rival, self.lessons, self.held_out = rival, lessons, held_out
        learnt = [p for p in rival.network.parameters() if p.requires_grad]
        self.optimiser = torch.optim.AdamW(
            learnt, config.learning_rate, weight_decay=config.weight_decay
        )
        self.batch = min(config.batch_size, len(lessons.pairs))
        self.per_epoch = config.epoch_steps or max(1, len(lessons.pairs) // self.batch)
        self.step, self.least = 0, math.inf
        self.best: dict[str, Tensor] = {}
        self.recent: list[float] = []

    def to_the_end(self, checkpoint: Path | None, progress: Progress, minutes: float) -> None:
        config, network = self.rival.config, self.rival.network
        every = max(1, config.steps // VALIDATIONS)
        started, over = time.monotonic(), False
        while self.step < config.steps and not over:
            network.train()
            loss = self._learn()
            self.step += 1
            self.recent.append(loss)
            over = 0 < minutes * 60 < time.monotonic() - started
            if self.step % every == 0 or self.step == config.steps or over:
                self._validate()
            if checkpoint is not None and self.step % CHECKPOINT_EVERY == 0:
                self._save(checkpoint)
            progress(self.step, loss)
        if self.best:
            network.load_state_dict(self.best)

    def _learn(self) -> float:
        config = self.rival.config
        # Of the step alone, so that a training that goes on sees what it would have seen.
        random = np.random.default_rng([config.seed, self.step])
        rows = random.choice(len(self.lessons.pairs), self.batch, replace=False)
        if config.cosine:
            share = 0.505 + 0.495 * math.cos(math.pi * self.step / config.steps)
            for group in self.optimiser.param_groups:
                group["lr"] = config.learning_rate * share
        value = self.lessons.loss(rows, self.step / self.per_epoch)
        self.optimiser.zero_grad()
        value.backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()
        return float(value.detach())

    def _validate(self) -> None:
        """Gardner's loss depends on the epoch: here it is always the last one's."""
        network = self.rival.network.eval()
        found = math.nan
        if self.held_out is not None:
            found = self.held_out.mean_loss(self.rival.config.steps / self.per_epoch)
            if found < self.least:
                self.least = found
                self.best = {name: v.clone() for name, v in network.state_dict().items()}
        self.rival.history.append([self.step, float(np.mean(self.recent)), found])
        self.recent = []

    def _save(self, path: Path) -> None:
        state = {
            "network": self.rival.network.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "best": self.best,
            "standing": [self.step, self.least, self.recent, self.rival.history],
            "settings": repr(self.rival.config),
        }
        with replacing(path) as temporary:
            torch.save(state, temporary)

    def restore(self, path: Path) -> None:
        """Go on from a checkpoint.

        Raises:
            ConfigError: it is of another training.
            ModelError: it is no checkpoint, or damaged.
        """
        state = _read_checkpoint(path)
        if state["settings"] != repr(self.rival.config):
            raise ConfigError(f"a checkpoint of these settings in {path}", "others", "remove it")
        self.rival.network.load_state_dict(state["network"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.best = state["best"]
        self.step, self.least, self.recent, self.rival.history = state["standing"]


@reads_as(ModelError)
def _read_checkpoint(path: Path) -> dict[str, Any]:
    """What `_Run._save` wrote: tensors, numbers and texts, never code."""
    try:
        state: dict[str, Any] = torch.load(path, weights_only=True)
    except (RuntimeError, ValueError, KeyError, EOFError, pickle.UnpicklingError) as error:
        got = f"{path}: {type(error).__name__}"
        raise ModelError("a checkpoint of a rival's training", got, "remove it") from error
    if not isinstance(state, dict) or set(state) != _STATE:
        raise ModelError("a checkpoint of a rival's training", f"{path}", "remove it")
    return state


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

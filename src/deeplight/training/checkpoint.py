"""Checkpoints as safetensors, written whole or not at all; no pickle, so none is ever executed.

All randomness of a step comes from (seed, step), see `loop`; the step number in a checkpoint is
therefore the state of every random number generator.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import safetensors
import torch
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from deeplight.errors import ConfigError, ModelError
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.io.json_text import parse_json
from deeplight.training.config import TrainConfig, differences

BEST = "best.safetensors"
"""Name of the weights with the least validation error in a run's folder."""
UNREADABLE = (safetensors.SafetensorError, KeyError, TypeError, ValueError)
"""What reading a file that is no checkpoint ends with."""

KEPT = 2


@dataclass(frozen=True)
class Header:
    """What a checkpoint says about itself."""

    step: int
    """Steps done."""
    best_score: float
    """Lowest validation score so far; infinity before the first validation."""
    settings: dict[str, Any]
    """The run's settings by dotted key."""
    manifest: str
    """SHA-256 of the data set's manifest."""

    def to_json(self) -> str:
        return json.dumps(vars(self))

    @classmethod
    def from_json(cls, text: str) -> "Header":
        return cls(**parse_json(text, finite=False))


def save(path: Path, header: Header, **states: dict[str, Tensor]) -> None:
    """Write named groups of tensors, such as model=..., average=..., optimiser=..., whole or not.

    Raises:
        OSError: the disk is full, or writing is not permitted.
    """
    tensors = {
        f"{group}/{name}": tensor.detach().contiguous().cpu()
        for group, state in states.items()
        for name, tensor in state.items()
    }
    with replacing(path) as temporary:
        try:
            save_file(tensors, temporary, metadata={"deeplight.run": header.to_json()})
        except safetensors.SafetensorError as error:  # its own name for the system's errors
            raise OSError(f"cannot write {path}: {error}") from error


@reads_as(ModelError)
def load(path: Path) -> tuple[Header, dict[str, dict[str, Tensor]]]:
    """The header and the groups of tensors of a checkpoint.

    Raises:
        ModelError: the file is not a checkpoint of this program.
    """
    header = read_header(path)
    try:
        tensors = load_file(path)
    except UNREADABLE as error:
        raise _no_checkpoint(path) from error
    groups: dict[str, dict[str, Tensor]] = {}
    for key, tensor in tensors.items():
        group, _, name = key.partition("/")
        groups.setdefault(group, {})[name] = tensor
    return header, groups


@reads_as(ModelError)
def read_header(path: Path) -> Header:
    """The header alone, without the tensors.

    Raises:
        ModelError: the file is not a checkpoint of this program.
    """
    try:
        with safetensors.safe_open(path, framework="pt") as file:
            return Header.from_json((file.metadata() or {})["deeplight.run"])
    except UNREADABLE as error:
        raise _no_checkpoint(path) from error


def _no_checkpoint(path: Path) -> ModelError:
    return ModelError("a checkpoint of a training run", str(path), "check the file")


def optimiser_state(optimiser: torch.optim.Optimizer) -> dict[str, Tensor]:
    """The optimiser's tensors by parameter number and name."""
    return {
        f"{index}.{name}": value
        for index, state in optimiser.state_dict()["state"].items()
        for name, value in state.items()
    }


def load_optimiser(optimiser: torch.optim.Optimizer, state: dict[str, Tensor]) -> None:
    """Put `optimiser_state` back, in the memory format of the parameters."""
    parameters = [p for group in optimiser.param_groups for p in group["params"]]
    restored: dict[int, dict[str, Tensor]] = {}
    for key, value in state.items():
        number, _, name = key.partition(".")
        parameter = parameters[int(number)]
        if value.shape == parameter.shape:
            value = torch.empty_like(parameter, requires_grad=False).copy_(value)
        restored.setdefault(int(number), {})[name] = value
    groups = optimiser.state_dict()["param_groups"]
    optimiser.load_state_dict({"state": restored, "param_groups": groups})


def is_finite(network: nn.Module) -> bool:
    """Whether no weight is NaN or infinite: a gradient can be so after a loss that was not."""
    return all(bool(value.isfinite().all()) for value in network.state_dict().values())


def checkpoint_path(run_dir: Path, step: int) -> Path:
    return run_dir / "checkpoints" / f"step-{step:08d}.safetensors"


def latest(run_dir: Path) -> Path | None:
    """The newest checkpoint of a run, if it has one."""
    return max((run_dir / "checkpoints").glob("step-*.safetensors"), default=None)


def remove_old(run_dir: Path, keep: int = KEPT) -> None:
    """Remove all but the newest checkpoints, and those that a kill left half written."""
    paths = sorted((run_dir / "checkpoints").glob("step-*.safetensors"))
    torn = (run_dir / "checkpoints").glob(".step-*.safetensors")
    for path in (*paths[:-keep], *torn):
        path.unlink(missing_ok=True)


def averaged(states: Mapping[str, dict[str, Tensor]]) -> dict[str, Tensor]:
    """The averaged weights, of a checkpoint or of a best.safetensors; {} where there are none."""
    return states.get("average", states.get("generator", {}))


def load_weights(generator: nn.Module, path: Path) -> None:
    """Start a network from the weights of an earlier run of the same shape.

    Raises:
        ModelError: the file cannot be read, or is of another network.
    """
    _, states = load(path)
    try:
        generator.load_state_dict(states["generator"])
    except (KeyError, RuntimeError) as error:
        raise ModelError(
            "weights of a network with the same `network` settings",
            f"{path} of another",
            "give the best.safetensors of such a run, or its settings",
        ) from error


def refuse_other_run(header: Header, config: TrainConfig, manifest: str, run_dir: Path) -> None:
    """A folder holds one run: other settings or other data need another folder."""
    changes = differences(header.settings, config)
    if header.manifest != manifest:
        changes.append("the data set")
    if changes:
        raise ConfigError(
            f"the settings that the run in {run_dir} was started with",
            f"changes of {'; '.join(changes)}",
            "undo them or give another --out",
        )

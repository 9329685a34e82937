"""The settings of a training run, nested by subject."""

import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from deeplight.errors import ConfigError
from deeplight.training.augment import AugmentConfig
from deeplight.training.data import DataConfig
from deeplight.training.distil import DistilConfig
from deeplight.training.losses import LossConfig
from deeplight.training.network.discriminator import AdversarialConfig
from deeplight.training.network.generator import NetworkConfig
from deeplight.training.optimiser import OptimiserConfig, ScheduleConfig


@dataclass(frozen=True)
class RunConfig:
    """Machine, precision and book-keeping."""

    seed: int = 0
    accelerator: str = "auto"
    """As Lightning Fabric names them: auto, cpu, cuda, mps."""
    devices: int = 1
    """Devices of each machine; a batch is divided among all of them."""
    nodes: int = 1
    """Machines."""
    precision: Literal["32-true", "bf16-mixed"] = "32-true"
    compile: bool = False
    """torch.compile the generator."""
    validate_every: int = 1000
    """Steps between two validations."""
    checkpoint_every: int = 500
    """Steps between two checkpoints; a killed run loses at most these."""
    log_every: int = 20
    """Steps between two rows of losses.csv, each the mean over its steps."""
    constant_steps: int = 300
    """Steps for fitting the constant lighting that validation compares with; 0: none."""
    time_limit_minutes: float = 0.0
    """Stop with a checkpoint after so long, to be resumed; 0: never."""


@dataclass(frozen=True)
class TrainConfig:
    """Everything that decides what a run learns; the defaults are the paper's numbers.

    The adversarial term is off unless a preset of table 1's first row switches it on.
    """

    network: NetworkConfig = field(default_factory=NetworkConfig)
    loss: LossConfig = field(default_factory=LossConfig)
    adversarial: AdversarialConfig = field(default_factory=AdversarialConfig)
    distil: DistilConfig = field(default_factory=DistilConfig)
    optimiser: OptimiserConfig = field(default_factory=OptimiserConfig)
    schedule: ScheduleConfig = field(default_factory=ScheduleConfig)
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    data: DataConfig = field(default_factory=DataConfig)
    run: RunConfig = field(default_factory=RunConfig)


# A resumed run may change these: none of them changes what the network learns.
FREE_TO_CHANGE = (
    "data.workers",
    "data.preload_gib",
    "run.devices",
    "run.nodes",
    "run.compile",
    "run.checkpoint_every",
    "run.time_limit_minutes",
)


def parse(text: str) -> Any:
    """A TOML value; a bare word is a string."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def changed(config: TrainConfig, changes: Mapping[str, Any]) -> TrainConfig:
    """`config` with the values at dotted keys replaced; unknown keys and wrong types are errors."""
    known = flatten(config)
    for key, value in changes.items():
        if key not in known:
            raise ConfigError(f"a setting of {', '.join(known)}", key, "check the spelling")
        part, name = key.split(".")
        section = getattr(config, part)
        value = coerced(key, value, section, name)
        config = replace(config, **{part: replace(section, **{name: value})})
    return config


def coerced(key: str, value: Any, section: Any, name: str) -> Any:
    """`value` as the field's type, or a ConfigError."""
    annotation = next(f.type for f in dataclasses.fields(section) if f.name == name)
    default = getattr(section, name)
    if isinstance(value, list):
        value = tuple(value)
    if annotation is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    allowed: tuple[Any, ...] = getattr(annotation, "__args__", ())
    literal = bool(allowed) and all(isinstance(a, str) for a in allowed)
    if literal and value not in allowed:
        raise ConfigError(f"{key} to be one of {', '.join(allowed)}", repr(value), "choose one")
    optional = annotation == int | None
    expected = int if optional else type(default)
    if type(value) is not expected and not (optional and value is None):
        raise ConfigError(f"{key} as {expected.__name__}", repr(value), "change the value")
    least = 1 if key == "schedule.batch_size" else 0
    if isinstance(value, int | float) and not value >= least:
        raise ConfigError(f"{key} of at least {least}", repr(value), "change the value")
    return value


def flatten(config: TrainConfig) -> dict[str, Any]:
    """The settings by dotted key."""
    return {
        f"{part}.{name}": value
        for part, section in dataclasses.asdict(config).items()
        for name, value in section.items()
    }


def differences(old: Mapping[str, Any], config: TrainConfig) -> list[str]:
    """What a run started with `old` settings may not change when it is resumed with `config`."""
    new, neutral = plain(config), plain(TrainConfig())
    was = {**{key: neutral[key] for key in new}, **old}  # a setting younger than the run was off
    return [
        f"{key} {was.get(key)} -> {new.get(key)}"
        for key in sorted({*was, *new})
        if key not in FREE_TO_CHANGE and was.get(key) != new.get(key)
    ]


def plain(config: TrainConfig) -> dict[str, Any]:
    """The settings by dotted key, as JSON gives them back."""
    return {k: list(v) if isinstance(v, tuple) else v for k, v in flatten(config).items()}

"""The settings of a training run, nested by subject, and its presets."""

import dataclasses
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from deeplight.errors import ConfigError
from deeplight.sphere import SPHERES
from deeplight.training.augment import AugmentConfig
from deeplight.training.batches import DataConfig
from deeplight.training.generator import NetworkConfig
from deeplight.training.losses import LossConfig
from deeplight.training.optimiser import OptimiserConfig, ScheduleConfig


@dataclass(frozen=True)
class RunConfig:
    """Machine, precision and book-keeping."""

    seed: int = 0
    accelerator: str = "auto"
    """As Lightning Fabric names them: auto, cpu, cuda, mps."""
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
    """Everything that decides what a run learns; the defaults are the paper's numbers."""

    network: NetworkConfig = field(default_factory=NetworkConfig)
    loss: LossConfig = field(default_factory=LossConfig)
    optimiser: OptimiserConfig = field(default_factory=OptimiserConfig)
    schedule: ScheduleConfig = field(default_factory=ScheduleConfig)
    augment: AugmentConfig = field(default_factory=AugmentConfig)
    data: DataConfig = field(default_factory=DataConfig)
    run: RunConfig = field(default_factory=RunConfig)


# A resumed run may change these: none of them changes what the network learns.
FREE_TO_CHANGE = (
    "data.workers",
    "data.preload_gib",
    "run.compile",
    "run.checkpoint_every",
    "run.time_limit_minutes",
)

PAPER = TrainConfig()

# Two CPU cores, or any GPU, and about a hundred places: what those places can teach is learnt
# in some 40,000 samples, and then the network starts to know them by heart. Every value here
# was chosen on the validation places; docs/results.md has the measurements.
SMALL = TrainConfig(
    network=NetworkConfig(latent_dropout=0.3),
    loss=LossConfig(mirror=0.4, matte_silver=0.2, diffuse=0.4),
    optimiser=OptimiserConfig(
        learning_rate=1e-3,
        weight_decay=0.05,
        encoder_lr_factor=0.5,
        ema_decay=0.998,
        max_gradient_norm=1.0,
    ),
    schedule=ScheduleConfig(batch_size=64, steps=1000, shape="cosine", warmup_steps=60),
    augment=AugmentConfig(cutout=0.4, noise=0.01, channel_shuffle=0.5),
    data=DataConfig(place_balanced=True),
    run=RunConfig(validate_every=125, checkpoint_every=125),
)

# The same run on one GPU: nothing the network learns from differs but the rounding.
GPU = replace(
    SMALL,
    data=replace(SMALL.data, workers=14, preload_gib=16.0, validation_examples=2048),
    run=replace(SMALL.run, precision="bf16-mixed"),
)


def only(config: TrainConfig, *spheres: str) -> TrainConfig:
    """The same run taught by these spheres alone, as the rows L1(m), L1(s), L1(d) of table 1."""
    weights = [
        w if name in spheres else 0.0
        for name, w in zip(SPHERES, config.loss.weights(), strict=True)
    ]
    mirror, matte_silver, diffuse = (weight / sum(weights) for weight in weights)
    loss = replace(config.loss, mirror=mirror, matte_silver=matte_silver, diffuse=diffuse)
    return replace(config, loss=loss)


PRESETS: dict[str, TrainConfig] = {
    "paper": PAPER,
    "paper-m": only(PAPER, "mirror"),
    "paper-s": only(PAPER, "matte_silver"),
    "paper-d": only(PAPER, "diffuse"),
    "small": SMALL,
    "small-m": only(SMALL, "mirror"),
    "small-s": only(SMALL, "matte_silver"),
    "small-d": only(SMALL, "diffuse"),
    "gpu": GPU,
    "gpu-m": only(GPU, "mirror"),
    "gpu-s": only(GPU, "matte_silver"),
    "gpu-d": only(GPU, "diffuse"),
}


def preset(name: str, settings: Sequence[str] = ()) -> TrainConfig:
    """A preset with settings such as "optimiser.learning_rate=3e-4" changed.

    Raises:
        ConfigError: no such preset or key, or a value of another type or below its least.
    """
    if name not in PRESETS:
        raise ConfigError(f"a preset of {', '.join(PRESETS)}", name, "choose one of these")
    changes: dict[str, Any] = {}
    for setting in settings:
        key, separator, text = setting.partition("=")
        if not separator:
            raise ConfigError("a setting as KEY=VALUE", setting, "write loss.form=paper, say")
        changes[key.strip()] = parse(text.strip())
    return changed(PRESETS[name], changes)


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
    new = {key: list(v) if isinstance(v, tuple) else v for key, v in flatten(config).items()}
    return [
        f"{key} {old.get(key)} -> {new.get(key)}"
        for key in sorted({*old, *new})
        if key not in FREE_TO_CHANGE and old.get(key) != new.get(key)
    ]

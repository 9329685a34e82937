"""Presets: a base for what there is to train with, and a variant for what is being compared.

`paper`, `small`, `gpu` and `lamps` are the bases; `small-m` is the variant `m` of `small`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from deeplight.errors import ConfigError
from deeplight.sphere import SPHERES
from deeplight.training.augment import AugmentConfig
from deeplight.training.config import RunConfig, TrainConfig, changed, parse
from deeplight.training.data import DataConfig
from deeplight.training.losses import LossConfig
from deeplight.training.network.discriminator import AdversarialConfig
from deeplight.training.network.generator import NetworkConfig
from deeplight.training.optimiser import OptimiserConfig, ScheduleConfig

PAPER = TrainConfig(adversarial=AdversarialConfig(enabled=True))

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

# Our own network, not the paper's: lamps, brightness that follows the photo's, features read both
# ways. A third of the steps of `small`, since it is better than that after a sixth.
LAMPS = replace(
    SMALL,
    network=replace(SMALL.network, lamps=3, brightness=0.9, mirrored=True),
    optimiser=replace(SMALL.optimiser, ema_decay=0.99),
    schedule=replace(SMALL.schedule, steps=340, warmup_steps=30),
    run=replace(SMALL.run, validate_every=20, checkpoint_every=20),
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


def adversarial(config: TrainConfig, enabled: bool = True) -> TrainConfig:
    """The same run with or without the adversarial term."""
    return replace(config, adversarial=replace(config.adversarial, enabled=enabled))


def shaped(config: TrainConfig, **changes: Any) -> TrainConfig:
    """The same run with another network."""
    return replace(config, network=replace(config.network, **changes))


VARIANTS: dict[str, Callable[[TrainConfig], TrainConfig]] = {
    "adv": adversarial,
    "msd": lambda config: adversarial(config, False),
    "m": lambda config: only(adversarial(config, False), "mirror"),
    "s": lambda config: only(adversarial(config, False), "matte_silver"),
    "d": lambda config: only(adversarial(config, False), "diffuse"),
    "landscape": lambda config: shaped(config, orientation="landscape"),
    "width050": lambda config: shaped(config, width=0.5),
    "width035": lambda config: shaped(config, width=0.35),
    "out16": lambda config: shaped(config, output_size=16),
    "out64": lambda config: shaped(config, output_size=64),
}
"""Rows of table 1 from top to bottom; the landscape network of section 4.3; smaller networks and
other sizes of the light, as the paper's supplement times."""

BASES = {"paper": PAPER, "small": SMALL, "gpu": GPU, "lamps": LAMPS}
"""`paper` is table 1's first row, with the adversarial term; the others do without. `lamps` is
`small` with a network that is not the paper's."""

PRESETS: dict[str, TrainConfig] = BASES | {
    f"{base}-{variant}": change(config)
    for base, config in BASES.items()
    for variant, change in VARIANTS.items()
}


def preset(name: str, settings: Sequence[str] = ()) -> TrainConfig:
    """A preset with settings such as "optimiser.learning_rate=3e-4" changed.

    Raises:
        ConfigError: no such preset or key, or a value of another type or below its least.
    """
    if name not in PRESETS:
        expected = f"a preset of {', '.join(BASES)}, or one of these with -{', -'.join(VARIANTS)}"
        raise ConfigError(expected, name, "choose one of these")
    changes: dict[str, Any] = {}
    for setting in settings:
        key, separator, text = setting.partition("=")
        if not separator:
            raise ConfigError("a setting as KEY=VALUE", setting, "write loss.form=paper, say")
        changes[key.strip()] = parse(text.strip())
    return changed(PRESETS[name], changes)

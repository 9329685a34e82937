"""How made-up places are drawn and traced."""

from dataclasses import dataclass

from deeplight.errors import ConfigError
from deeplight.simulate.panorama import MIN_HEIGHT


@dataclass(frozen=True)
class Worlds:
    """What decides every byte of a made-up place.

    Attributes:
        height: rows of each panorama.
        samples: paths through each pixel; with a quarter of them there is twice the grain.
        seed: another seed makes other places.
    """

    height: int = 320
    samples: int = 24
    seed: int = 0

    def __post_init__(self) -> None:
        if self.height < MIN_HEIGHT or self.samples < 1 or self.seed < 0:
            got = f"{self.height} rows, {self.samples} samples, seed {self.seed}"
            expected = f"at least {MIN_HEIGHT} rows, 1 sample and seed 0"
            raise ConfigError(expected, got, "correct them")

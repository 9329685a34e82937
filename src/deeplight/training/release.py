"""From a run's folder to what is shipped: the best averaged weights, batch norm folded."""

from pathlib import Path
from typing import Any

from deeplight.contract import ModelContract
from deeplight.errors import ModelError
from deeplight.training import checkpoint
from deeplight.training.checkpoint import BEST
from deeplight.training.config import TrainConfig, changed, flatten
from deeplight.training.network.generator import Generator, fold_batch_norm


def load_best(run_dir: Path) -> tuple[Generator, checkpoint.Header]:
    """The best network of a run, in evaluation mode, without batch norm.

    Raises:
        ModelError: the run has no best weights yet, or they cannot be read.
    """
    path = run_dir / BEST
    if not path.is_file():
        raise ModelError(f"{BEST} in {run_dir}", "none", "train at least up to a validation")
    header, states = checkpoint.load(path)
    generator = Generator(settings_of(header).network)
    generator.load_state_dict(states["generator"])
    fold_batch_norm(generator)
    return generator, header


def settings_of(header: checkpoint.Header) -> TrainConfig:
    """The settings a checkpoint was made with; those this version does not know are left out."""
    known = flatten(TrainConfig())
    settings: dict[str, Any] = {k: v for k, v in header.settings.items() if k in known}
    return changed(TrainConfig(), settings)


def contract_of(header: checkpoint.Header, data: str = "") -> ModelContract:
    """The contract of a run's network, which saw the trained camera's photos.

    Args:
        header: of the run's best weights.
        data: what it was trained on, in words.
    """
    config = settings_of(header)
    samples = header.step * config.schedule.batch_size
    facts = (data, f"step {header.step}, {samples} photos seen, data {header.manifest[:12]}")
    trained_on = "; ".join(fact for fact in facts if fact)
    landscape = config.network.orientation == "landscape"
    make = ModelContract.landscape if landscape else ModelContract
    return make(
        output_size=config.network.output_size,
        lamps=config.network.lamps,
        brightness=config.network.brightness,
        mirrored=config.network.mirrored,
        trained_on=trained_on,
    )

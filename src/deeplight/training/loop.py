"""The training loop: Lightning Fabric for the device and precision, everything else in the open.

Every random number of a step (which examples, flips, dropout) is a function of (seed, step). A run
that is killed and resumed therefore goes on exactly as if it had not been.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from deeplight.dataset import DataSet, open_dataset
from deeplight.errors import ConfigError, ModelError
from deeplight.io.atomic import replacing
from deeplight.io.run_record import write_run_toml
from deeplight.sphere import SPHERES
from deeplight.training import checkpoint
from deeplight.training.augment import Inputs, augment, prepare, turn_back
from deeplight.training.batches import Batch, BatchSource, ExampleBytes, Order
from deeplight.training.config import RunConfig, TrainConfig, differences, flatten
from deeplight.training.constant import fit_log_radiance
from deeplight.training.generator import PHOTO_SIZE, Generator, Orientation
from deeplight.training.imagenet import load_imagenet
from deeplight.training.losses import LossTerms, RigBases, reconstruction_terms
from deeplight.training.optimiser import MovingAverage, make_optimiser, set_learning_rate
from deeplight.training.record import RunRecord
from deeplight.training.validation import SphereErrors, Validation, score, some_of

try:  # the same Fabric comes in two packages
    from lightning_fabric import Fabric
except ImportError:
    from lightning.fabric import Fabric  # type: ignore[no-redef]

BEST = "best.safetensors"
CONSTANT = "constant_log_radiance.npy"
CALIBRATION_PHOTOS = 256
CONSTANT_EXAMPLES = 2048


@dataclass(frozen=True)
class Progress:
    """Where a run stands, for whoever watches it."""

    step: int
    total: int
    loss: float
    images_per_second: float
    errors: Sequence[SphereErrors] = ()
    """Of a validation that has just been done."""


Watch = Callable[[Progress], None]


def train(
    data_dir: Path,
    run_dir: Path,
    config: TrainConfig,
    imagenet: Path | None = None,
    watch: Watch | None = None,
    weights: Path | None = None,
) -> list[SphereErrors]:
    """Train into `run_dir`, or go on where its newest checkpoint stopped.

    A new run's encoder starts from `imagenet`, or its whole network from `weights`, the
    best.safetensors of an earlier run. Gives the errors of the last validation.

    Raises:
        DataSetError: the data set is missing, broken or without the splits the settings name.
        ConfigError: `run_dir` holds a run with other settings or data; the loss is not finite.
        ModelError: the ImageNet weights or the checkpoint cannot be read.
    """
    run = Run(open_dataset(data_dir), run_dir, config, imagenet, weights)
    try:
        return run.to_the_end(watch or (lambda _: None))
    finally:
        run.record.close()


class Run:
    """One run: its network, optimiser, data and record."""

    def __init__(
        self,
        data: DataSet,
        run_dir: Path,
        config: TrainConfig,
        imagenet: Path | None = None,
        weights: Path | None = None,
    ) -> None:
        self.run_dir, self.config, self.manifest = run_dir, config, data.manifest_sha256
        resumed = checkpoint.latest(run_dir)
        saved = checkpoint.load(resumed) if resumed else None
        if saved:
            refuse_other_run(saved[0], config, self.manifest, run_dir)
        self.fabric = fabric(config.run)
        self.device: torch.device = self.fabric.device
        self.read_data(data)
        self.build_network(None if saved or weights else imagenet, None if saved else weights)
        self.step, self.best_score = 0, float("inf")
        if saved:
            self.restore(*saved)
        facts = {
            "seed": config.run.seed,
            "data": str(data.folder),
            "manifest_sha256": self.manifest,
            "examples": len(self.examples),
            "steps": self.total,
            "imagenet": str(imagenet or ""),
            "weights": str(weights or ""),
            "resumed_at": self.step,
            "device": device_name(self.device),
        }
        write_run_toml(run_dir, asdict(config), facts)
        self.record = RunRecord(run_dir, self.step)

    def read_data(self, data: DataSet) -> None:
        """Open the splits; decode what is held in memory."""
        config = self.config.data
        names = list(data.rigs)
        self.bases = RigBases.from_rigs(list(data.rigs.values())).to(self.device)
        index = data.index(config.train_split)
        self.examples = ExampleBytes(index, names)
        refuse_other_size(self.examples, self.config.network.orientation)
        places = index.places if config.place_balanced else None
        self.order = Order(len(index), self.config.run.seed, places)
        self.source = BatchSource(self.examples, config, self.order, self.device)
        tables = {
            split: some_of(
                ExampleBytes(data.index(split), names), config.validation_examples, config.workers
            )
            for split in config.validation_splits
        }
        self.validation = Validation(tables, self.bases, self.device)
        self.total = self.config.schedule.total_steps(len(index))

    def build_network(self, imagenet: Path | None, weights: Path | None) -> None:
        """The generator and what moves it, from the seed and what a new run starts from."""
        config = self.config
        torch.manual_seed(config.run.seed)
        self.generator = Generator(config.network, config.optimiser.freeze_blocks)
        if imagenet is not None:
            some = some_of(self.examples, CALIBRATION_PHOTOS, config.data.workers)
            load_imagenet(self.generator.encoder, imagenet, prepare(*some).photo)
        if weights is not None:
            load_weights(self.generator, weights)
        # Photos arrive colour-last in memory; convolutions are fastest when weights are too.
        self.generator.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.optimiser = make_optimiser(self.generator, config.optimiser)
        self.average = MovingAverage(self.generator, config.optimiser.ema_decay)
        module: nn.Module = self.generator
        if config.run.compile:
            module = torch.compile(module)  # type: ignore[assignment]
        self.network, self.fabric_optimiser = self.fabric.setup(module, self.optimiser)
        self.judged = Generator(config.network).to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.judge = self.fabric.setup(self.judged)

    def restore(self, header: checkpoint.Header, states: dict[str, dict[str, Tensor]]) -> None:
        """Put the state of a checkpoint back."""
        self.step, self.best_score = header.step, header.best_score
        self.generator.load_state_dict(states["generator"])
        for name, value in states["average"].items():
            self.average.state[name].copy_(value)
        checkpoint.load_optimiser(self.optimiser, states["optimiser"])

    def save(self) -> None:
        """Write a checkpoint of this step."""
        checkpoint.save(
            checkpoint.checkpoint_path(self.run_dir, self.step),
            self.header(),
            generator=self.generator.state_dict(),
            average=self.average.state,
            optimiser=checkpoint.optimiser_state(self.optimiser),
        )
        checkpoint.remove_old(self.run_dir)

    def header(self) -> checkpoint.Header:
        return checkpoint.Header(self.step, self.best_score, flatten(self.config), self.manifest)

    def to_the_end(self, watch: Watch) -> list[SphereErrors]:
        """Train until the last step or the time limit."""
        config, batch_size = self.config.run, self.config.schedule.batch_size
        started = time.monotonic()
        self.compare_with_constant()
        window = Window(self.step)
        errors: list[SphereErrors] = []
        self.network.train()
        for batch in self.source.batches(batch_size, self.step, self.total):
            window.add(self.train_step(batch))
            self.step += 1
            last = self.step == self.total
            overdue = 0 < config.time_limit_minutes * 60 < time.monotonic() - started
            checkpoint_due = last or overdue or self.step % config.checkpoint_every == 0
            validation_due = last or self.step % config.validate_every == 0
            if checkpoint_due or validation_due or self.step % config.log_every == 0:
                progress = self.log(window)
                if validation_due:
                    errors = self.validate()
                    progress = replace(progress, errors=errors)
                if checkpoint_due:
                    self.save()
                watch(progress)
                window = Window(self.step)
            if overdue:
                break
        self.record.draw()
        return errors

    def inputs(self, batch: Batch, step: int) -> Inputs:
        """The augmented batch of a step; seeds everything that is random in it."""
        torch.manual_seed(step_seed(self.config.run.seed, step))
        return augment(prepare(*batch), self.config.augment)

    def train_step(self, batch: Batch) -> LossTerms:
        """One step of Adam on one batch."""
        config = self.config
        factor = config.schedule.factor(self.step, self.total)
        set_learning_rate(self.optimiser, config.optimiser.learning_rate * factor)
        inputs = self.inputs(batch, self.step)
        log_radiance = turn_back(self.network(inputs.photo), inputs.flipped)
        terms = reconstruction_terms(
            self.bases, config.loss, log_radiance, inputs.spheres, inputs.rig
        )
        self.fabric_optimiser.zero_grad()
        self.fabric.backward(terms.total())
        if config.optimiser.max_gradient_norm > 0:
            nn.utils.clip_grad_norm_(
                self.generator.parameters(), config.optimiser.max_gradient_norm
            )
        self.fabric_optimiser.step()
        self.average.update(self.generator, self.step)
        return terms

    def log(self, window: "Window") -> Progress:
        """A row of losses.csv: the mean over the steps of the window."""
        config = self.config
        losses, reported = window.values()
        self.refuse_divergence(losses, window.start)
        speed = len(losses) * config.schedule.batch_size / (time.monotonic() - window.started)
        row = {
            "step": self.step,
            "images": self.step * config.schedule.batch_size,
            "loss": float(losses.mean()),
            **dict(zip(SPHERES, reported.mean(0).tolist(), strict=True)),
            "learning_rate": self.optimiser.param_groups[0]["lr"]
            / self.optimiser.param_groups[0]["factor"],
            "images_per_second": round(speed, 2),
        }
        self.record.add_losses(row)
        return Progress(self.step, self.total, row["loss"], speed)

    def refuse_divergence(self, losses: np.ndarray, start: int) -> None:
        """Stop on a loss that is not finite and save its batch, but no checkpoint."""
        if np.isfinite(losses).all():
            return
        step = start + int(np.argmin(np.isfinite(losses)))
        size = self.config.schedule.batch_size
        inputs = self.inputs(next(self.source.batches(size, step, step + 1)), step)
        path = self.run_dir / f"not-finite-step-{step:08d}.safetensors"
        checkpoint.save(path, self.header(), batch=asdict(inputs))
        raise ConfigError(
            "a finite loss",
            f"{losses[step - start]} at step {step}",
            f"lower optimiser.learning_rate; the batch is in {path}",
        )

    def compare_with_constant(self) -> None:
        """Fit the constant lighting to the training split, once per run, and measure it."""
        path, steps = self.run_dir / CONSTANT, self.config.run.constant_steps
        if not path.exists() and steps > 0:
            some = some_of(self.examples, CONSTANT_EXAMPLES, self.config.data.workers)
            q = fit_log_radiance(self.bases, some.spheres, some.rig, self.config.loss, steps)
            with replacing(path) as temporary:
                np.save(temporary, q.cpu().numpy())
        if path.exists():
            self.validation.set_constant(torch.from_numpy(np.load(path)))

    def validate(self) -> list[SphereErrors]:
        """Measure the averaged weights on the validation splits; keep them if they are the best."""
        self.judged.load_state_dict(self.average.state)
        errors = self.validation.measure(self.judge)
        self.record.add_validation(self.step, errors)
        if errors:
            weights = dict(zip(SPHERES, self.config.loss.weights(), strict=True))
            found = score(errors, weights)
            if found >= self.best_score:
                return errors
            self.best_score = found
        checkpoint.save(self.run_dir / BEST, self.header(), generator=self.average.state)
        return errors


class Window:
    """The losses of some steps, left on the device so that no step waits for them."""

    def __init__(self, start: int) -> None:
        self.start, self.started = start, time.monotonic()
        self.losses: list[Tensor] = []
        self.reported: list[Tensor] = []

    def add(self, terms: LossTerms) -> None:
        self.losses.append(terms.total().detach())
        self.reported.append(torch.stack([terms.reported[name] for name in SPHERES]))

    def values(self) -> tuple[np.ndarray, np.ndarray]:
        """The losses (steps,) and each sphere's masked L1 (steps, spheres)."""
        return torch.stack(self.losses).cpu().numpy(), torch.stack(self.reported).cpu().numpy()


def refuse_other_run(
    header: checkpoint.Header, config: TrainConfig, manifest: str, run_dir: Path
) -> None:
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


def refuse_other_size(examples: ExampleBytes, orientation: Orientation) -> None:
    """Portrait photos need the portrait network."""
    expected, (height, width, _) = PHOTO_SIZE[orientation], examples[0].photo.shape
    if (height, width) != expected:
        raise ConfigError(
            f"photos of {expected[0]} x {expected[1]} for network.orientation={orientation}",
            f"{height} x {width}",
            "choose the other orientation",
        )


def fabric(config: RunConfig) -> Fabric:
    """Fabric on one device; a ConfigError where this machine has no such accelerator."""
    try:
        return Fabric(accelerator=config.accelerator, devices=1, precision=config.precision)
    except (ValueError, RuntimeError) as error:  # of Fabric's own checks
        raise ConfigError("an accelerator of this machine", str(error), "use auto or cpu") from None


def load_weights(generator: Generator, path: Path) -> None:
    """Start a network from the weights of an earlier run of the same shape.

    Raises:
        ModelError: the file cannot be read, or is of another network.
    """
    _, states = checkpoint.load(path)
    try:
        generator.load_state_dict(states["generator"])
    except (KeyError, RuntimeError) as error:
        raise ModelError(
            "weights of a network with the same `network` settings",
            f"{path} of another",
            "give the best.safetensors of such a run, or its settings",
        ) from error


def step_seed(seed: int, step: int) -> int:
    """A seed for everything random in one step."""
    return int(np.random.SeedSequence([seed, step]).generate_state(1, np.uint64)[0])


def device_name(device: torch.device) -> str:
    """The accelerator's name, or cpu."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else device.type

"""The training loop: Lightning Fabric for the device and precision, everything else in the open.

Every random number of a step (which examples, flips, dropout) is a function of (seed, step). A run
that is killed and resumed therefore goes on exactly as if it had not been.
"""

import time
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from deeplight.errors import ConfigError
from deeplight.io.arrays_file import read_array
from deeplight.io.atomic import only_run, replacing
from deeplight.report.run_record import write_run_toml
from deeplight.sphere import SPHERES
from deeplight.training import checkpoint, devices
from deeplight.training.adversary import Adversary
from deeplight.training.augment import Inputs, augment, prepare, turn_back
from deeplight.training.checkpoint import BEST
from deeplight.training.config import TrainConfig, flatten
from deeplight.training.constant import fit_log_radiance
from deeplight.training.data import Batch, BatchSource, ExampleBytes, Order, refuse_other_size
from deeplight.training.devices import ALONE, Share
from deeplight.training.fitted import fit_all, principal_components
from deeplight.training.losses import LossTerms, RigBases, reconstruction_terms
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator, Mixture
from deeplight.training.network.imagenet import load_imagenet
from deeplight.training.optimiser import MovingAverage, make_optimiser, set_learning_rate
from deeplight.training.record import RecentLosses, RunRecord
from deeplight.training.slim import start_from
from deeplight.training.sources import Sources
from deeplight.training.teacher import Teacher
from deeplight.training.validation import SphereErrors, Validation, score, some_of

CONSTANT = "constant_log_radiance.npy"
FITTED = "fitted"
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
    fitted: tuple[int, int] | None = None
    """Before the first step: examples whose lighting is fitted, and of how many."""


Watch = Callable[[Progress], None]


def train(
    data_dir: Path | str,
    run_dir: Path,
    config: TrainConfig,
    imagenet: Path | None = None,
    watch: Watch | None = None,
    weights: Path | None = None,
    more: Sequence[Path | str] = (),
) -> list[SphereErrors]:
    """Train into `run_dir`, or go on where its newest checkpoint stopped.

    A new run's encoder starts from `imagenet`, or its whole network from `weights`: the
    best.safetensors of an earlier run, or an exported .onnx, whose norms are put back and which
    may lack the lamps. The training split of every data set of `more` is learnt
    from, too. Gives the errors of the last validation. On several devices every process runs this;
    only the first writes, watches and gives errors.

    Raises:
        DataSetError: the data set is missing, broken or without the splits the settings name.
        ConfigError: `run_dir` holds another run, or one still going; the loss is not finite.
        ModelError: the ImageNet weights or the checkpoint cannot be read.
    """
    watch = watch or (lambda _: None)
    with only_run(run_dir):
        run = Run(Sources(data_dir, more), run_dir, config, imagenet, weights, watch)
        try:
            return run.to_the_end(watch)
        finally:
            run.record.close()


class Run:
    """One run: its network, optimiser, data and record."""

    def __init__(
        self,
        data: Sources,
        run_dir: Path,
        config: TrainConfig,
        imagenet: Path | None = None,
        weights: Path | None = None,
        watch: Watch = lambda _: None,
    ) -> None:
        self.run_dir, self.config, self.manifest = run_dir, config, data.fingerprint
        resumed = checkpoint.latest(run_dir)
        saved = checkpoint.load(resumed) if resumed else None
        if saved:
            checkpoint.refuse_other_run(saved[0], config, self.manifest, run_dir)
        self.fabric = devices.fabric(config.run, config.schedule.batch_size)
        self.device: torch.device = self.fabric.device
        self.open_splits(data)
        self.fabric.launch()  # after everything that refuses: one process reports it
        self.share = Share(self.fabric.global_rank, self.fabric.world_size)
        self.read_data()
        fresh = not saved and weights is None
        self.build_network(imagenet if fresh else None, None if saved else weights, fresh)
        self.step, self.best_score = 0, float("inf")
        if saved:
            self.restore(*saved)
        elif fresh and self.generator.mixture is not None and self.teacher is None:
            self.start_mixture(self.generator.mixture, watch)
        facts = {
            "seed": config.run.seed,
            "data": data.address,
            "manifest_sha256": self.manifest,
            "examples": len(self.examples),
            "steps": self.total,
            "imagenet": str(imagenet or ""),
            "weights": str(weights or ""),
            "resumed_at": self.step,
            "device": devices.device_name(self.device),
            "devices": self.share.ranks,
        }
        if self.first:
            write_run_toml(run_dir, asdict(config), facts)
        self.record = RunRecord(run_dir, self.step, config.adversarial.enabled, self.first)

    @property
    def first(self) -> bool:
        """Whether this is the process that writes."""
        return self.share.rank == 0

    def open_splits(self, data: Sources) -> None:
        """Find the examples of every split and what the rigs' spheres look like."""
        config, network = self.config.data, self.config.network
        measured = Path(self.config.loss.bases) if self.config.loss.bases else None
        self.bases = RigBases.from_rigs(list(data.rigs.values()), network.output_size, measured)
        chosen, held_out = data.training(config, self.config.run.seed), data.validation(config)
        data.refuse_held_out(chosen)
        names = list(data.rigs)
        self.examples = ExampleBytes(chosen, names, network.orientation)
        self.held_out = {
            split: ExampleBytes(index, names, network.orientation)
            for split, index in held_out.items()
        }
        refuse_other_size(self.examples, network.orientation)
        self.total = self.config.schedule.total_steps(len(self.examples))

    def read_data(self) -> None:
        """Decode what is held in memory."""
        config, index = self.config.data, self.examples.index
        self.bases.to(self.device)
        places = index.places if config.place_balanced else None
        self.order = Order(len(index), self.config.run.seed, places)
        self.source = BatchSource(self.examples, config, self.order, self.device, self.share)
        tables = {
            split: some_of(index, config.validation_examples, config.workers)
            for split, index in self.held_out.items()
            if self.first
        }
        self.validation = Validation(tables, self.bases, self.device)

    def build_network(self, imagenet: Path | None, weights: Path | None, fresh: bool) -> None:
        """The generator and what moves it, from the seed and what a new run starts from."""
        config = self.config
        torch.manual_seed(config.run.seed)
        self.generator = Generator(config.network, config.optimiser.freeze_blocks)
        self.teacher = Teacher.of(config) if config.distil.teacher else None
        exported = weights if weights and weights.suffix == ".onnx" else None
        if imagenet or exported or (fresh and self.teacher is not None):
            some = some_of(self.examples, CALIBRATION_PHOTOS, config.data.workers)
            photos = prepare(*some).photo
            if exported:
                start_from(self.generator, config.network, load_network(exported)[0], photos)
            elif self.teacher is not None:
                self.teacher.start(self.generator, config, photos)
            elif imagenet is not None:
                load_imagenet(self.generator.encoder, imagenet, photos)
        if self.teacher is not None:
            self.teacher.networks.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        if weights is not None and not exported:
            checkpoint.load_weights(self.generator, weights)
        devices.over_all_devices(self.generator, self.share)
        # Photos arrive colour-last in memory; convolutions are fastest when weights are too.
        self.generator.to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.optimiser = make_optimiser(self.generator, config.optimiser)
        self.average = MovingAverage(self.generator, config.optimiser.ema_decay)
        module: nn.Module = self.generator
        if config.run.compile:
            module = torch.compile(module)  # type: ignore[assignment]
        self.network, self.fabric_optimiser = self.fabric.setup(module, self.optimiser)
        self.judged = Generator(config.network).to(self.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.adversary = (
            Adversary(config, self.bases, self.fabric, self.share)
            if config.adversarial.enabled
            else None
        )

    def start_mixture(self, mixture: Mixture, watch: Watch) -> None:
        """Fit lighting to training examples; the network starts from its principal components."""
        config, path = self.config, self.run_dir / FITTED / "components.npy"
        if self.first and not path.exists():
            some = some_of(self.examples, CONSTANT_EXAMPLES, config.data.workers)

            def report(done: int, count: int) -> None:
                watch(Progress(0, self.total, float("nan"), 0.0, fitted=(done, count)))

            fits = fit_all(self.bases, some, config.loss, path.parent, report)
            flips, shuffles = config.augment.flip, config.augment.channel_shuffle > 0
            parts = principal_components(fits, config.network.components, flips, shuffles)
            with replacing(path) as temporary:
                np.save(temporary, torch.cat((parts[0][None], parts[1])).numpy())
        self.fabric.barrier()
        table = torch.from_numpy(read_array(path))
        mixture.mean.copy_(table[0])
        mixture.components.copy_(table[1:])

    def restore(self, header: checkpoint.Header, states: dict[str, dict[str, Tensor]]) -> None:
        """Put the state of a checkpoint back."""
        self.step, self.best_score = header.step, header.best_score
        self.generator.load_state_dict(states["generator"])
        for name, value in states["average"].items():
            self.average.state[name].copy_(value)
        checkpoint.load_optimiser(self.optimiser, states["optimiser"])
        if self.adversary is not None:
            self.adversary.restore(states)

    def save(self) -> None:
        """Write a checkpoint of this step."""
        if not self.first:
            return
        checkpoint.save(
            checkpoint.checkpoint_path(self.run_dir, self.step),
            self.header(),
            generator=self.generator.state_dict(),
            average=self.average.state,
            optimiser=checkpoint.optimiser_state(self.optimiser),
            **(self.adversary.states() if self.adversary else {}),
        )
        checkpoint.remove_old(self.run_dir)

    def header(self) -> checkpoint.Header:
        return checkpoint.Header(self.step, self.best_score, flatten(self.config), self.manifest)

    def to_the_end(self, watch: Watch) -> list[SphereErrors]:
        """Train until the last step or the time limit."""
        config, batch_size = self.config.run, self.config.schedule.batch_size
        started = time.monotonic()
        self.compare_with_constant()
        window = RecentLosses(self.step, self.record.reported)
        errors: list[SphereErrors] = []
        self.network.train()
        for batch in self.source.batches(batch_size, self.step, self.total):
            window.add(self.train_step(batch))
            self.step += 1
            last = self.step == self.total
            overdue = self.overdue(started)
            checkpoint_due = last or overdue or self.step % config.checkpoint_every == 0
            validation_due = last or self.step % config.validate_every == 0
            if checkpoint_due or validation_due or self.step % config.log_every == 0:
                progress = self.log(window)
                if validation_due:
                    errors = self.validate()
                    progress = replace(progress, errors=errors)
                if checkpoint_due:
                    self.save()
                if self.first:
                    watch(progress)
                window = RecentLosses(self.step, self.record.reported)
            if overdue:
                break
        self.record.draw()
        return errors

    def overdue(self, started: float) -> bool:
        """Whether the time limit is over, by the first process's clock."""
        limit = self.config.run.time_limit_minutes * 60
        over = 0 < limit < time.monotonic() - started
        return bool(self.fabric.broadcast(over)) if limit > 0 else over

    def inputs(self, batch: Batch, step: int, share: Share) -> Inputs:
        """The augmented rows of a step's batch; seeds everything that is random in it."""
        torch.manual_seed(step_seed(self.config.run.seed, step))
        return augment(prepare(*batch), self.config.augment, share)

    def train_step(self, batch: Batch) -> LossTerms:
        """One step of Adam on one batch, of D first if there is one."""
        config = self.config
        factor = config.schedule.factor(self.step, self.total)
        learning_rate = config.optimiser.learning_rate * factor
        set_learning_rate(self.optimiser, learning_rate, self.step)
        inputs = self.inputs(batch, self.step, self.share)
        log_radiance = turn_back(self.network(inputs.photo), inputs.flipped)
        terms = reconstruction_terms(
            self.bases, config.loss, log_radiance, inputs.spheres, inputs.rig
        )
        if self.adversary is not None:
            terms = self.adversary.join(terms, log_radiance, inputs, learning_rate)
        if self.teacher is not None:
            terms = self.teacher.join(terms, log_radiance, inputs)
        self.fabric_optimiser.zero_grad()
        self.fabric.backward(terms.total())
        if config.optimiser.max_gradient_norm > 0:
            nn.utils.clip_grad_norm_(
                self.generator.parameters(), config.optimiser.max_gradient_norm
            )
        self.fabric_optimiser.step()
        self.average.update(self.generator, self.step)
        return terms

    def log(self, window: "RecentLosses") -> Progress:
        """A row of losses.csv: the mean over the steps of the window."""
        config = self.config
        losses, reported = window.values(self.share)
        self.refuse_divergence(np.column_stack((losses, reported)), window.start)
        speed = len(losses) * config.schedule.batch_size / (time.monotonic() - window.started)
        row = {
            "step": self.step,
            "images": self.step * config.schedule.batch_size,
            "loss": float(losses.mean()),
            **dict(zip(window.names, reported.mean(0).tolist(), strict=True)),
            "learning_rate": self.optimiser.param_groups[0]["lr"]
            / self.optimiser.param_groups[0]["factor"],
            "images_per_second": round(speed, 2),
        }
        self.record.add_losses(row)
        return Progress(self.step, self.total, row["loss"], speed)

    def refuse_divergence(self, losses: np.ndarray, start: int) -> None:
        """Stop on losses or weights that are not finite; save the batch, no checkpoint, no best."""
        finite = np.isfinite(losses).all(1)
        players = (self.generator, self.adversary.discriminator if self.adversary else None)
        finite[-1] &= all(checkpoint.is_finite(player) for player in players if player)
        if finite.all():
            return
        step = start + int(np.argmin(finite))
        path = self.run_dir / f"not-finite-step-{step:08d}.safetensors"
        if self.first:
            source = copy(self.source)
            source.share = ALONE  # every device's rows
            batch = next(source.batches(self.config.schedule.batch_size, step, step + 1))
            checkpoint.save(path, self.header(), batch=asdict(self.inputs(batch, step, ALONE)))
        kept = checkpoint.latest(self.run_dir)
        raise ConfigError(
            "losses and weights that stay finite",
            f"others at step {step}, whose loss is {losses[step - start, 0]}",
            f"lower optimiser.learning_rate; the batch is in {path}, the last good weights in "
            f"{kept or 'no checkpoint yet'}",
        )

    def compare_with_constant(self) -> None:
        """Fit the constant lighting to the training split, once per run, and measure it."""
        path, steps = self.run_dir / CONSTANT, self.config.run.constant_steps
        if not self.first:
            return
        if not path.exists() and steps > 0:
            some = some_of(self.examples, CONSTANT_EXAMPLES, self.config.data.workers)
            q = fit_log_radiance(self.bases, some.spheres, some.rig, self.config.loss, steps)
            with replacing(path) as temporary:
                np.save(temporary, q)
        if path.exists():
            self.validation.set_constant(torch.from_numpy(read_array(path)))

    def validate(self) -> list[SphereErrors]:
        """Measure the averaged weights on the validation splits; keep them if they are the best."""
        if not self.first:
            return []
        self.judged.load_state_dict(self.average.state)
        with self.fabric.autocast():
            errors = self.validation.measure(self.judged)
        self.record.add_validation(self.step, errors)
        if self.adversary is not None and self.adversary.pictures is not None:
            self.record.add_pictures(self.step, *self.adversary.pictures)
        if errors:
            weights = dict(zip(SPHERES, self.config.loss.weights(), strict=True))
            found = score(errors, weights)
            if not found < self.best_score:  # nor is NaN the best
                return errors
            self.best_score = found
        checkpoint.save(self.run_dir / BEST, self.header(), generator=self.average.state)
        return errors


def step_seed(seed: int, step: int) -> int:
    """A seed for everything random in one step."""
    return int(np.random.SeedSequence([seed, step]).generate_state(1, np.uint64)[0])

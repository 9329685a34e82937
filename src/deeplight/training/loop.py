"""The training loop: Lightning Fabric for the device and precision, everything else in the open.

Every random number of a step (which examples, flips, dropout) is a function of (seed, step). A run
that is killed and resumed therefore goes on exactly as if it had not been.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import nn

from deeplight.errors import ConfigError
from deeplight.io.arrays_file import read_array
from deeplight.io.atomic import only_run, replacing
from deeplight.sphere import SPHERES
from deeplight.training import checkpoint
from deeplight.training.agreement import join_agreement, join_steadiness
from deeplight.training.augment import Inputs, augment, both_ways, prepare, turn_back
from deeplight.training.checkpoint import BEST
from deeplight.training.config import TrainConfig, flatten
from deeplight.training.constant import fit_log_radiance
from deeplight.training.data import Batch, BatchSource
from deeplight.training.epochs import Epochs
from deeplight.training.losses import LossTerms, reconstruction_terms
from deeplight.training.optimiser import set_learning_rate
from deeplight.training.record import RecentLosses
from deeplight.training.setup import CONSTANT_EXAMPLES, Setup, set_up
from deeplight.training.share import ALONE, Share
from deeplight.training.sources import Sources
from deeplight.training.validation import SphereErrors, score, some_of

CONSTANT = "constant_log_radiance.npy"


def train(
    data_dir: Path | str,
    run_dir: Path,
    config: TrainConfig,
    imagenet: Path | None = None,
    watch: "Watch | None" = None,
    weights: Path | None = None,
    more: Sequence[Path | str] = (),
    fresh: Epochs | None = None,
) -> list[SphereErrors]:
    """Train into `run_dir`, or go on where its newest checkpoint stopped.

    A new run's encoder starts from `imagenet`, or its whole network from `weights`: the
    best.safetensors of an earlier run, or an exported .onnx, whose norms are put back and which
    may lack the lamps. The training split of every data set of `more` is learnt from, too; with
    `fresh`, new examples instead of all these. Gives the errors of the last validation. On several
    devices every process runs this; only the first writes, watches and gives errors.

    Raises:
        DataSetError: the data set is missing, broken or without the splits the settings name.
        ConfigError: `run_dir` holds another run, or one still going; the loss is not finite.
        ModelError: the ImageNet weights or the checkpoint cannot be read.
    """
    watch = watch or (lambda _: None)
    with only_run(run_dir):
        bases = Path(config.loss.bases) if config.loss.bases else None
        sources = Sources(data_dir, more, bases)
        setup = set_up(
            sources, run_dir, config, imagenet, weights, fitting(watch), fresh, reading(watch)
        )
        run = Run(setup)
        try:
            run.compare_with_constant()
            if run.share.rank == 0:
                watch(Progress(run.step, setup.data.steps, float("nan"), 0.0))
            for batch in run.batches():
                terms = run.train_step(batch)
                overdue = run.overdue()
                run.follow(terms, overdue, watch)
                if overdue:
                    break
            run.record.draw()
            return run.errors
        finally:
            run.record.close()


@dataclass(frozen=True)
class Progress:
    """Where a run stands, for whoever watches it."""

    step: int
    total: int
    """0 while the data is read, before the first step."""
    loss: float
    """Mean over the steps since the last one shown; NaN before the first."""
    images_per_second: float
    errors: Sequence[SphereErrors] = ()
    """Of a validation that has just been done."""
    fitted: tuple[int, int] | None = None
    """Before the first step: examples whose lighting is fitted, and of how many."""


Watch = Callable[[Progress], None]


def reading(watch: Watch) -> Callable[[], None]:
    """Let `watch` see that nothing is wrong and the data is read."""
    return lambda: watch(Progress(0, 0, float("nan"), 0.0))


def fitting(watch: Watch) -> Callable[[int, int], None]:
    """Let `watch` see how far the fits before the first step are."""
    return lambda done, count: watch(Progress(0, 0, float("nan"), 0.0, fitted=(done, count)))


class Run:
    """A run under way.

    Attributes:
        step: steps taken.
        errors: of the last validation.
        best_score: the least score of a validation.
    """

    def __init__(self, setup: Setup) -> None:
        self.setup, self.config, self.networks = setup, setup.config, setup.networks
        self.fabric, self.share, self.record = setup.fabric, setup.share, setup.record
        self.step, self.best_score = setup.step, setup.best_score
        self.errors: list[SphereErrors] = []
        self.window = RecentLosses(self.step, self.record.reported)
        self.started = time.monotonic()

    def batches(self) -> Iterator[Batch]:
        """The batches of the steps that are left."""
        size, last = self.config.schedule.batch_size, self.setup.data.steps
        self.window = RecentLosses(self.step, self.record.reported)
        self.networks.forward.train()
        return self.setup.source.batches(size, self.step, last)

    def train_step(self, batch: Batch) -> LossTerms:
        """One step of Adam on one batch, of D first if there is one."""
        config, networks = self.config, self.networks
        factor = config.schedule.factor(self.step, self.setup.data.steps)
        learning_rate = config.optimiser.learning_rate * factor
        set_learning_rate(networks.optimiser, learning_rate, self.step)
        inputs = self.inputs(batch, self.step, self.share)
        if config.loss.flip:
            inputs = both_ways(inputs)
        log_radiance = turn_back(networks.forward(inputs.photo), inputs.flipped)
        terms = reconstruction_terms(
            self.setup.data.bases, config.loss, log_radiance, inputs.spheres, inputs.rig
        )
        if config.loss.flip:
            terms = join_agreement(terms, log_radiance, config.loss.flip)
        if config.loss.steady:
            source = self.setup.source
            assert isinstance(source, BatchSource)
            turn = source.turns(config.schedule.batch_size, self.step)
            terms = join_steadiness(terms, log_radiance, turn, config.loss.steady)
        if networks.adversary is not None:
            terms = networks.adversary.join(terms, log_radiance, inputs, learning_rate)
        if networks.teacher is not None:
            terms = networks.teacher.join(terms, log_radiance, inputs)
        networks.fabric_optimiser.zero_grad()
        self.fabric.backward(terms.total())
        if config.optimiser.max_gradient_norm > 0:
            nn.utils.clip_grad_norm_(
                networks.generator.parameters(), config.optimiser.max_gradient_norm
            )
        networks.fabric_optimiser.step()
        networks.average.update(networks.generator, self.step)
        return terms

    def inputs(self, batch: Batch, step: int, share: Share) -> Inputs:
        """The augmented rows of a step's batch; seeds everything that is random in it."""
        torch.manual_seed(step_seed(self.config.run.seed, step))
        return augment(prepare(*batch), self.config.augment, share)

    def overdue(self) -> bool:
        """Whether the time limit is over, by the first process's clock."""
        limit = self.config.run.time_limit_minutes * 60
        over = 0 < limit < time.monotonic() - self.started
        return bool(self.fabric.broadcast(over)) if limit > 0 else over

    def follow(self, terms: LossTerms, overdue: bool, watch: Watch) -> None:
        """Count a step; write a row, validate and save where that is due."""
        config = self.config.run
        self.window.add(terms)
        self.step += 1
        last = self.step == self.setup.data.steps
        checkpoint_due = last or overdue or self.step % config.checkpoint_every == 0
        validation_due = last or self.step % config.validate_every == 0
        if not (checkpoint_due or validation_due or self.step % config.log_every == 0):
            return
        progress = self.log(self.window)
        if validation_due:
            self.errors = self.validate()
            progress = replace(progress, errors=self.errors)
        if checkpoint_due:
            self.save()
        if self.share.rank == 0:
            watch(progress)
        self.window = RecentLosses(self.step, self.record.reported)

    def header(self) -> checkpoint.Header:
        settings = flatten(self.config)
        return checkpoint.Header(self.step, self.best_score, settings, self.setup.manifest)

    def save(self) -> None:
        """Write a checkpoint of this step."""
        if self.share.rank != 0:
            return
        networks, run_dir = self.networks, self.setup.run_dir
        checkpoint.save(
            checkpoint.checkpoint_path(run_dir, self.step),
            self.header(),
            generator=networks.generator.state_dict(),
            average=networks.average.state,
            optimiser=checkpoint.optimiser_state(networks.optimiser),
            **(networks.adversary.states() if networks.adversary else {}),
        )
        checkpoint.remove_old(run_dir)

    def log(self, window: RecentLosses) -> Progress:
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
            "learning_rate": self.networks.optimiser.param_groups[0]["lr"]
            / self.networks.optimiser.param_groups[0]["factor"],
            "images_per_second": round(speed, 2),
        }
        self.record.add_losses(row)
        return Progress(self.step, self.setup.data.steps, row["loss"], speed)

    def refuse_divergence(self, losses: np.ndarray, start: int) -> None:
        """Stop on losses or weights that are not finite; save the batch, no checkpoint, no best."""
        finite = np.isfinite(losses).all(1)
        adversary = self.networks.adversary
        players = (self.networks.generator, adversary.discriminator if adversary else None)
        finite[-1] &= all(checkpoint.is_finite(player) for player in players if player)
        if finite.all():
            return
        step = start + int(np.argmin(finite))
        path = self.setup.run_dir / f"not-finite-step-{step:08d}.safetensors"
        if self.share.rank == 0:
            source = copy(self.setup.source)
            source.share = ALONE  # every device's rows
            batch = next(source.batches(self.config.schedule.batch_size, step, step + 1))
            checkpoint.save(path, self.header(), batch=asdict(self.inputs(batch, step, ALONE)))
        kept = checkpoint.latest(self.setup.run_dir)
        raise ConfigError(
            "losses and weights that stay finite",
            f"others at step {step}, whose loss is {losses[step - start, 0]}",
            f"lower optimiser.learning_rate; the batch is in {path}, the last good weights in "
            f"{kept or 'no checkpoint yet'}",
        )

    def compare_with_constant(self) -> None:
        """Fit the constant lighting to the training split, once per run, and measure it."""
        path, steps = self.setup.run_dir / CONSTANT, self.config.run.constant_steps
        if self.share.rank != 0:
            return
        if not path.exists() and steps > 0:
            some = some_of(self.setup.data.examples, CONSTANT_EXAMPLES, self.config.data.workers)
            q = fit_log_radiance(
                self.setup.data.bases, some.spheres, some.rig, self.config.loss, steps
            )
            with replacing(path) as temporary:
                np.save(temporary, q)
        if path.exists():
            self.setup.validation.set_constant(torch.from_numpy(read_array(path)))

    def validate(self) -> list[SphereErrors]:
        """Measure the averaged weights on the validation splits; keep them if they are the best."""
        if self.share.rank != 0:
            return []
        networks = self.networks
        networks.judged.load_state_dict(networks.average.state)
        with self.fabric.autocast():
            errors = self.setup.validation.measure(networks.judged)
        self.record.add_validation(self.step, errors)
        if networks.adversary is not None and networks.adversary.pictures is not None:
            self.record.add_pictures(self.step, *networks.adversary.pictures)
        if errors:
            weights = dict(zip(SPHERES, self.config.loss.weights(), strict=True))
            found = score(errors, weights)
            if not found < self.best_score:  # nor is NaN the best
                return errors
            self.best_score = found
        checkpoint.save(self.setup.run_dir / BEST, self.header(), generator=networks.average.state)
        return errors


def step_seed(seed: int, step: int) -> int:
    """A seed for everything random in one step."""
    return int(np.random.SeedSequence([seed, step]).generate_state(1, np.uint64)[0])

"""What a run is made of before its first step: its data, its networks, what moves them.

Whatever is wrong with the settings, the data or the weights is refused here.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import lightning_fabric
import numpy as np
import torch
from torch import Tensor, nn

from deeplight.io.arrays_file import read_array
from deeplight.io.atomic import replacing
from deeplight.report.run_record import write_run_toml
from deeplight.training import checkpoint, devices
from deeplight.training.adversary import Adversary
from deeplight.training.augment import prepare
from deeplight.training.config import TrainConfig
from deeplight.training.data import BatchSource, ExampleBytes, refuse_other_size
from deeplight.training.epochs import Epochs
from deeplight.training.fitted import fit_all, principal_components
from deeplight.training.fresh import Fresh, FreshBatches, source_of, with_fresh
from deeplight.training.losses import RigBases
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator, Mixture
from deeplight.training.network.imagenet import load_imagenet
from deeplight.training.optimiser import MovingAverage, make_optimiser
from deeplight.training.record import RunRecord, reported_by
from deeplight.training.share import Share
from deeplight.training.slim import start_from
from deeplight.training.sources import Sources
from deeplight.training.teacher import Teacher
from deeplight.training.validation import Validation, some_of

FITTED = "fitted"
CALIBRATION_PHOTOS = 256
CONSTANT_EXAMPLES = 2048

Counted = Callable[[int, int], None]
"""Called with the examples that light was fitted to, and of how many."""


@dataclass(frozen=True)
class TrainingData:
    """The examples to learn from and those to validate on.

    Attributes:
        bases: what the rigs' spheres look like.
        steps: of the whole run.
        fresh: new examples that are learnt from instead of `examples`, if there are any.
    """

    bases: RigBases
    examples: ExampleBytes
    held_out: Mapping[str, ExampleBytes]
    steps: int
    fresh: Fresh | None


@dataclass(frozen=True)
class Networks:
    """The networks of a run and what moves them.

    Attributes:
        generator: G.
        forward: G as it is called in a step: on its device, compiled if asked for.
        optimiser: of G; `step` lets Lightning Fabric take its step.
        average: of G's weights; `judged` is a G that holds them to be validated.
        adversary: D and its optimiser, if there is one.
        teacher: a trained network to learn from, if there is one.
    """

    generator: Generator
    forward: nn.Module
    optimiser: torch.optim.Optimizer
    fabric_optimiser: torch.optim.Optimizer
    average: MovingAverage
    judged: Generator
    adversary: Adversary | None
    teacher: Teacher | None


@dataclass(frozen=True)
class Setup:
    """All that a run needs, at the step it begins or goes on with.

    Attributes:
        manifest: fingerprint of the data.
        source: batches of the training examples, on the device.
        step, best_score: of the checkpoint that the run goes on from, else 0 and infinity.
    """

    run_dir: Path
    config: TrainConfig
    manifest: str
    fabric: lightning_fabric.Fabric
    share: Share
    data: TrainingData
    source: BatchSource | FreshBatches
    validation: Validation
    networks: Networks
    record: RunRecord
    step: int
    best_score: float


def set_up(
    sources: Sources,
    run_dir: Path,
    config: TrainConfig,
    imagenet: Path | None = None,
    weights: Path | None = None,
    fitted: Counted = lambda done, count: None,
    fresh: Epochs | None = None,
    reading: Callable[[], None] = lambda: None,
) -> Setup:
    """Build a run, or put the state of its newest checkpoint back; see `loop.train`.

    The first process calls `reading` when nothing is left to refuse but weights, before what takes
    time.
    """
    manifest = with_fresh(sources.fingerprint, fresh, sources.held_out)
    resumed = checkpoint.latest(run_dir)
    saved = checkpoint.load(resumed) if resumed else None
    if saved:
        checkpoint.refuse_other_run(saved[0], config, manifest, run_dir)
    fabric = devices.fabric(config.run, config.schedule.batch_size)
    data = _open(sources, config, fresh)
    fabric.launch()  # after everything that refuses: one process reports it
    share = Share(fabric.global_rank, fabric.world_size)
    if share.rank == 0:
        reading()
    data.bases.to(fabric.device)
    source = source_of(data.examples, config, fabric.device, share, data.fresh)
    validation = _validation(data, config, fabric.device, share)
    networks = _networks(data, config, fabric, share, bool(saved), imagenet, weights)
    header = checkpoint.Header(0, float("inf"), {}, "") if saved is None else saved[0]
    if saved:
        _restore(networks, saved[1])
    elif weights is None and networks.teacher is None and networks.generator.mixture is not None:
        _start_mixture(networks.generator.mixture, data, config, run_dir, fabric, fitted)
    if share.rank == 0:
        facts = {
            "seed": config.run.seed,
            "data": sources.address,
            "manifest_sha256": manifest,
            "examples": len(data.examples),
            "steps": data.steps,
            "imagenet": str(imagenet or ""),
            "weights": str(weights or ""),
            "resumed_at": header.step,
            "device": devices.device_name(fabric.device),
            "devices": share.ranks,
        }
        write_run_toml(run_dir, asdict(config), facts)
    record = RunRecord(run_dir, header.step, reported_by(config), share.rank == 0)
    return Setup(
        run_dir,
        config,
        manifest,
        fabric,
        share,
        data,
        source,
        validation,
        networks,
        record,
        header.step,
        header.best_score,
    )


def _open(sources: Sources, config: TrainConfig, fresh: Epochs | None) -> TrainingData:
    """Find the examples of every split and what the rigs' spheres look like."""
    network = config.network
    bases = RigBases.of([sources.bases(rig, network.output_size) for rig in sources.rigs])
    chosen = sources.training(config.data, config.run.seed)
    splits = sources.validation(config.data)
    sources.refuse_held_out(chosen)
    names = list(sources.rigs)
    examples = ExampleBytes(chosen, names, network.orientation)
    held_out = {name: ExampleBytes(of, names, network.orientation) for name, of in splits.items()}
    refuse_other_size(examples, network.orientation)
    steps = config.schedule.total_steps(fresh.length if fresh else len(examples))
    made = Fresh(fresh, names, network.orientation) if fresh else None
    return TrainingData(bases, examples, held_out, steps, made)


def _validation(
    data: TrainingData, config: TrainConfig, device: torch.device, share: Share
) -> Validation:
    """The examples to validate on, decoded; in all processes but the first none."""
    most, workers = config.data.validation_examples, config.data.workers
    held_out = data.held_out if share.rank == 0 else {}
    tables = {split: some_of(index, most, workers) for split, index in held_out.items()}
    return Validation(tables, data.bases, device)


def _networks(
    data: TrainingData,
    config: TrainConfig,
    fabric: lightning_fabric.Fabric,
    share: Share,
    resumed: bool,
    imagenet: Path | None,
    weights: Path | None,
) -> Networks:
    """The generator and what moves it, from the seed and what a new run starts from."""
    torch.manual_seed(config.run.seed)
    generator = Generator(config.network, config.optimiser.freeze_blocks)
    teacher = Teacher.of(config) if config.distil.teacher else None
    if not resumed:
        _start(generator, teacher, data, config, imagenet, weights)
    if teacher is not None:
        _to_device(teacher.networks, fabric.device)
    devices.over_all_devices(generator, share)
    _to_device(generator, fabric.device)
    optimiser = make_optimiser(generator, config.optimiser)
    average = MovingAverage(generator, config.optimiser.ema_decay)
    module: nn.Module = generator
    if config.run.compile:
        module = torch.compile(module)  # type: ignore[assignment]
    forward, fabric_optimiser = fabric.setup(module, optimiser)
    judged = Generator(config.network)
    _to_device(judged, fabric.device)
    enabled = config.adversarial.enabled
    adversary = Adversary(config, data.bases, fabric, share) if enabled else None
    return Networks(
        generator, forward, optimiser, fabric_optimiser, average, judged, adversary, teacher
    )


def _to_device(module: nn.Module, device: torch.device) -> None:
    """Photos arrive colour-last in memory; convolutions are fastest when weights are too."""
    module.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]


def _start(
    generator: Generator,
    teacher: Teacher | None,
    data: TrainingData,
    config: TrainConfig,
    imagenet: Path | None,
    weights: Path | None,
) -> None:
    """Give a new network what it starts from: weights, else its teacher's or ImageNet's."""
    if weights is not None and weights.suffix != ".onnx":
        checkpoint.load_weights(generator, weights)
    elif weights is not None or teacher is not None or imagenet is not None:
        some = some_of(data.examples, CALIBRATION_PHOTOS, config.data.workers)
        photos = prepare(*some).photo
        if weights is not None:
            start_from(generator, config.network, load_network(weights)[0], photos)
        elif teacher is not None:
            teacher.start(generator, config, photos)
        elif imagenet is not None:
            load_imagenet(generator.encoder, imagenet, photos)


def _start_mixture(
    mixture: Mixture,
    data: TrainingData,
    config: TrainConfig,
    run_dir: Path,
    fabric: lightning_fabric.Fabric,
    fitted: Counted,
) -> None:
    """Fit lighting to training examples; the network starts from its principal components."""
    path = run_dir / FITTED / "components.npy"
    if fabric.global_rank == 0 and not path.exists():
        some = some_of(data.examples, CONSTANT_EXAMPLES, config.data.workers)
        fits = fit_all(data.bases, some, config.loss, path.parent, fitted)
        flips, shuffles = config.augment.flip, config.augment.channel_shuffle > 0
        parts = principal_components(fits, config.network.components, flips, shuffles)
        with replacing(path) as temporary:
            np.save(temporary, torch.cat((parts[0][None], parts[1])).numpy())
    fabric.barrier()
    table = torch.from_numpy(read_array(path))
    mixture.mean.copy_(table[0])
    mixture.components.copy_(table[1:])


def _restore(networks: Networks, states: dict[str, dict[str, Tensor]]) -> None:
    """Put the state of a checkpoint back."""
    networks.generator.load_state_dict(states["generator"])
    for name, value in states["average"].items():
        networks.average.state[name].copy_(value)
    checkpoint.load_optimiser(networks.optimiser, states["optimiser"])
    if networks.adversary is not None:
        networks.adversary.restore(states)

"""What other losses would bring to the shipped network, found in minutes on its frozen features.

    deeplight simulate --hdri HDRI --out data/v1 --recipe.train-takes 12 --recipe.frames 3 \\
        --recipe.eval-takes 16
    deeplight simulate --hdri HDRI --out data/v2 --recipe.phones v2 --recipe.train-takes 24 \\
        --recipe.frames 3 --recipe.seen-takes 0
    python -m lab.evidence.tuned_losses data/v1 data/v2

The encoder stays as it is; latent layer, decoder and lamps go on from the shipped weights, each row
with another loss. Examples are drawn as pairs of neighbouring frames of a take, every place as
often as the others, each pair mirrored or not. Measured on the first data set's validation places;
of a row the moving average of its weights is measured at every checkpoint, and alone as well as
half and half with the shipped weights. What is finished is kept, so that a second call goes on.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from torch import Tensor

from deeplight.contract import LAMP_NUMBERS
from deeplight.estimators.onnx import shipped_model
from deeplight.io.atomic import replacing
from deeplight.training.augment import turn_back
from deeplight.training.data import balanced_order
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator
from deeplight.training.optimiser import MovingAverage
from lab.evidence.frozen_views import FrozenViews
from lab.evidence.some_pixels import SomePixels
from lab.evidence.tuned_bench import COLUMNS, Bench, on_frozen_features
from lab.evidence.tuned_terms import WEIGHTS, direction_loss, mode_loss, steadiness_loss, turn_loss

WARMUP, CLIP = 20, 1.0
LAMP_BIAS = "lamps.head.bias"
GAIN = 0.2
"""ln by which the shipped model's lamps were made brighter after it had learnt (MODEL_CARD.md)."""
HALF = 0.5
MIXED = 0.4  # of Beta(MIXED, MIXED), the share of one of two places whose features are mixed


@dataclass(frozen=True)
class Row:
    """How one network goes on; 0 leaves a term out."""

    direction: float = 0.0
    """Weight of 1 - cos of the angle between main light and that of the spheres' light."""
    mode: float = 0.0
    """Weight of -ln of the share of the (sharpened) light that comes from near the main light."""
    steady: float = 0.0
    """Weight of what differs between the two frames of a pair, turned, exposure taken out."""
    turn: float = 0.0
    """Weight of only the angle between the main lights of the two."""
    decay: float = 0.05
    """Weight decay."""
    dropout: float = 0.3
    """Share of the latent vector that is dropped."""
    features: float = 0.0
    """Share of the features that is dropped."""
    mix: bool = False
    """Mix features of two places, and the losses of both by the same shares."""
    rate: float = 1e-4
    """Learning rate."""
    ema: float = 0.98
    """Decay of the moving average of the weights."""


ROWS = {
    "three spheres alone": Row(),
    "+ steady": Row(steady=0.1),
    "+ direction and steady": Row(direction=0.05, steady=0.1),
    "+ turn": Row(turn=0.1),
    "+ direction": Row(direction=0.05),
    "+ share near it and turn": Row(mode=0.02, turn=0.1),
    "decay 0.5, dropout 0.5, features 0.3": Row(decay=0.5, dropout=0.5, features=0.3),
    "mixed places": Row(mix=True),
    "+ steady, five times": Row(steady=0.5),
    "that decay, direction twice, steady four times": Row(
        direction=0.1, steady=0.4, decay=0.5, dropout=0.5, features=0.3
    ),
}


@dataclass(frozen=True)
class Args:
    """Options of the experiment."""

    data: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Data sets; the first one is validated on."""
    cache: Path = Path("out/tuned_losses")
    """Where features, weights and finished measurements are kept."""
    steps: int = 400
    """Steps of each row."""
    every: int = 100
    """Steps between two measurements."""
    pairs: int = 24
    """Pairs of frames in a step."""
    seed: int = 0
    rows: tuple[str, ...] = tuple(ROWS)
    """Which rows."""


def main(args: Args) -> None:
    """Print the table, row by row."""
    torch.set_num_threads(1)
    network, cache, train, bench, learnt = on_frozen_features(args.data, args.cache)
    print(f"| row, step | {' | '.join(COLUMNS)} |\n|---{'|---' * len(COLUMNS)}|")
    print_row("shipped", bench.measure(network))
    for name in args.rows:
        key = json.dumps(
            [asdict(ROWS[name]), args.steps, args.every, args.pairs, args.seed, learnt]
        )
        folder = cache / "rows" / sha256(key.encode()).hexdigest()[:12]
        for words, numbers in finished(
            name, folder, train, SomePixels(bench.bases), bench, args
        ).items():
            print_row(words, numbers)


def finished(
    name: str, folder: Path, train: FrozenViews, pixels: SomePixels, bench: Bench, args: Args
) -> Mapping[str, Mapping[str, float]]:
    """Measurements of a row by step, from the disk or made now."""
    kept = folder / "numbers.json"
    if kept.is_file():
        return json.loads(kept.read_text())
    folder.mkdir(parents=True, exist_ok=True)
    network, judged = load_network(shipped_model())[0], load_network(shipped_model())[0]
    shipped = {name: value.clone() for name, value in judged.state_dict().items()}
    found = {}
    for step, average in tuned(network, ROWS[name], train, pixels, args):
        halves = {n: torch.lerp(value, average[n], HALF) for n, value in shipped.items()}
        for words, state in ((f"{name}, {step}", average), (f"{name}, {step}, half", halves)):
            judged.load_state_dict(state)
            found[words] = bench.measure(judged)
        torch.save(average, folder / f"{step}.pt")
    with replacing(kept) as temporary:
        temporary.write_text(json.dumps(found))
    return found


def tuned(
    network: Generator, row: Row, train: FrozenViews, pixels: SomePixels, args: Args
) -> Iterator[tuple[int, dict[str, Tensor]]]:
    """The moving average of the weights at every measurement."""
    torch.manual_seed(args.seed)
    random = np.random.default_rng(args.seed)
    network.train().encoder.requires_grad_(False)
    assert network.lamps is not None
    network.lamps.brighten(-GAIN)
    network.dropout.p = row.dropout
    learnt = [p for n, p in network.named_parameters() if p.requires_grad and "heads" not in n]
    optimiser = torch.optim.AdamW(learnt, row.rate, weight_decay=row.decay)
    average = MovingAverage(network, row.ema)
    pairs = train.neighbours()
    places = train.places[pairs[:, 0]]
    groups = [np.flatnonzero(places == place) for place in np.unique(places)]
    for step in range(args.steps):
        for group in optimiser.param_groups:
            group["lr"] = row.rate * min(1.0, (step + 1) / WARMUP)
        drawn = pairs[balanced_order(groups, args.pairs, random)]
        loss = step_loss(network, row, train, pixels, drawn, random)
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(learnt, CLIP)
        optimiser.step()
        average.update(network, step)
        if (step + 1) % args.every == 0:
            yield step + 1, with_gain(average.state)


def with_gain(state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """A copy of the weights with lamps as much brighter as the shipped ones are."""
    copied = {name: value.clone() for name, value in state.items()}
    copied[LAMP_BIAS].view(-1, LAMP_NUMBERS)[:, 3:6] += GAIN
    return copied


def step_loss(
    network: Generator, row: Row, train: FrozenViews, pixels: SomePixels, pairs: np.ndarray,
    random: np.random.Generator,
) -> Tensor:  # fmt: skip
    """The loss of one step on some pairs of frames, first frames first."""
    numbers = pairs.T.ravel()
    # Places are mixed only as they are or only mirrored.
    drawn = random.random(1 if row.mix else len(pairs)) < 0.5
    mirrored = np.tile(np.broadcast_to(drawn, len(pairs)), 2)
    features = torch.from_numpy(train.features[numbers, mirrored.astype(int)].astype(np.float32))
    taken = torch.from_numpy(train.taken[numbers])
    shares: Sequence[tuple[np.ndarray, float]] = ((numbers, 1.0),)
    if row.mix:
        other, share = np.roll(numbers, 1), float(random.beta(MIXED, MIXED))
        features = share * features + (1 - share) * features.roll(1, 0)
        taken = share * taken + (1 - share) * taken.roll(1, 0)
        shares = ((numbers, share), (other, 1 - share))
    if row.features:
        features = torch.nn.functional.dropout(features, row.features)
    light, _ = network.light_from(features, features, taken)
    light = turn_back(light.float(), torch.from_numpy(mirrored))
    total = light.new_zeros(())
    for rows, share in shares:
        total = total + share * pixels.loss(light, train.spheres[rows], WEIGHTS, random)
    true = torch.from_numpy(train.main_light[numbers])
    if row.direction:
        total = total + row.direction * direction_loss(light, true)
    if row.mode:
        total = total + row.mode * mode_loss(light, true)
    poses, gains = (torch.from_numpy(a[pairs]) for a in (train.world_from_camera, train.log_gain))
    if row.turn:
        total = total + row.turn * turn_loss(light, poses)
    if row.steady:
        total = total + row.steady * steadiness_loss(light, poses, gains)
    return total


def print_row(words: str, numbers: Mapping[str, float]) -> None:
    """One line of the table."""
    cells = (f"{numbers[name]:{form}}" for name, form in COLUMNS.items())
    print(f"| {words} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))

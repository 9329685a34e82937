"""Table 1's adversarial rows, long enough for D to move: heads on frozen features, side by side.

    python -m lab.evidence.adversarial_rows data/v1 data/v2

The shipped network's encoder stays as it is, and its features are computed once. On them the
paper's own head (latent layer and decoder, no lamps) learns from nothing, with Adam and the paper's
batches: every row has the same seeds, steps and examples, and another adversarial term.
D, its pictures and its step are the product's. At 5e-4 and as fast as G, D goes in 4,000 steps
two thirds of the way that the paper's (1.5e-6, two million steps) can go. The moving
average of the weights is measured on the first data set's validation places. `detail` is the mean
difference of neighbouring pixels of the mirror over the filmed one's (median), `found out` how
often a D that is new and sees half of the places distinguishes filmed from predicted mirrors in
the other half: 0.5 is chance. What is finished is kept, so that a second call goes on.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from statistics import fmean
from typing import Annotated

import numpy as np
import torch
import tyro
from torch import Tensor

from deeplight.evaluate.scores import rendered_radiance, score
from deeplight.io.atomic import replacing
from deeplight.training import devices
from deeplight.training.adversary import Adversary
from deeplight.training.augment import Inputs, turn_back
from deeplight.training.config import RunConfig, TrainConfig
from deeplight.training.data import balanced_order
from deeplight.training.losses import LossTerms, RigBases
from deeplight.training.network.discriminator import AdversarialConfig, mirror_pictures
from deeplight.training.network.generator import Generator, NetworkConfig
from deeplight.training.optimiser import MovingAverage
from deeplight.training.share import ALONE
from lab.evidence.frozen_views import FrozenViews
from lab.evidence.some_pixels import SomePixels
from lab.evidence.tuned_bench import Bench, on_frozen_features
from lab.evidence.tuned_terms import WEIGHTS

RATE, BATCH, DROPOUT, AVERAGE = 5e-4, 32, 0.3, 0.998
DARKEST = 1e-4
CRITIC_STEPS, CRITIC_BATCH, CRITIC_RATE = 200, 32, 3e-4
FAST = AdversarialConfig(True, learning_rate_factor=1.0, form="non_saturating")
ROWS = {
    "none": AdversarialConfig(),
    "the paper's: 0.001, D at a hundredth of G's rate": AdversarialConfig(True),
    "0.001, D as fast as G": AdversarialConfig(True, learning_rate_factor=1.0),
    **{
        f"{weight:g}, D as fast as G, non-saturating": AdversarialConfig(
            True, 1 - weight, FAST.learning_rate_factor, FAST.form
        )
        for weight in (0.01, 0.001, 0.0001)
    },
}
COLUMNS = {
    "diffuse": ".4f", "silver": ".4f", "mirror": ".4f", "colour, °": ".2f", "detail": ".2f",
    "found out": ".2f", "D right": ".2f",
}  # fmt: skip
"""D right: the row's own D on training examples, mean over the last steps."""


@dataclass(frozen=True)
class Args:
    """Options of the experiment."""

    data: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Data sets; the first one is validated on."""
    cache: Path = Path("out/tuned_losses")
    """Where features and finished measurements are kept, those of `tuned_losses` too."""
    steps: int = 4000
    """Steps of each row."""
    every: int = 1000
    """Steps between two measurements."""
    seeds: tuple[int, ...] = (0, 1)
    rows: tuple[str, ...] = tuple(ROWS)
    """Which rows."""


def main(args: Args) -> None:
    """Print each row of each seed as it is finished, then the means over the seeds."""
    torch.set_num_threads(1)
    network, cache, train, bench, learnt = on_frozen_features(args.data, args.cache)
    print(f"| term, step | {' | '.join(COLUMNS)} |\n|---{'|---' * len(COLUMNS)}|")
    print_row("the shipped network", measured(bench, light_of(bench, network)))
    print_row("the true light", measured(bench, np.log(np.maximum(bench.val.light, DARKEST))))
    found: dict[str, list[Mapping[str, float]]] = {}
    for seed in args.seeds:
        for name in args.rows:
            key = json.dumps([asdict(ROWS[name]), args.steps, args.every, seed, learnt])
            kept = cache / "adversarial" / f"{sha256(key.encode()).hexdigest()[:12]}.json"
            if not kept.is_file():
                numbers = Contest(ROWS[name], train, bench, seed).run(args.steps, args.every)
                kept.parent.mkdir(exist_ok=True)
                with replacing(kept) as temporary:
                    temporary.write_text(json.dumps(numbers))
            for step, numbers in json.loads(kept.read_text()).items():
                found.setdefault(f"{name}, {step}", []).append(numbers)
                print_row(f"{name}, {step}, seed {seed}", numbers)
    for words, seeds in found.items():
        print_row(words, {name: fmean(numbers[name] for numbers in seeds) for name in COLUMNS})


class Contest:
    """One row: a new head, and the product's D where the row has one."""

    def __init__(
        self, term: AdversarialConfig, train: FrozenViews, bench: Bench, seed: int
    ) -> None:
        self.train, self.bench, self.seed = train, bench, seed
        self.bases, self.pixels = RigBases.of([bench.bases]), SomePixels(bench.bases)
        torch.manual_seed(seed)
        self.network = Generator(NetworkConfig(latent_dropout=DROPOUT)).train()
        self.network.encoder = torch.nn.Identity()  # type: ignore[assignment]
        self.optimiser = torch.optim.Adam(self.network.parameters(), RATE, fused=True)
        self.average = MovingAverage(self.network, AVERAGE)
        self.term = term
        self.adversary = adversary(term, self.bases, seed) if term.enabled else None

    def run(self, steps: int, every: int) -> dict[int, dict[str, float]]:
        """What is measured, by step."""
        torch.manual_seed(self.seed)
        random = np.random.default_rng(self.seed)
        places = self.train.places
        groups = [np.flatnonzero(places == place) for place in np.unique(places)]
        found, right = {}, []
        for step in range(steps):
            terms = self.loss(balanced_order(groups, BATCH, random), random)
            self.optimiser.zero_grad()
            terms.total().backward()  # type: ignore[no-untyped-call]
            self.optimiser.step()
            self.average.update(self.network, step)
            if self.adversary is not None:
                about = [float(terms.reported[name]) for name in ("d_real", "d_fake")]
                right.append(fmean(about))
            if (step + 1) % every == 0:
                own = fmean(right[-every // 2 :]) if right else float("nan")
                found[step + 1] = {**self.measured(), "D right": own}
                print(f"# {step + 1} steps", flush=True)
        return found

    def loss(self, numbers: np.ndarray, random: np.random.Generator) -> LossTerms:
        """The terms of one step; D learns on the way."""
        mirrored = random.random(len(numbers)) < 0.5
        features = self.train.features[numbers, mirrored.astype(int)].astype(np.float32)
        taken = torch.from_numpy(self.train.taken[numbers])
        seen = torch.from_numpy(features)
        flipped = torch.from_numpy(mirrored)
        light = turn_back(self.network.light_from(seen, seen, taken)[0], flipped)
        spheres = self.train.spheres[numbers]
        terms = LossTerms({"reconstruction": self.pixels.loss(light, spheres, WEIGHTS, random)}, {})
        if self.adversary is None:
            return terms
        return self.adversary.join(terms, light, filmed(spheres, flipped), RATE)

    def measured(self) -> dict[str, float]:
        """The averaged weights on the validation views."""
        judged = Generator(NetworkConfig()).eval()
        judged.encoder = torch.nn.Identity()  # type: ignore[assignment]
        judged.load_state_dict(self.average.state)
        return measured(self.bench, light_of(self.bench, judged))


def light_of(bench: Bench, network: Generator) -> np.ndarray:
    """ln radiance for every validation view."""
    with torch.no_grad():
        return bench.answers(network, 0)


def measured(bench: Bench, answers: np.ndarray) -> dict[str, float]:
    """Of ln radiance for every validation view, by the names of COLUMNS."""
    scores = score(rendered_radiance(bench.bases, answers), bench.filmed, bench.bases)
    return {
        "diffuse": float(scores.l1["diffuse"].mean()),
        "silver": float(scores.l1["matte_silver"].mean()),
        "mirror": float(scores.l1["mirror"].mean()),
        "colour, °": float(np.nanmean(scores.theta_rgb_deg)),
        "detail": float(np.nanmedian(scores.more["mirror_detail"])),
        "found out": found_out(RigBases.of([bench.bases]), answers, bench.val),
        "D right": float("nan"),
    }


def adversary(term: AdversarialConfig, bases: RigBases, seed: int) -> Adversary:
    """The product's other player, on the processor."""
    run = RunConfig(seed=seed, accelerator="cpu")
    fabric = devices.fabric(run)
    fabric.launch()
    return Adversary(TrainConfig(adversarial=term, run=run), bases, fabric, ALONE)


def filmed(spheres: np.ndarray, flipped: Tensor) -> Inputs:
    """Spheres as D's pictures need them; they do not need the photo."""
    pixels = torch.from_numpy(spheres).flatten(2, 3).transpose(2, 3).float() / 255
    n = len(pixels)
    return Inputs(torch.zeros(n, 3, 1, 1), pixels, torch.zeros(n, dtype=torch.int64), flipped)


def found_out(bases: RigBases, answers: np.ndarray, val: FrozenViews) -> float:
    """How often a new D is right on places that it has not seen, half of them at a time."""
    light = torch.from_numpy(answers).permute(0, 3, 1, 2)
    straight = torch.zeros(len(light), dtype=torch.bool)
    with torch.no_grad():
        real, fake = mirror_pictures(bases, "consistent", light, filmed(val.spheres, straight))
    names = np.unique(val.places)
    halves = [np.isin(val.places, names[part::2]) for part in (0, 1)]
    return fmean(
        critic_right((real[a], fake[a]), (real[b], fake[b])) for a, b in (halves, halves[::-1])
    )


def critic_right(seen: tuple[Tensor, Tensor], unseen: tuple[Tensor, Tensor]) -> float:
    """Share of unseen pictures, filmed and predicted, that a D trained on the seen ones knows."""
    term = AdversarialConfig(True)
    critic = adversary(term, RigBases(torch.zeros(1, 1, 1, 1), torch.zeros(1, 1, 1024)), 0)
    random = np.random.default_rng(0)
    for _ in range(CRITIC_STEPS):
        rows = torch.from_numpy(random.choice(len(seen[0]), CRITIC_BATCH, replace=False))
        critic.teach(seen[0][rows], seen[1][rows], CRITIC_RATE / term.learning_rate_factor)
    with torch.no_grad():
        real, fake = critic.logits(critic.discriminator, *unseen)
    return float(((real > 0).float().mean() + (fake < 0).float().mean()) / 2)


def print_row(words: str, numbers: Mapping[str, float]) -> None:
    """One line of the table."""
    cells = (f"{numbers[name]:{form}}" for name, form in COLUMNS.items())
    print(f"| {words} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))

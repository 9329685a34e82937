"""How well errors of the light could be ordered: by what a take or a place knows, and by boosting.

    python -m lab.evidence.surest_bound data/v1 data/v2

Views of validation and test places, upright, with the shipped network's errors. Each row orders
them another way, and the share of the error that the surer half has is printed, with the rank
correlation. `the take` and `the place` are the mean error of the other frames of the take, of the
other takes in the place: what nobody knows of a photo alone. Boosting reads principal components
of the latent vector and the stated scales; it learns from the errors in all other of these places,
or, of training places, from those of networks that did not see them: heads on the frozen encoder,
each without a fifth of the places. Their disagreement is the last row, and a column of boosting.
"""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from jaxtyping import Float

from deeplight.camera_response import LUMINANCE
from deeplight.contract import HEADS
from deeplight.dataset import open_dataset
from deeplight.estimators.onnx import shipped_model
from deeplight.evaluate.light_metrics import brightest
from deeplight.lighting import LIGHTING_SIZE
from deeplight.mappings import mirror_ball
from deeplight.solve import light_from_spheres
from deeplight.sphere import SPHERES
from deeplight.training.data import balanced_order
from deeplight.training.heads import OF_LIGHT, light_errors
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator, NetworkConfig
from lab.evidence.boosting import Boosted
from lab.evidence.frozen_views import FrozenViews, frozen_views, joined
from lab.evidence.heads_table import ROWS, ordered
from lab.evidence.some_pixels import SomePixels
from lab.evidence.tuned_terms import WEIGHTS

PARTS, STEPS, BATCH, RATE, DROPOUT = 5, 400, 32, 5e-4, 0.3
COMPONENTS, FOLDS, CHUNK = 30, 7, 64
SHARE = mirror_ball.solid_angles(LIGHTING_SIZE) / (4 * np.pi)
LEAST = 1e-3  # of an error or scale


@dataclass(frozen=True)
class Args:
    """Options of the experiment."""

    data: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Data sets; heads learn from the first one's training places."""
    cache: Path = Path("out/tuned_losses")
    """Where features are kept, those of `tuned_losses` too."""
    every: int = 4
    """Of the training views one in this number teaches boosting."""


def main(args: Args) -> None:
    """Print the table."""
    torch.set_num_threads(1)
    network, sets = load_network(shipped_model())[0], [open_dataset(name) for name in args.data]
    cache = args.cache / sha256(shipped_model().read_bytes()).hexdigest()[:8]
    parts = [
        frozen_views(network, data, split, cache) for data in sets for split in ("val", "test")
    ]
    views, train = joined(parts), frozen_views(network, sets[0], "train", cache)
    takes = np.concatenate([np.char.add(f"{n}: ", part.takes) for n, part in enumerate(parts)])
    off = errors(answers(network, views), views.light)
    (rig,) = sets[0].rigs
    bases = sets[0].bases(rig)
    groups = np.unique(train.places, return_inverse=True)[1] % PARTS
    members = [member(train, groups != part, SomePixels(bases), part) for part in range(PARTS)]
    spread = disagreement([answers(own, views) for own in members])
    some = np.arange(0, len(train), args.every)
    unseen = np.concatenate(
        [
            left_out(own, train, some[groups[some] == part], bases)
            for part, own in enumerate(members)
        ]
    )
    chosen = np.concatenate([some[groups[some] == part] for part in range(PARTS)])
    reads = columns(network, views, train, chosen)
    print(
        f"| ordered by | {' | '.join(ROWS[name][0] for name in OF_LIGHT)} |\n|---|---|---|---|---|"
    )
    scales = stated(network, views)
    print_row("the stated scale", off, scales)
    print_row("the take", off, others(off, takes, takes))
    print_row("the place", off, others(off, views.places, takes))
    new, both = reads[0], np.concatenate((reads[0], np.log(spread)), 1)
    print_row("boosting, from errors in other new places", off, by_place(new, off, views.places))
    words = "the same with the ensemble's disagreement"
    print_row(words, off, by_place(both, off, views.places))
    taught = [Boosted.of(reads[1], np.log(np.maximum(own, LEAST)))(new) for own in unseen.T]
    words = "boosting, from errors of networks that did not see the place"
    print_row(words, off, np.exp(np.stack(taught, 1)))
    print_row("disagreement of the ensemble alone", off, spread)


@torch.no_grad()
def answers(network: Generator, views: FrozenViews) -> Float[np.ndarray, "n size size 3"]:
    """Radiance of every photo."""
    found = []
    for rows in np.array_split(np.arange(len(views)), -(-len(views) // CHUNK)):
        features = torch.from_numpy(views.features[rows, 0].astype(np.float32))
        light, _ = network.eval().light_from(
            features, features, torch.from_numpy(views.taken[rows])
        )
        found.append(light.exp().permute(0, 2, 3, 1))
    return np.ascontiguousarray(torch.cat(found).numpy())


def errors(light: np.ndarray, true: np.ndarray) -> Float[np.ndarray, "n 4"]:
    """Of `OF_LIGHT`."""
    return np.array([light_errors(a, b) for a, b in zip(light, true, strict=True)])


@torch.no_grad()
def stated(network: Generator, views: FrozenViews) -> Float[np.ndarray, "n 4"]:
    """What the network says of its errors."""
    assert network.heads is not None
    said = [
        network.heads(torch.from_numpy(views.features[rows, 0].astype(np.float32)))
        for rows in np.array_split(np.arange(len(views)), -(-len(views) // CHUNK))
    ]
    return torch.cat(said)[:, [HEADS.index(name) for name in OF_LIGHT]].numpy().astype(float)


def member(train: FrozenViews, seen: np.ndarray, pixels: SomePixels, seed: int) -> Generator:
    """A new head on the frozen features that learns from some of the places."""
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    head = Generator(NetworkConfig(latent_dropout=DROPOUT)).train()
    head.encoder = torch.nn.Identity()  # type: ignore[assignment]
    optimiser = torch.optim.Adam(head.parameters(), RATE, fused=True)
    names = np.unique(train.places[seen])
    groups = [np.flatnonzero(train.places == name) for name in names]
    for _ in range(STEPS):
        rows = balanced_order(groups, BATCH, random)
        features = torch.from_numpy(train.features[rows, 0].astype(np.float32))
        light, _ = head.light_from(features, features, torch.from_numpy(train.taken[rows]))
        loss = pixels.loss(light, train.spheres[rows], WEIGHTS, random)
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
    print(f"# a head without {len(set(train.places)) - len(names)} places", flush=True)
    return head.eval()


def left_out(own: Generator, train: FrozenViews, rows: np.ndarray, bases: object) -> np.ndarray:
    """Errors of a head in places that it did not see, next to the light of the spheres."""
    part = FrozenViews(**{name: getattr(train, name)[rows] for name in _BY_ROW}, light=train.light)
    spheres = (dict(zip(SPHERES, crops, strict=True)) for crops in part.spheres)
    true = np.stack([light_from_spheres(s, bases).radiance for s in spheres])  # type: ignore[arg-type]
    return errors(answers(own, part), true)


_BY_ROW = (
    "features", "taken", "spheres", "world_from_camera", "log_gain", "main_light", "places", "takes"
)  # fmt: skip


def disagreement(light: list[np.ndarray]) -> Float[np.ndarray, "n 4"]:
    """How far the members' answers lie from their mean, for each error of `OF_LIGHT`."""
    balls = np.stack(light)
    colours = np.einsum("mnijc,ij->mnc", balls, SHARE)
    power = np.log(colours @ LUMINANCE)
    lamps = np.nan_to_num(np.stack([brightest(ball).directions for ball in light]))
    logs = np.log(np.maximum(balls @ LUMINANCE, LEAST))
    found = (
        power.std(0), from_mean(colours), from_mean(lamps),
        np.einsum("nij,ij->n", logs.std(0), SHARE),
    )  # fmt: skip
    return np.maximum(np.stack(found, 1), LEAST)


def from_mean(vectors: Float[np.ndarray, "m n 3"]) -> Float[np.ndarray, " n"]:
    """Mean angle from the mean direction, rad."""
    unit = vectors / np.maximum(np.linalg.norm(vectors, axis=2, keepdims=True), 1e-9)
    mean = unit.mean(0)
    mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
    return np.arccos(np.clip((unit * mean).sum(2), -1, 1)).mean(0)


@torch.no_grad()
def columns(
    network: Generator, views: FrozenViews, train: FrozenViews, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What boosting reads of the views and of some training views: latent components, scales."""
    own = FrozenViews(**{name: getattr(train, name)[rows] for name in _BY_ROW}, light=train.light)
    latent = [
        torch.cat(
            [
                network.latent_of(torch.from_numpy(part.features[r, 0].astype(np.float32)))
                for r in np.array_split(np.arange(len(part)), -(-len(part) // CHUNK))
            ]
        ).numpy()
        for part in (views, own)
    ]
    mean = latent[1].mean(0)
    axes = np.linalg.svd(latent[1] - mean, full_matrices=False)[2][:COMPONENTS].T
    said = [np.log(stated(network, part)) for part in (views, own)]
    new, old = (
        np.concatenate(((x - mean) @ axes, y), 1) for x, y in zip(latent, said, strict=True)
    )
    return new, old


def others(off: np.ndarray, groups: np.ndarray, takes: np.ndarray) -> Float[np.ndarray, "n 4"]:
    """Mean error of the rest of a group: of other frames if it is a take, else of other takes."""
    same = groups[:, None] == groups
    same &= ~np.eye(len(off), dtype=bool) if groups is takes else takes[:, None] != takes
    known = np.isfinite(off)
    counts = same.astype(float) @ known
    with np.errstate(invalid="ignore"):
        return same.astype(float) @ np.where(known, off, 0) / counts


def by_place(reads: np.ndarray, off: np.ndarray, places: np.ndarray) -> Float[np.ndarray, "n 4"]:
    """Each place's errors as boosting expects them from the places in the other folds."""
    fold = np.unique(places, return_inverse=True)[1] % FOLDS
    found = np.empty_like(off)
    for number, own in enumerate(np.log(np.maximum(off, LEAST)).T):
        for part in range(FOLDS):
            found[fold == part, number] = Boosted.of(reads[fold != part], own[fold != part])(
                reads[fold == part]
            )
    return np.exp(found)


def print_row(words: str, off: np.ndarray, scales: np.ndarray) -> None:
    """One line of the table."""
    cells = []
    for error, scale in zip(off.T, scales.T, strict=True):
        known = np.isfinite(error) & np.isfinite(scale)
        cells.append(ordered(error[known], scale[known]))
    print(f"| {words} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))

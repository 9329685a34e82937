"""Whether a less ambitious answer finds a new room's light: left or right, bins, one direction.

    python -m lab.evidence.indoor_lights HDRI WEIGHTS.npz [--views 24]

Views of indoor panoramas, held and exposed as a data set's phones do, and their mirror images, as
the frozen ImageNet encoder has them (mean of each third of the columns, 3 x 320 numbers and their
spread). On that learn, in closed form or in seconds, ridge regressions and small networks; how
strongly they are held back is chosen on the validation rooms, and the way that is best there
answers for the test rooms once. "Another view" is the same answer held against another room's view.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import tyro
from jaxtyping import Float

from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.evaluate.report_tables import interval
from deeplight.evaluate.rivals.crops import ViewPlan, pairs_of
from deeplight.evaluate.rivals.rival import inputs_of
from deeplight.harmonics import dominant_light_of_latlong
from deeplight.simulate.panorama import load, places_in
from deeplight.training.network.imagenet import load_imagenet
from deeplight.training.network.mobilenet_v2 import MobileNetV2Encoder

SIZE = (144, 192)
RIDGES = (1e1, 1e2, 1e3, 1e4, 1e5, 1e6)
BLURS_DEG = (20.0, 45.0, 70.0)
SEEDS, STEPS, EVERY = 5, 400, 20
BINS = np.radians(np.arange(0, 360, 10.0))


@dataclass(frozen=True)
class Args:
    """Options of `python -m lab.evidence.indoor_lights`."""

    hdri: tyro.conf.Positional[Path]
    """Folder of HDR panoramas."""
    weights: tyro.conf.Positional[Path]
    """Folded ImageNet weights."""
    views: int = 24
    """Of each panorama."""


@dataclass(frozen=True, eq=False)
class Views:
    """Views of one split.

    Attributes:
        features: as the encoder has them.
        azimuth: of the main light, right of the view is positive, radians.
        places: of each.
    """

    features: Float[np.ndarray, "n numbers"]
    azimuth: Float[np.ndarray, " n"]
    places: np.ndarray


def views_of(args: Args, split: str, encoder: MobileNetV2Encoder) -> Views:
    """Film the split's rooms and look at them."""
    plan = ViewPlan(SIZE[1], SIZE[0], args.views, elevation_deg=0)
    random = np.random.default_rng(5)
    features, azimuths, names = [], [], []
    for place in places_in(args.hdri):
        if place.split != split or place.scene != "indoor":
            continue
        panorama = load(place)
        towards = dominant_light_of_latlong(panorama)[0].direction.astype(float)
        pairs = list(pairs_of(panorama, plan, random))
        for pair in (*pairs, *(pair.mirror() for pair in pairs)):
            x, _, z = pair.level(towards)
            azimuths.append(np.arctan2(x, -z))
            names.append(place.name)
            features.append(_features(encoder, pair.photo))
    return Views(np.stack(features), np.array(azimuths), np.array(names))


@torch.no_grad()
def _features(encoder: MobileNetV2Encoder, photo: np.ndarray) -> Float[np.ndarray, " numbers"]:
    found = encoder(inputs_of([photo], SIZE))[0].numpy()
    thirds = [part.mean((1, 2)) for part in np.array_split(found, 3, axis=2)]
    return np.concatenate([*thirds, found.std((1, 2))])


def standard(train: Views, other: Views) -> tuple[np.ndarray, np.ndarray]:
    """Features of mean 0 and spread 1 in training rooms."""
    mean, spread = train.features.mean(0), train.features.std(0) + 1e-6
    return (train.features - mean) / spread, (other.features - mean) / spread


def targets(views: Views, blur_deg: float) -> Float[np.ndarray, "n bins"]:
    """Azimuths as a soft bump over bins; 0: as a direction."""
    if not blur_deg:
        return np.stack([np.cos(views.azimuth), np.sin(views.azimuth)], axis=1)
    kappa = 1 / np.radians(blur_deg) ** 2
    bump = np.exp(kappa * (np.cos(BINS - views.azimuth[:, None]) - 1))
    result: np.ndarray = bump / bump.sum(1, keepdims=True)
    return result


def azimuth_of(answer: Float[np.ndarray, "n bins"]) -> Float[np.ndarray, " n"]:
    """Where an answer puts the light."""
    if answer.shape[1] == 2:
        return np.arctan2(answer[:, 1], answer[:, 0])
    return BINS[answer.argmax(1)]


def ridge(train: Views, other: Views, blur_deg: float, held_back: float) -> np.ndarray:
    """Ridge regression's answers for other views."""
    own, theirs = standard(train, other)
    wanted = targets(train, blur_deg)
    middle = wanted.mean(0)
    matrix = own.T @ own + held_back * np.eye(own.shape[1])
    return np.asarray(theirs @ np.linalg.solve(matrix, own.T @ (wanted - middle)) + middle)


def networks(train: Views, other: Views, blur_deg: float, steps: int) -> list[np.ndarray]:
    """Mean answers of small networks with several seeds, after every few steps."""
    own, theirs = (torch.tensor(part).float() for part in standard(train, other))
    wanted = torch.tensor(targets(train, blur_deg)).float()
    sums: dict[int, np.ndarray] = {}
    for seed in range(SEEDS):
        torch.manual_seed(seed)
        layers = (torch.nn.Dropout(0.5), torch.nn.Linear(own.shape[1], 64), torch.nn.ReLU())
        network = torch.nn.Sequential(
            *layers, torch.nn.Dropout(0.5), torch.nn.Linear(64, wanted.shape[1])
        )
        adam = torch.optim.AdamW(network.parameters(), 1e-3, weight_decay=0.3)
        for step in range(1, steps + 1):
            rows = torch.randint(len(own), (256,))
            network.train()
            loss = torch.nn.functional.cross_entropy(network(own[rows]), wanted[rows])
            adam.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            adam.step()
            if step % EVERY == 0:
                with torch.no_grad():
                    found = network.eval()(theirs).softmax(1).numpy()
                sums[step] = sums.get(step, 0) + found
    return [sums[step] for step in sorted(sums)]


def off(found: np.ndarray, views: Views) -> np.ndarray:
    """Degrees between azimuths."""
    return np.degrees(np.abs(np.angle(np.exp(1j * (found - views.azimuth)))))


def shuffled(views: Views) -> np.ndarray:
    """For each view one of another room."""
    random = np.random.default_rng(9)
    return np.array([random.choice(np.flatnonzero(views.places != p)) for p in views.places])


def row(name: str, found: np.ndarray, views: Views) -> None:
    """Print one way's errors."""
    bootstrap = PlaceBootstrap(views.places)
    cells = []
    for azimuth in (found, found[shuffled(views)]):
        error = off(azimuth, views)
        cells.append(interval(bootstrap.median(error), 0))
        cells.append(f"{(error < 45).mean():.0%}")
        right = np.sign(np.sin(azimuth)) == np.sign(np.sin(views.azimuth))
        cells.append(interval(bootstrap.mean(100.0 * right), 0))
    print(f"| {name} | {' | '.join(cells)} |", flush=True)


Way = Callable[[Views], np.ndarray]


def ways_of(train: Views, val: Views) -> list[tuple[str, Way, float]]:
    """Each way with its strength chosen on validation rooms, and its median error there."""
    found: list[tuple[str, Way, float]] = []
    for blur in (0.0, *BLURS_DEG):
        label = f"bump of {blur:.0f}°" if blur else "direction"
        errors = [np.median(off(azimuth_of(ridge(train, val, blur, r)), val)) for r in RIDGES]
        best = RIDGES[int(np.argmin(errors))]

        def by_ridge(other: Views, blur: float = blur, best: float = best) -> np.ndarray:
            return azimuth_of(ridge(train, other, blur, best))

        found.append((f"ridge {best:g}, {label}", by_ridge, float(min(errors))))
    for blur in BLURS_DEG:
        errors = [np.median(off(azimuth_of(a), val)) for a in networks(train, val, blur, STEPS)]
        step = EVERY * (int(np.argmin(errors)) + 1)

        def by_networks(other: Views, blur: float = blur, step: int = step) -> np.ndarray:
            return azimuth_of(networks(train, other, blur, step)[-1])

        name = f"{SEEDS} networks, step {step}, bump of {blur:.0f}°"
        found.append((name, by_networks, float(min(errors))))
    return found


def table(title: str, ways: Sequence[tuple[str, Way, float]], views: Views) -> None:
    """Print ways' errors."""
    print(f"\n{title}, {len(np.unique(views.places))} rooms, {len(views.azimuth)} views:\n")
    head = "azimuth off, ° | under 45° | right side, %"
    print(f"| way | {head} | of another view: {head} |\n|---|---|---|---|---|---|---|")
    for name, way, _ in ways:
        row(name, way(views), views)


def main(args: Args) -> None:
    """Choose on validation rooms, answer for the test rooms once."""
    torch.set_num_threads(1)
    encoder = MobileNetV2Encoder("none")
    load_imagenet(encoder, args.weights)
    encoder.eval()
    train, val, test = (views_of(args, split, encoder) for split in ("train", "val", "test"))
    ways = ways_of(train, val)
    table("Training rooms", ways, train)
    table("Validation rooms", ways, val)
    table("Test rooms", [min(ways, key=lambda way: way[2])], test)


if __name__ == "__main__":
    main(tyro.cli(Args))

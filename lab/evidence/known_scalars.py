"""What a network would gain if it knew a photo's exposure, white balance, tilt and lens.

    deeplight simulate --hdri HDRI --out data/scalars --recipe.phones v2 --recipe.train-takes 12 \\
        --recipe.frames 2 --recipe.eval-takes 24 --recipe.seen-takes 0
    python -m lab.evidence.known_scalars data/scalars

The shipped network stays frozen: its latent vectors and light are computed once and kept. A small
head reads latent vector, scalars and a "known" bit for each scalar, and adds spherical harmonics
to each channel of ln radiance; it starts at nothing. It learns three times from the same data,
seeds and steps: no scalar ever known, each unknown in half of the examples, all always known.
Measured on the validation places. What is finished is kept, so that a second call goes on.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from math import log, tan
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import tyro
from jaxtyping import Float
from torch import Tensor

from deeplight.camera import TRAINED_VERTICAL_FOV_RAD
from deeplight.dataset import SplitIndex, open_dataset
from deeplight.estimators.onnx import shipped_model
from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.evaluate.light_metrics import light_errors
from deeplight.evaluate.scores import rendered_radiance, score
from deeplight.io.atomic import replacing
from deeplight.preprocess import normalise
from deeplight.reflectance import ReflectanceBasis
from deeplight.sphere import SPHERES
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator
from lab.evidence.scalar_head import SCALARS, Head, Views, trained
from lab.evidence.some_pixels import SomePixels

MISSING = {"never known": 1.0, "known in half": 0.5, "always known": 0.0}
"""Share of the examples in which each scalar is unknown while the head learns."""
CHUNK = 96  # photos that the network sees at once
SIGNED = "energy_stops"
METRICS = {
    "l1_diffuse": "diffuse", "l1_matte_silver": "silver", "l1_mirror": "mirror",
    "theta_rgb_deg": "colour, °", "direction_deg": "direction, °",
    "energy_stops_absolute": "brightness off by, stops", SIGNED: "brightness bias, stops",
}  # fmt: skip


@dataclass(frozen=True)
class Args:
    """Options of the experiment."""

    data: Annotated[str, tyro.conf.Positional]
    """Folder of a data set of recipe v2."""
    cache: Path = Path("out/known_scalars")
    """Where latent vectors and finished measurements are kept."""
    steps: int = 300
    """Steps of 64 examples."""
    seeds: int = 3
    """Heads of each kind; errors are averaged over them."""


def main(args: Args) -> None:
    """Print the table."""
    torch.set_num_threads(1)
    data, network = open_dataset(args.data), load_network(shipped_model())[0]
    model = sha256(shipped_model().read_bytes()).hexdigest()[:8]
    cache = args.cache / f"{data.manifest_sha256[:8]}-{model}"
    train, val = (
        views(network, data.index(split), cache / f"{split}.npz") for split in ("train", "val")
    )
    index, (rig,) = data.index("val"), data.rigs
    true = np.stack([index[number].known_lighting for number in range(len(index))])
    bench = Bench(val, data.bases(rig), true)
    errors = {"the shipped network as it is": bench.errors(None, ())}
    for kind, missing in MISSING.items():
        rows = []
        for seed in range(args.seeds):
            kept = cache / f"{args.steps}-{kind.replace(' ', '-')}-{seed}.npz"
            if not kept.is_file():
                head = trained(train, bench.pixels, missing, args.steps, seed)
                save(kept, {words: bench.errors(head, said) for words, said in asked(kind)})
                print(f"{kind}, seed {seed}: done", flush=True)
            rows.append(np.load(kept))
        for words, _ in asked(kind):
            errors[f"{kind}: {words}"] = np.mean([row[words] for row in rows], 0)
    print_table(errors, val.places)


def asked(kind: str) -> list[tuple[str, Sequence[str]]]:
    """What a head is given when it is measured, in words and as names of scalars."""
    every: list[tuple[str, Sequence[str]]] = [("nothing", ()), ("everything", tuple(SCALARS))]
    every += [(name, (name,)) for name in SCALARS]
    return {"never known": every[:1], "known in half": every, "always known": every[1:2]}[kind]


def scalars_of(details: Mapping[str, Any]) -> list[float]:
    """ln exposure (of EV 0), ln red and blue gain over green's, pitch, roll, ln of the tangent."""
    red, _, blue = details["white_balance"]
    wide = tan(details["view_fov_rad"] / 2) / tan(TRAINED_VERTICAL_FOV_RAD / 2)
    tilt = details["pitch_rad"], details["roll_rad"]
    return [-log(2) * details["ev100"], red, blue, *tilt, log(wide)]


def views(network: Generator, index: SplitIndex, cached: Path) -> Views:
    """A split's examples, read and shown to the network once."""
    if not cached.is_file():
        examples = [index[number] for number in range(len(index))]
        photos = np.stack([example.background for example in examples])
        parts = [seen(network, photos[at : at + CHUNK]) for at in range(0, len(photos), CHUNK)]
        latent, light = (torch.cat(part) for part in zip(*parts, strict=True))
        scalars = torch.tensor([scalars_of(example.meta.details) for example in examples])
        spheres = np.stack([[example.spheres[name] for name in SPHERES] for example in examples])
        save(cached, Views(latent, light, scalars, spheres, index.places)._asdict())
    with np.load(cached) as kept:
        latent, light, scalars = (
            torch.from_numpy(kept[name]) for name in ("latent", "light", "scalars")
        )
        return Views(latent, light, scalars, kept["spheres"], kept["places"])


@torch.no_grad()
def seen(network: Generator, backgrounds: np.ndarray) -> tuple[Tensor, Tensor]:
    """Latent vectors and ln radiance of some photos."""
    photo, taken = network.evenly_bright(torch.from_numpy(normalise(backgrounds)))
    features = network.features(photo)
    print(f"{len(photo)} photos read", flush=True)
    return network.latent_of(features), network.light_from(features, photo, taken)[0]


def save(path: Path, arrays: Mapping[str, np.ndarray | Tensor]) -> None:
    """Keep arrays by name."""
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]


class Bench:
    """What all measurements share: views, what was filmed with them, their true light."""

    def __init__(self, val: Views, bases: Mapping[str, ReflectanceBasis], true: np.ndarray) -> None:
        self.val, self.bases, self.true, self.pixels = val, bases, true, SomePixels(bases)

    @torch.no_grad()
    def errors(self, head: Head | None, said: Sequence[str]) -> Float[np.ndarray, "metric n"]:
        """METRICS of every view where the photo states these scalars."""
        answer = self.val.light
        if head is not None:
            known = torch.tensor([name in said for name in SCALARS]).expand(len(answer), -1)
            answer = answer + head.eval()(self.val.latent, self.val.scalars, known)
        light = answer.permute(0, 2, 3, 1).contiguous().numpy()
        pixels = self.val.spheres.astype(np.float32) / np.float32(255)
        filmed = {name: pixels[:, number] for number, name in enumerate(SPHERES)}
        off = light_errors(np.exp(light), self.true)
        columns = score(rendered_radiance(self.bases, light), filmed, self.bases, off).metrics()
        return np.stack([columns[metric] for metric in METRICS])


def print_table(errors: Mapping[str, np.ndarray], places: np.ndarray) -> None:
    """Means, and over those of "never known", with 95 % intervals over places; the bias as is."""
    bootstrap = PlaceBootstrap(places)
    plain = dict(zip(METRICS, errors["never known: nothing"], strict=True))
    print(f"| head, and what is known | {' | '.join(METRICS.values())} |")
    print("|---" * (1 + len(METRICS)) + "|")
    for words, columns in errors.items():
        cells = []
        for metric, values in zip(METRICS, columns, strict=True):
            mean, ratio = bootstrap.mean(values), bootstrap.ratio(values, plain[metric])
            shown = mean if metric == SIGNED else ratio
            text = f"{shown.value:.2f} ({shown.low:.2f} to {shown.high:.2f})"
            cells.append(text if metric == SIGNED else f"{mean.value:.3f}: {text}")
        print(f"| {words} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))

"""What `tuned_losses` measures of a network on frozen views: spheres, direction, steadiness."""

from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float

from deeplight.dataset import open_dataset
from deeplight.estimators.onnx import shipped_model
from deeplight.evaluate.light_metrics import Brightest, brightest, mean_radiance
from deeplight.evaluate.scores import rendered_radiance, score
from deeplight.harmonics import dominant_light
from deeplight.lighting import Lighting
from deeplight.reflectance import ReflectanceBasis
from deeplight.sphere import SPHERES
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator
from lab.evidence.frozen_views import FrozenViews, frozen_views, joined
from lab.evidence.tuned_terms import WEIGHTS

CHUNK = 64
STEP_DEG = 5.0
"""Turn of the camera that the main light's jump is given for."""
COLUMNS = {
    "diffuse": ".4f", "silver": ".4f", "mirror": ".4f", "score": ".4f", "direction, °": ".1f",
    "mean direction, °": ".1f", "strays, °": ".0f", "flip, °": ".1f", "jump per 5°, °": ".2f",
    "share": ".2f", "colour, °": ".2f", "stops": "+.2f",
}  # fmt: skip
"""Score: 0.3 mirror, 0.3 silver, 0.4 diffuse. Strays: from its own mean direction."""


class Bench:
    """Validation views, what was filmed with them, their true light."""

    def __init__(self, val: FrozenViews, bases: Mapping[str, ReflectanceBasis]) -> None:
        pixels = val.spheres.astype(np.float32) / np.float32(255)
        self.filmed = {name: pixels[:, number] for number, name in enumerate(SPHERES)}
        self.val, self.bases, self.true = val, bases, brightest(val.light)
        self.pairs = val.neighbours()

    @torch.no_grad()
    def measure(self, network: Generator) -> dict[str, float]:
        """A network's numbers by the names of COLUMNS."""
        network.eval()
        plain, mirrored = self.answers(network, 0), self.answers(network, 1)[:, :, ::-1]
        light = np.exp(plain)
        own, back = brightest(light), brightest(np.exp(mirrored))
        scores = score(rendered_radiance(self.bases, plain), self.filmed, self.bases)
        l1 = [float(scores.l1[name].mean()) for name in SPHERES]
        off = own.degrees_from(self.true)
        shares = [dominant_light(Lighting(ball)).share for ball in light]
        bias = np.log2(mean_radiance(light) / mean_radiance(self.val.light))
        jump, turn = self.jumps(own)
        values = [
            *reversed(l1), float(np.dot(l1, WEIGHTS)), np.nanmedian(off), np.nanmean(off),
            np.nanmedian(strays(own)), np.nanmedian(own.degrees_from(back)),
            np.nanmedian(jump / turn) * STEP_DEG, np.median(shares),
            np.nanmean(scores.theta_rgb_deg), np.median(bias),
        ]  # fmt: skip
        return dict(zip(COLUMNS, map(float, values), strict=True))

    def answers(self, network: Generator, mirrored: int) -> Float[np.ndarray, "n size size 3"]:
        """ln radiance for every photo, or for its mirror image."""
        found = []
        for rows in np.array_split(np.arange(len(self.val)), -(-len(self.val) // CHUNK)):
            features = torch.from_numpy(self.val.features[rows, mirrored].astype(np.float32))
            taken = torch.from_numpy(self.val.taken[rows])
            found.append(network.light_from(features, features, taken)[0].permute(0, 2, 3, 1))
        return np.ascontiguousarray(torch.cat(found).numpy())

    def jumps(self, own: Brightest) -> tuple[np.ndarray, np.ndarray]:
        """Degrees between the main lights of neighbouring frames, in the world, and those between
        the cameras."""
        poses = self.val.world_from_camera.astype(np.float64)[self.pairs]
        world = np.einsum("npij,npj->npi", poses, own.directions[self.pairs])
        turn = np.einsum("nij,nij->n", poses[:, 0], poses[:, 1])  # trace of R1^T R2
        return angle((world[:, 0] * world[:, 1]).sum(1)), angle((turn - 1) / 2)


def strays(own: Brightest) -> Float[np.ndarray, " n"]:
    """Degrees of each main light from the mean direction of all, camera frame."""
    mean = np.nanmean(own.directions, 0)
    return angle(own.directions @ (mean / np.linalg.norm(mean)))


def angle(cosine: np.ndarray) -> np.ndarray:
    """In degrees."""
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


class OnFrozenFeatures(NamedTuple):
    """What heads learn from and are measured on while the shipped encoder stays as it is.

    Attributes:
        network: the shipped one.
        cache: folder of what was made with this network.
        train: training views of all data sets.
        bench: validation views of the first.
        learnt: hashes of the data sets.
    """

    network: Generator
    cache: Path
    train: FrozenViews
    bench: Bench
    learnt: list[str]


def on_frozen_features(data: Sequence[str], cache: Path) -> OnFrozenFeatures:
    """Open data sets and compute the features of their photos, or find them in the cache."""
    network, sets = load_network(shipped_model())[0], [open_dataset(name) for name in data]
    own = cache / sha256(shipped_model().read_bytes()).hexdigest()[:8]
    train = joined([frozen_views(network, part, "train", own) for part in sets])
    (rig,) = sets[0].rigs
    bench = Bench(frozen_views(network, sets[0], "val", own), sets[0].bases(rig))
    return OnFrozenFeatures(network, own, train, bench, [part.manifest_sha256 for part in sets])

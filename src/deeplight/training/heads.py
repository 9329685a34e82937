"""Teach a trained network's heads what camera took a photo and how far off its light is.

The network stays as it is: its features of some training photos are computed once, and a small
branch learns on them. The light it is compared with is what explains the 8-bit spheres, so no
HDR enters. On places that it learnt from a network errs less than elsewhere; so every scale is
then stretched until it should hold 68 % of the errors in new places, by those of validation places
next to the true light.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from deeplight.camera_response import LUMINANCE
from deeplight.contract import HEADS
from deeplight.dataset import SplitIndex, open_dataset
from deeplight.harmonics import dominant_light
from deeplight.lighting import LIGHTING_SIZE, Lighting
from deeplight.mappings import mirror_ball
from deeplight.preprocess import frame_photo, network_input, normalise
from deeplight.solve import light_from_spheres
from deeplight.training.data import balanced_order
from deeplight.training.indoors import learn_indoors
from deeplight.training.network.generator import Generator
from deeplight.training.network.heads import Heads, averages

WITHIN = 0.68
"""Share of the errors that a scale is to hold."""
CAMERA = ("fov_rad", "pitch_rad", "roll_rad")
BY_TAKE = ("colour_scale",)
"""Scales of errors that are alike in one take, whatever the place: of the light's colour a photo
shows next to nothing, so its error is the white balance's, and every take has its own."""
OF_LIGHT = ("brightness_scale", "colour_scale", "direction_scale", "log_radiance_scale")
TURNS = tuple(name for name in HEADS if name.startswith("upright_"))
TURNED = 0.35
"""Share of the photos that are turned to learn which way is up."""
SCALES = (*(name.replace("_rad", "_scale") for name in CAMERA), *OF_LIGHT)
DIMMEST = 1e-3
CHUNK = 32
STEPS, BATCH, LEARNING_RATE, WEIGHT_DECAY, DROPOUT = 600, 128, 1e-3, 0.1, 0.5


@dataclass(frozen=True, eq=False)
class Views:
    """Photos as averaged features, and what is to be said of them; NaN where nothing is known."""

    averaged: Float[Tensor, "n averages"]
    camera: Float[Tensor, "n 3"]
    """Of CAMERA."""
    errors: Float[Tensor, "n 4"]
    """Of OF_LIGHT: how far off the network's light is."""
    turns: Float[Tensor, "n"]
    """Quarter turns clockwise that make the photo upright."""
    indoors: Float[Tensor, "n"]
    """1 in a room, 0 outdoors."""
    places: np.ndarray
    takes: np.ndarray
    """Names that no other data set has."""


def teach(
    network: Generator, data: Sequence[str], count: int = 1600, seed: int = 0
) -> tuple[Heads, Views]:
    """Heads for a network without batch norm, and the validation views that set their scales.

    Args:
        network: in evaluation mode.
        data: data sets; they share out `count` training photos and half as many for validation.
        seed: of the choice, the turns and the first weights.

    Raises:
        DataSetError: one of them cannot be read, or has no training or validation split.
    """
    each = -(-count // len(data))
    learnt = joined([views_of(network, name, "train", each, seed) for name in data])
    heads = fitted(learnt, network, seed)
    learn_indoors(heads, learnt.averaged, learnt.indoors, learnt.places)
    return heads, set_scales(network, heads, data, count // 2, seed)


def set_scales(
    network: Generator, heads: Heads, data: Sequence[str], count: int = 800, seed: int = 0
) -> Views:
    """Stretch the scales of heads by `count` validation photos of some data sets; gives these.

    Raises:
        DataSetError: one of them cannot be read, or has no validation split.
    """
    each = -(-count // len(data))
    kept = joined([views_of(network, name, "val", each, seed) for name in data])
    calibrate(heads, kept)
    return kept


def set_indoors(
    network: Generator, heads: Heads, data: Sequence[str], count: int = 3200, seed: int = 0
) -> None:
    """Teach heads anew, by `count` training photos, whether a photo was taken in a room.

    Raises:
        DataSetError: one of the data sets cannot be read, or has no training split.
    """
    each = -(-count // len(data))
    learnt = joined([views_of(network, name, "train", each, seed) for name in data])
    learn_indoors(heads, learnt.averaged, learnt.indoors, learnt.places)


def views_of(network: Generator, address: str, split: str, count: int, seed: int) -> Views:
    """Some examples of a split, drawn at random, some of them turned."""
    data = open_dataset(address)
    index, random = data.index(split), np.random.default_rng(seed)
    numbers = np.sort(random.permutation(len(index))[:count])
    turns = np.where(random.random(len(numbers)) < TURNED, random.integers(1, 4, len(numbers)), 0)
    averaged, camera, errors, indoors = [], [], [], []
    for chunk in np.array_split(np.arange(len(numbers)), max(1, len(numbers) // CHUNK)):
        some, turned = numbers[chunk], turns[chunk]
        features, light = answers(network, index, some, turned)
        averaged.append(averages(features))
        for number, turn, radiance in zip(some, turned, light, strict=True):
            meta = index[int(number)].meta
            camera.append(camera_of(meta.details, bool(turn)))
            indoors.append(math.nan if turn else float(meta.scene == "indoor"))
            errors.append(
                [math.nan] * 4 if turn else light_errors(radiance, truth(data, index, int(number)))
            )
    return Views(
        torch.cat(averaged),
        torch.tensor(camera),
        torch.tensor(errors, dtype=torch.float32),
        torch.tensor(turns, dtype=torch.float32),
        torch.tensor(indoors),
        index.places[numbers],
        np.char.add(f"{address}: ", index.takes[numbers]),
    )


@torch.no_grad()
def answers(
    network: Generator, index: SplitIndex, numbers: np.ndarray, turns: np.ndarray
) -> tuple[Tensor, np.ndarray]:
    """Features of the photos, and the network's radiance (n, size, size, 3)."""
    shown = [turned(index.pixels(int(n))[0], int(t)) for n, t in zip(numbers, turns, strict=True)]
    photo, taken = network.evenly_bright(torch.from_numpy(np.stack(shown)))
    features = network.features(photo)
    log_radiance, _ = network.light_from(features, photo, taken)
    return features, log_radiance.exp().permute(0, 2, 3, 1).numpy()


def turned(background: np.ndarray, quarters: int) -> Float[np.ndarray, "3 height width"]:
    """The network's input from a background that lies on its side or head: this many quarter
    turns clockwise would make it upright. Without EXIF data a photo on its side is taken as it
    lies."""
    if quarters == 0:
        return normalise(background[None])[0]
    photo = np.ascontiguousarray(np.rot90(background, quarters))
    if quarters == 2:
        return normalise(photo[None])[0]
    return network_input(photo, frame_photo(*photo.shape[:2]))


def camera_of(details: Any, is_turned: bool) -> list[float]:
    """What CAMERA names. A field of view that the photo states needs no guess."""
    if is_turned or "pitch_rad" not in details:
        return [math.nan] * 3
    fov = math.nan if details["fov_known"] else details["view_fov_rad"]
    return [fov, details["pitch_rad"], details["roll_rad"]]


def truth(data: Any, index: SplitIndex, number: int) -> Float[np.ndarray, "size size 3"]:
    """The light of an example: the true one where it has it, else what explains its spheres by the
    data set's own bases."""
    example = index[number]
    if example.true_lighting is not None:
        return example.true_lighting
    bases = data.bases(example.meta.rig, LIGHTING_SIZE)
    return light_from_spheres(example.spheres, bases).radiance


def light_errors(
    estimated: Float[np.ndarray, "size size 3"], true: Float[np.ndarray, "size size 3"]
) -> list[float]:
    """Errors in the order of OF_LIGHT; NaN for the direction where no main light stands out."""
    share = mirror_ball.solid_angles(len(true)) / (4 * pi)
    colours = [np.einsum("ijc,ij->c", light, share) for light in (estimated, true)]
    powers = [colour @ LUMINANCE for colour in colours]
    lights = [dominant_light(Lighting(light.astype(np.float32))) for light in (estimated, true)]
    logs = [np.log(np.maximum(light @ LUMINANCE, DIMMEST)) for light in (estimated, true)]
    faint = min(light.share for light in lights) < 0.01
    return [
        abs(math.log(powers[0] / powers[1])),
        angle(*colours),
        math.nan if faint else angle(*(light.direction for light in lights)),
        float((abs(logs[0] - logs[1]) * share).sum()),
    ]


def angle(one: np.ndarray, other: np.ndarray) -> float:
    """Between two directions, in rad."""
    cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.arccos(np.clip(cosine, -1, 1)))


def joined(parts: Sequence[Views]) -> Views:
    """All views together."""
    return Views(
        torch.cat([part.averaged for part in parts]),
        torch.cat([part.camera for part in parts]),
        torch.cat([part.errors for part in parts]),
        torch.cat([part.turns for part in parts]),
        torch.cat([part.indoors for part in parts]),
        np.concatenate([part.places for part in parts]),
        np.concatenate([part.takes for part in parts]),
    )


def fitted(views: Views, network: Generator, seed: int = 0) -> Heads:
    """Heads that learnt from these views, every place as often as the others."""
    torch.manual_seed(seed)
    rows, columns = network.feature_size
    heads = Heads(views.averaged.shape[1] // (rows + columns), rows, columns)
    mean, spread = views.averaged.mean(0), views.averaged.std(0) + 0.1
    known = (views.averaged - mean) / spread
    start(heads, views)
    dropout = nn.Dropout(DROPOUT)
    optimiser = torch.optim.AdamW(heads.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    for step, batch in enumerate(batches(views.places, seed)):
        for group in optimiser.param_groups:
            group["lr"] = LEARNING_RATE * (1 - step / STEPS)
        said = heads.read(dropout(known[batch]))
        loss = mistakes(said, views, batch)
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
    with torch.no_grad():  # the network gives features as they are
        heads.inner.weight.div_(spread)
        heads.inner.bias.sub_(heads.inner.weight @ mean)
    return heads.eval()


@torch.no_grad()
def start(heads: Heads, views: Views) -> None:
    """Every number begins with its middle value, every scale with the middle error."""
    heads.outer.weight.mul_(0.3)
    bias = heads.outer.bias.zero_()
    for number, name in enumerate(CAMERA):
        middle = views.camera[:, number].nanmedian()
        if middle.isfinite():
            bias[HEADS.index(name)] = middle
            off = (views.camera[:, number] - middle).abs().nanmedian().clamp_min(1e-2)
            bias[HEADS.index(name.replace("_rad", "_scale"))] = off.log()
    for number, name in enumerate(OF_LIGHT):
        bias[HEADS.index(name)] = views.errors[:, number].nanmedian().clamp_min(1e-2).log()


def batches(places: np.ndarray, seed: int) -> Iterator[np.ndarray]:
    """Numbers of the views of each step."""
    random = np.random.default_rng(seed)
    groups = [np.flatnonzero(places == place) for place in np.unique(places)]
    for _ in range(STEPS):
        yield balanced_order(groups, BATCH, random)


def mistakes(said: Tensor, views: Views, batch: np.ndarray) -> Tensor:
    """Negative ln likelihood: Laplace's of numbers and of errors, the chances' cross entropy."""
    loss = -torch.log(
        said[:, HEADS.index(TURNS[0]) :][:, : len(TURNS)]
        .gather(1, views.turns[batch].long()[:, None])
        .clamp_min(1e-6)
    ).mean()
    for off, scale in zip(*errors_and_scales(said, views, batch), strict=True):
        is_known = off.isfinite()
        if is_known.any():  # chosen first: 0 times an unknown error would be a gradient of NaN
            off, scale = off[is_known], scale[is_known]
            loss = loss + (torch.log(scale) + off / scale).mean()
    return loss


def errors_and_scales(
    said: Tensor, views: Views, batch: np.ndarray
) -> tuple[list[Tensor], list[Tensor]]:
    """How far off each number and the light are, and how far the heads say, by scale."""
    off = [
        distance(said[:, HEADS.index(name)], views.camera[batch, number])
        for number, name in enumerate(CAMERA)
    ]
    off += list(views.errors[batch].T)
    return off, [said[:, HEADS.index(name)] for name in SCALES]


def distance(said: Tensor, true: Tensor) -> Tensor:
    """|said - true|, NaN where the truth is not known, without a gradient of NaN there."""
    is_known = true.isfinite()
    off = (said - torch.where(is_known, true, 0.0)).abs()
    return torch.where(is_known, off, math.nan)


@torch.no_grad()
def calibrate(heads: Heads, views: Views) -> None:
    """Stretch every scale until `WITHIN` of the errors in places that are like these are below it.

    Views of a place err alike, so n places say little more than n numbers: what is below the
    largest of n is below it of a new place with a chance of n / (n + 1) (conformal prediction, Vovk
    et al. 2005). The scales hold (n + 1) / n as many of these views' errors. Of those `BY_TAKE`
    names, n is the number of takes.
    """
    said, whole = heads.read(views.averaged), np.arange(len(views.turns))
    for name, off, scale in zip(SCALES, *errors_and_scales(said, views, whole), strict=True):
        is_known = off.isfinite()
        if is_known.any():
            alike = views.takes if name in BY_TAKE else views.places
            count = len(np.unique(alike))
            hold = min(1.0, WITHIN * (count + 1) / count)
            stretch = torch.quantile((off / scale)[is_known], hold).clamp_min(1e-3)
            heads.outer.bias[HEADS.index(name)] += stretch.log()


@dataclass(frozen=True)
class Kept:
    """How well one head keeps what it says."""

    error: float
    """Mean absolute error."""
    plain: float
    """Of the best fixed number instead; of a scale the same as `error`."""
    within: float
    """Share of the errors that are below the scale."""
    surest: float
    """Mean error of the half that is said to be surest, as a share of the mean error."""
    ranked: float
    """Rank correlation of scales and errors."""


@torch.no_grad()
def measured(heads: Heads, views: Views) -> dict[str, Kept]:
    """How well every scale is kept on some views, by its name."""
    said, whole = heads.read(views.averaged), np.arange(len(views.turns))
    found = {}
    for number, (name, off, scale) in enumerate(
        zip(SCALES, *errors_and_scales(said, views, whole), strict=True)
    ):
        is_known = off.isfinite()
        off, scale = off[is_known], scale[is_known]
        if not len(off):
            continue
        plain = off.mean()
        if number < len(CAMERA):
            true = views.camera[is_known, number]
            plain = (true - true.median()).abs().mean()
        surest = off[scale <= scale.median()].mean() / off.mean()
        share = (off <= scale).float().mean()
        ranks = torch.stack((off, scale)).argsort(1).argsort(1).float()
        numbers = off.mean(), plain, share, surest, torch.corrcoef(ranks)[0, 1]
        found[name] = Kept(*(float(number) for number in numbers))
    return found


@torch.no_grad()
def share_upright(heads: Heads, views: Views) -> float:
    """Share of the views of which the heads say how to turn them."""
    first = HEADS.index(TURNS[0])
    chances = heads.read(views.averaged)[:, first : first + len(TURNS)]
    return float((chances.argmax(1) == views.turns.long()).float().mean())

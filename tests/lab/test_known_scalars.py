"""What a head makes of scalars that are known or not, and what it learns from them."""

import numpy as np
import pytest
import torch

from deeplight.camera import TRAINED_VERTICAL_FOV_RAD
from deeplight.reflectance import rig_bases
from deeplight.sphere import PAPER_RIG, SPHERES
from lab.evidence.known_scalars import Bench, scalars_of
from lab.evidence.scalar_head import MEMBERS, SCALARS, Head, Views, trained
from lab.evidence.some_pixels import SomePixels

LIGHT, PHOTOS = 16, 48
BASES = rig_bases(PAPER_RIG, LIGHT)
SAID = torch.eye(len(SCALARS), dtype=torch.bool)
NONE, ALL = torch.zeros_like(SAID), torch.ones_like(SAID)
DETAILS = {
    "ev100": 8.0, "white_balance": [0.3, 0.0, -0.2], "pitch_rad": -0.5, "roll_rad": 0.1,
    "view_fov_rad": TRAINED_VERTICAL_FOV_RAD,
}  # fmt: skip


def head(opened: bool) -> Head:
    torch.manual_seed(0)
    made = Head(8, torch.randn(20, MEMBERS.shape[1]), LIGHT).eval()
    if opened:  # the twin: one that has learnt something
        torch.nn.init.normal_(made.outer.weight)
    return made


@pytest.mark.parametrize("opened", [False, True])
def test_before_it_learns_a_head_adds_nothing(opened: bool) -> None:
    latent, scalars = torch.randn(5, 8), torch.randn(5, MEMBERS.shape[1])
    for known in (NONE, SAID, ALL):
        assert bool(head(opened)(latent, scalars, known).any()) == opened


def test_a_scalar_is_read_where_its_bit_says_so_and_nowhere_else() -> None:
    latent, scalars = torch.randn(5, 8), torch.randn(5, MEMBERS.shape[1])
    before = head(True)(latent, scalars, SAID)
    for number, members in enumerate(MEMBERS.bool()):
        for member in members.nonzero()[:, 0]:
            other = scalars.clone()
            other[:, member] = torch.nan
            after = head(True)(latent, other, SAID)
            same = [torch.equal(a, b) for a, b in zip(before, after, strict=True)]
            assert same == [row != number for row in range(len(SCALARS))]


def test_scalars_are_those_of_the_example() -> None:
    plain = scalars_of(DETAILS)
    assert plain[1:] == [0.3, -0.2, -0.5, 0.1, 0.0]
    darker = scalars_of({**DETAILS, "ev100": 7.0})  # a stop more exposure in a darker place
    assert darker[0] - plain[0] == pytest.approx(np.log(2))
    assert scalars_of({**DETAILS, "view_fov_rad": 1.3})[5] > 0


def toy_views() -> Views:
    """Places whose light is brighter than the network says, by what the exposure says."""
    random = np.random.default_rng(0)
    scalars = random.normal(0, 0.5, (PHOTOS, MEMBERS.shape[1]))
    gain = np.exp(scalars[:, 0])
    spheres = []
    for number in range(PHOTOS):
        light = np.full((LIGHT * LIGHT, 3), 0.2 * gain[number])
        shown = [(BASES[name].weights @ light).clip(0, 1) ** (1 / 2.2) for name in SPHERES]
        size = BASES["mirror"].view.size
        spheres.append([np.round(s.reshape(size, size, 3) * 255).astype(np.uint8) for s in shown])
    return Views(
        torch.zeros(PHOTOS, 4), torch.full((PHOTOS, 3, LIGHT, LIGHT), float(np.log(0.2))),
        torch.tensor(scalars, dtype=torch.float32), np.array(spheres),
        np.arange(PHOTOS).astype(str),
    )  # fmt: skip


def test_only_what_is_known_is_learnt_from() -> None:
    views, pixels = toy_views(), SomePixels(BASES)
    gain = views.scalars[:, :1, None, None]
    true = (views.light.permute(0, 2, 3, 1) + gain).exp().numpy()
    bench = Bench(views, BASES, true)
    start = bench.errors(None, ())
    found = {missing: trained(views, pixels, missing, 120, 0) for missing in (0.0, 1.0)}
    left = bench.errors(found[0.0], tuple(SCALARS)).mean(1)[0] / start.mean(1)[0]
    blind = bench.errors(found[1.0], ()).mean(1)[0] / start.mean(1)[0]
    assert left < 0.7 < blind

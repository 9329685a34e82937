"""The loss renders what the numpy nouns render."""

import numpy as np
import pytest
import torch

from deeplight.lighting import Lighting
from deeplight.relight import relight_rig
from deeplight.sphere import PAPER_RIG, SPHERES
from deeplight.training.losses import RigBases


@pytest.fixture(scope="module")
def bases():
    return RigBases.from_rigs([PAPER_RIG])


def difference(bases, q, lighting):
    """Largest relative difference of torch's renderings of q from numpy's of `lighting`."""
    rendered = bases.render(
        torch.from_numpy(q.transpose(2, 0, 1).copy())[None], torch.zeros(1, dtype=torch.int64)
    )
    expected = relight_rig(PAPER_RIG, lighting)
    return max(
        np.abs(rendered[0, i].T.reshape(32, 32, 3).numpy() - expected[name]).max()
        / expected[name].max()
        for i, name in enumerate(SPHERES)
    )


def test_torch_renders_what_numpy_renders(bases):
    q = np.random.default_rng(0).normal(-1, 1.5, (32, 32, 3)).astype(np.float32)
    assert difference(bases, q, Lighting.from_log_radiance(q)) < 1e-5
    brighter = q.copy()
    brighter[20, 16] += 1.0
    assert difference(bases, q, Lighting.from_log_radiance(brighter)) > 1e-3


def test_masks_are_the_views_masks(bases):
    masks = bases.masks(torch.zeros(1, dtype=torch.int64))
    for i, name in enumerate(SPHERES):
        expected = PAPER_RIG.views[name].mask()
        np.testing.assert_array_equal(masks[0, i, 0].numpy().reshape(32, 32) > 0, expected)

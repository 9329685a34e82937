"""The constant lighting is the best constant answer."""

import numpy as np
import torch

from deeplight.camera_response import CameraResponse
from deeplight.training.constant import fit_log_radiance
from deeplight.training.losses import LossConfig, RigBases


def toy_bases():
    """Two rigs of three 2 x 2 'spheres', each pixel lit by one of four lights."""
    basis = torch.eye(4).expand(2, 3, 4, 4) * torch.tensor([0.8, 0.6, 0.3])[None, :, None, None]
    return RigBases(basis, torch.ones(2, 3, 4))


def filmed(radiance):
    """Bytes (3, 2, 2, 3) of the toy spheres under grey light (4,)."""
    linear = np.array([0.8, 0.6, 0.3])[:, None] * radiance
    pixels = CameraResponse().pixel_from_radiance(np.repeat(linear[..., None], 3, -1))
    return torch.from_numpy(np.round(pixels * 255).astype(np.uint8)).reshape(3, 2, 2, 3)


def test_one_lighting_is_found_again_even_where_the_mirror_is_clipped():
    radiance = np.array([0.1, 0.5, 1.0, 2.5])  # the last clips mirror and matte silver
    spheres = torch.stack([filmed(radiance)] * 6)
    q = fit_log_radiance(toy_bases(), spheres, torch.tensor([0, 1, 0, 1, 0, 1]), LossConfig())
    np.testing.assert_allclose(np.exp(q).mean(0).ravel(), radiance, rtol=0.03)


def test_of_several_lightings_the_median_is_best():
    """L1 is least at the median: of 0.1, 0.2, 0.2, 0.2, 0.9 that is 0.2, not the mean."""
    spheres = torch.stack([filmed(np.full(4, level)) for level in (0.1, 0.2, 0.2, 0.2, 0.9)])
    q = fit_log_radiance(toy_bases(), spheres, torch.zeros(5).long(), LossConfig())
    np.testing.assert_allclose(np.exp(q), 0.2, rtol=0.05)

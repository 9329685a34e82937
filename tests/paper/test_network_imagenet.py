"""The imported ImageNet weights compute what they computed where they came from."""

import numpy as np
import pytest
import torch
from torch.nn import functional

from deeplight.errors import ModelError
from deeplight.training.network.imagenet import load_imagenet, output_moments, read_folded
from deeplight.training.network.mobilenet_v2 import MobileNetV2Encoder

FILE = "mobilenet_v2_imagenet_folded.npz"


@pytest.fixture(scope="module")
def path(shared):
    found = shared / "weights" / FILE
    if not found.exists():
        pytest.skip(f"needs ../shared/weights/{FILE}")
    return found


@pytest.fixture(scope="module")
def photos():
    """Smooth random pictures: blurred noise at the scale of things."""
    generator = torch.Generator().manual_seed(0)
    coarse = torch.rand(12, 3, 12, 9, generator=generator)
    return functional.interpolate(coarse, (192, 135), mode="bicubic").clamp(0, 1) - 0.5


@pytest.fixture(scope="module")
def folded(path):
    encoder = MobileNetV2Encoder("none").eval()
    load_imagenet(encoder, path)
    return encoder


def test_the_stem_sees_photos_in_the_range_it_was_trained_on(path, folded, photos):
    arrays = read_folded(path)
    weight, bias = (
        torch.from_numpy(arrays[f"features.0.conv.{p}"]).float() for p in ("weight", "bias")
    )
    padded = functional.pad(photos, (1, 1, 0, 1)) * 2  # [-1, 1]; SAME padding of 192 x 135
    expected = functional.conv2d(padded, weight, bias, stride=2).clamp(0, 6)
    with torch.no_grad():
        torch.testing.assert_close(folded.features[0](photos), expected, atol=1e-4, rtol=1e-4)


def test_activations_have_the_size_that_batch_norm_gave_them(folded, photos):
    """Trained batch norms hand on values of order 1; a wrong layer order or padding breaks that."""
    deviations = [
        variance.mean().sqrt().item() for _, variance in output_moments(folded, photos).values()
    ]
    assert len(deviations) == 48
    assert 0.3 < np.median(deviations) < 3.0
    assert max(deviations) < 20.0


def test_batch_norm_put_back_changes_nothing(path, folded, photos):
    encoder = MobileNetV2Encoder("batch")
    load_imagenet(encoder, path, photos)
    encoder.eval()
    with torch.no_grad():
        torch.testing.assert_close(encoder(photos), folded(photos), atol=2e-3, rtol=1e-3)
        encoder.train()  # the batch is what it was calibrated on
        torch.testing.assert_close(encoder(photos), folded(photos), atol=0.05, rtol=0.02)
        encoder.eval()
        encoder.features[5].project.norm.running_mean.add_(0.3)  # the twin that must fail
        assert (encoder(photos) - folded(photos)).abs().max() > 0.05


def test_the_calibrated_norm_holds_the_statistics_of_the_photos(path, folded, photos):
    """So that a first training batch of such photos is normalised as in evaluation."""
    encoder = MobileNetV2Encoder("batch")
    load_imagenet(encoder, path, photos)
    found, expected = output_moments(encoder.eval(), photos), output_moments(folded, photos)
    for name, (mean, variance) in expected.items():
        torch.testing.assert_close(found[name][0], mean, atol=0.02, rtol=0.02)
        torch.testing.assert_close(found[name][1], variance, atol=0.02, rtol=0.05)


def test_batch_norm_needs_photos(path):
    with pytest.raises(ModelError, match="photos"):
        load_imagenet(MobileNetV2Encoder("batch"), path)


def test_a_file_without_the_layers_is_refused(tmp_path):
    np.savez(tmp_path / "w.npz", other=np.zeros(3))
    with pytest.raises(ModelError, match=r"features\.0"):
        load_imagenet(MobileNetV2Encoder("none"), tmp_path / "w.npz")
    (tmp_path / "broken.npz").write_bytes(b"PK nothing")
    with pytest.raises(ModelError):
        load_imagenet(MobileNetV2Encoder("none"), tmp_path / "broken.npz")

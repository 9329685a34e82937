"""Smaller networks, other sizes of the light, the landscape network: from shape to estimate."""

import numpy as np
import pytest
import torch
from torch import nn

from deeplight.contract import ModelContract
from deeplight.dataset import SplitIndex
from deeplight.deploy.onnx import export_onnx
from deeplight.errors import ConfigError, ModelError
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.preprocess import frame_photo, landscape_background, network_input
from deeplight.training.checkpoint import Header
from deeplight.training.config import changed, flatten
from deeplight.training.data import ExampleBytes, refuse_other_size
from deeplight.training.network.generator import (
    FEATURE_SIZE,
    PHOTO_SIZE,
    Generator,
    NetworkConfig,
    fold_batch_norm,
)
from deeplight.training.network.imagenet import load_imagenet
from deeplight.training.network.mobilenet_v2 import (
    FEATURE_CHANNELS,
    STAGES,
    MobileNetV2Encoder,
    scaled,
)
from deeplight.training.presets import BASES, PRESETS, VARIANTS, preset
from deeplight.training.release import contract_of

pytestmark = pytest.mark.needs("onnxscript")


def parameters(module):
    return sum(parameter.numel() for parameter in module.parameters())


@pytest.mark.parametrize(
    ("width", "stages"),
    [
        (1.0, (16, 24, 32, 64, 96, 160)),
        (0.5, (8, 16, 16, 32, 48, 80)),
        (0.35, (8, 8, 16, 24, 32, 56)),
    ],
)
def test_widths_are_the_published_ones(width, stages):
    assert tuple(scaled(full, width) for _, full, _, _ in STAGES) == stages
    encoder = MobileNetV2Encoder(width=width)
    assert encoder.features[-1].project.conv.out_channels == stages[-1]


def test_smaller_networks_have_fewer_parameters():
    sizes = [parameters(Generator(NetworkConfig(width=width))) for width in (1.0, 0.5, 0.35)]
    assert sizes[0] > 2 * sizes[1] > 2 * sizes[2]


@pytest.mark.parametrize("size", [16, 32, 64])
def test_the_light_has_the_size_asked_for(size):
    generator = Generator(NetworkConfig(width=0.35, output_size=size)).eval()
    with torch.no_grad():
        assert generator(torch.zeros(2, 3, 192, 135)).shape == (2, 3, size, size)


@pytest.mark.parametrize("wrong", [{"output_size": 24}, {"width": 0.0}])
def test_impossible_networks_are_refused(wrong):
    with pytest.raises(ConfigError, match="output_size"):
        Generator(NetworkConfig(**wrong))


def test_imagenet_weights_are_for_the_full_width(tmp_path):
    path = tmp_path / "weights.npz"
    np.savez(path, a=np.zeros(1))
    with pytest.raises(ModelError, match=r"network\.width=1\.0"):
        load_imagenet(MobileNetV2Encoder(width=0.5), path)


def test_every_base_has_every_variant():
    for base in BASES:
        for variant in VARIANTS:
            assert f"{base}-{variant}" in PRESETS
    assert PRESETS["paper"] == PRESETS["paper-adv"]
    assert PRESETS["small"] == PRESETS["small-msd"]
    assert PRESETS["gpu"] == PRESETS["gpu-msd"]
    assert not PRESETS["paper-m"].adversarial.enabled
    assert PRESETS["small-landscape"].network.orientation == "landscape"
    with pytest.raises(ConfigError, match="-adv, -msd"):
        preset("small-tiny")


def test_the_landscape_network_sees_the_middle_of_the_background():
    """Section 4.3: 1080 x 810 of the 1080 x 1536 background."""
    frame = np.random.default_rng(0).integers(0, 256, (1920, 1080, 3), dtype=np.uint8)
    contract = ModelContract.landscape()
    framing = frame_photo(1920, 1080, np.radians(66.0), contract=contract)
    assert (framing.top, framing.bottom) == pytest.approx((363, 363 + 810))
    assert (framing.left, framing.right) == pytest.approx((0, 1080))
    assert network_input(frame, framing).shape == (3, 144, 192)
    assert PHOTO_SIZE["landscape"] == (contract.height, contract.width)


def test_a_stored_background_is_cut_where_a_photo_is():
    """Smooth pictures come out alike; the twin cut 12 rows lower does not."""
    y, x = np.mgrid[0:1920, 0:1080]
    frame = np.stack([x / 5, y / 8, (x + y) / 12], -1).astype(np.uint8)
    framing = frame_photo(1920, 1080, np.radians(66.0), contract=ModelContract.landscape())
    direct = network_input(frame, framing)
    stored = frame[:1536].reshape(192, 8, 135, 8, 3).mean((1, 3)).round().astype(np.uint8)
    ours = landscape_background(stored).transpose(2, 0, 1) / 255 - 0.5
    assert ours.shape == direct.shape
    assert np.abs(ours - direct).max() < 0.02
    lower = landscape_background(np.roll(stored, -12, axis=0)).transpose(2, 0, 1) / 255 - 0.5
    assert np.abs(lower - direct).max() > 0.03


def quick_encoder(network):
    """Features of the right shape from one layer: exporting the real ones takes half a minute."""
    height, width = FEATURE_SIZE[network.orientation]
    pool = nn.AvgPool2d(24)  # 144 x 192 -> 6 x 8, 192 x 135 -> 8 x 5
    channels = scaled(FEATURE_CHANNELS, network.width)
    fit = nn.Upsample((height, width), mode="nearest")
    return nn.Sequential(pool, nn.Conv2d(3, channels, 1), nn.ReLU6(), fit)


@pytest.mark.parametrize(
    ("variant", "quick"),
    [
        ("landscape", True),
        *(pytest.param(name, False, marks=pytest.mark.slow) for name in ("landscape", "out64")),
    ],
)
def test_an_exported_variant_estimates(tmp_path, variant, quick):
    config = preset(f"small-{variant}", ["network.width=0.35", "network.latent_size=32"])
    if quick:
        config = changed(config, {"network.output_size": 16})
    torch.manual_seed(0)
    generator = Generator(config.network)
    if quick:
        generator.encoder = quick_encoder(config.network)
    fold_batch_norm(generator)
    contract = contract_of(Header(10, 0.0, flatten(config), "abc"), "toy")
    path = tmp_path / "model.onnx"
    export_onnx(generator, contract, path, float16=False)
    estimator = OnnxEstimator(path, threads=1, trusted=True)
    photo = np.random.default_rng(0).integers(0, 256, (96, 54, 3), dtype=np.uint8)
    lighting = estimator.estimate(photo, fov_deg=66.0)
    assert lighting.size == config.network.output_size
    framing = frame_photo(96, 54, np.radians(66.0), contract=contract)
    with torch.no_grad():
        expected = generator(torch.from_numpy(network_input(photo, framing))[None])[0]
    inside = lighting.radiance[lighting.size // 2, lighting.size // 2]
    centre = expected[:, lighting.size // 2, lighting.size // 2].exp().numpy()
    np.testing.assert_allclose(inside, centre, rtol=1e-3)


class Stored(SplitIndex):
    """A split of two examples with backgrounds of one shape, each row as bright as its number."""

    def __init__(self, shape):
        self.shape, self.rigs = shape, np.array(["paper", "paper"])

    def pixels(self, number):
        rows = np.arange(self.shape[0], dtype=np.uint8)
        photo = np.broadcast_to(rows[:, None, None], (*self.shape, 3))
        return photo, np.zeros((3, 8, 8, 3), np.uint8)

    def __len__(self):
        return 2


def test_the_landscape_network_trains_on_portrait_and_on_landscape_data():
    for shape in ((192, 135), (144, 192)):
        examples = ExampleBytes(Stored(shape), ["paper"], "landscape")
        refuse_other_size(examples, "landscape")
        assert examples[0].photo.shape == (144, 192, 3)
    cut = ExampleBytes(Stored((192, 135)), ["paper"], "landscape")[0].photo[:, 0, 0].numpy()
    assert (cut[0], cut[-1]) == (45, 146)  # 192 / 1536 * (1536 - 810) / 2 = 45.4 rows from the top
    with pytest.raises(ConfigError, match="orientation"):
        refuse_other_size(ExampleBytes(Stored((144, 192)), ["paper"]), "portrait")

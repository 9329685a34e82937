"""A smaller network starts near its teacher, and is pulled towards it."""

import copy
import math

import numpy as np
import pytest
import torch

from deeplight.errors import ConfigError, ModelError
from deeplight.training.augment import Inputs
from deeplight.training.distil import lit_l1, lit_share, resized
from deeplight.training.losses import LossTerms
from deeplight.training.network.generator import Generator, NetworkConfig
from deeplight.training.presets import preset
from deeplight.training.slim import least_squares, principal, start_from
from deeplight.training.teacher import Teacher

pytestmark = pytest.mark.needs("safetensors")

SMALL = {"latent_size": 16, "decoder_widths": (8, 8), "output_size": 16}
PLAIN = {"encoder_norm": "none", "decoder_norm": "none"}


@pytest.fixture(scope="module")
def photos():
    random = np.random.default_rng(0)
    coarse = torch.tensor(random.uniform(-0.5, 0.5, (12, 3, 4, 3)), dtype=torch.float32)
    return torch.nn.functional.interpolate(coarse, (192, 135), mode="bilinear")


@pytest.fixture(scope="module")
def wide():
    torch.manual_seed(0)
    network = Generator(NetworkConfig(width=0.35, **PLAIN, **SMALL)).eval()
    torch.nn.init.normal_(network.decoder.up3.weight, std=0.3)
    return network


@pytest.mark.parametrize("norms", [{}, PLAIN])
@torch.no_grad()
def test_a_network_of_the_same_shape_starts_as_its_teacher(wide, photos, norms):
    config = NetworkConfig(width=0.35, **norms, **SMALL)
    student = Generator(config)
    start_from(student, config, wide, photos)
    assert wide(photos).std() > 0.1
    torch.testing.assert_close(student.eval()(photos), wide(photos), atol=1e-3, rtol=0)
    turned = student(photos.flip(-1))  # the twin that must fail
    assert (turned - wide(photos)).abs().max() > 1e-2


@pytest.mark.parametrize("change", [{"width": 0.25}, {"output_size": 32}])
@torch.no_grad()
def test_another_shape_starts_nearer_than_any_fixed_light(wide, photos, change):
    config = NetworkConfig(**{"width": 0.35, **PLAIN, **SMALL, **change})
    student = Generator(config)
    start_from(student, config, wide, photos)
    wanted = resized(wide(photos), config.output_size)
    fixed = wanted.median(0, keepdim=True).values.expand_as(wanted)
    assert lit_l1(student.eval()(photos), wanted) < 0.8 * lit_l1(fixed, wanted)


@torch.no_grad()
def test_a_teacher_that_begins_as_wide_as_its_student_is_fitted(photos):
    """The published widths 0.5 and 0.35 both begin with 16 channels."""
    torch.manual_seed(0)
    wide = Generator(NetworkConfig(width=0.5, **PLAIN, **SMALL)).eval()
    torch.nn.init.normal_(wide.decoder.up3.weight, std=0.3)
    config = NetworkConfig(width=0.35, **PLAIN, **SMALL)
    student = Generator(config)
    start_from(student, config, wide, photos)
    fixed = wide(photos).median(0, keepdim=True).values.expand(len(photos), -1, -1, -1)
    assert lit_l1(student.eval()(photos), wide(photos)) < 0.8 * lit_l1(fixed, wide(photos))


@pytest.mark.parametrize("size", [16, 32])
@torch.no_grad()
def test_a_mixture_of_components_travels_to_the_student(photos, size):
    shape = {"width": 0.35, **PLAIN, **SMALL, "components": 3}
    torch.manual_seed(0)
    wide = Generator(NetworkConfig(**shape)).eval()
    wide.mixture.mix.weight.normal_(std=0.5)
    smooth = torch.nn.functional.interpolate(torch.randn(4, 3, 4, 4), (16, 16), mode="bilinear")
    wide.mixture.mean.copy_(smooth[0])
    wide.mixture.components.copy_(smooth[1:])
    config = NetworkConfig(**{**shape, "output_size": size})
    student = Generator(config)
    start_from(student, config, wide, photos)
    wanted, found = resized(wide(photos), size), student.eval()(photos)
    if size == 16:
        torch.testing.assert_close(found, wanted, atol=1e-3, rtol=0)
    student.mixture.components.zero_()  # the twin: the decoder alone knows less
    assert lit_l1(found, wanted) < 0.5 * lit_l1(student(photos), wanted)


@pytest.mark.parametrize(
    ("change", "message"), [({"width": 0.25, "latent_size": 32}, "latent_size"), ({}, "width")]
)
def test_a_teacher_of_another_latent_size_or_narrower_is_refused(wide, photos, change, message):
    config = NetworkConfig(**{"width": 0.5, **PLAIN, **SMALL, **change})
    with pytest.raises(ConfigError, match=message):
        start_from(Generator(config), config, wide, photos)


def test_least_squares_finds_the_map_it_was_made_with():
    torch.manual_seed(0)
    x, weight = torch.randn(4, 500), torch.randn(3, 4)
    found, bias = least_squares(x, weight @ x + 2.0)
    torch.testing.assert_close(found, weight, atol=0.01, rtol=0)
    torch.testing.assert_close(bias, torch.full((3,), 2.0), atol=0.01, rtol=0)


def test_principal_directions_are_orthonormal_and_hold_the_variance():
    torch.manual_seed(0)
    flow = torch.randn(5, 2, 6, 6)
    flow = torch.einsum("nchw,cd->ndhw", flow, torch.randn(2, 7))  # of rank 2
    basis = principal([flow], 2)
    torch.testing.assert_close(basis.T @ basis, torch.eye(2), atol=1e-4, rtol=0)
    rows = flow.transpose(0, 1).flatten(1)
    torch.testing.assert_close(basis @ (basis.T @ rows), rows, atol=1e-3, rtol=0)


def test_light_on_a_smaller_ball_keeps_its_mean():
    torch.manual_seed(0)
    light = torch.randn(2, 3, 32, 32)
    small = resized(light, 16)
    means = [
        (q.exp() * lit_share(q.shape[-1])).sum((2, 3)) / lit_share(q.shape[-1]).sum()
        for q in (light, small)
    ]
    torch.testing.assert_close(means[0], means[1], rtol=1e-3, atol=0)
    assert resized(light, 64).shape == (2, 3, 64, 64)


@pytest.mark.parametrize("size", [16, 32, 64])
def test_distance_and_size_look_at_the_ball_only(size):
    light = torch.zeros(2, 3, size, size)
    light[:, :, lit_share(size) == 0] = 50.0  # off the ball
    even = torch.full_like(light, 0.3)
    assert lit_l1(light, even).item() == pytest.approx(0.3, abs=1e-5)
    for other in (16, 32):
        small = resized(light, min(other, size))
        torch.testing.assert_close(small[:, :, lit_share(len(small[0, 0])) > 0].max(), light.min())


def test_the_teacher_adds_its_distance(wide, photos):
    teacher = Teacher([wide], 0.5)
    flipped = torch.arange(len(photos)) % 2 == 0
    inputs = Inputs(photos, torch.zeros(12, 3, 3, 4), torch.zeros(12, dtype=torch.int64), flipped)
    answer = teacher.answer(inputs, 16)
    before = LossTerms({"reconstruction": torch.tensor(1.0)}, {})
    assert teacher.join(before, answer, inputs).total() == pytest.approx(1.0)
    assert teacher.join(before, answer + 0.2, inputs).total() == pytest.approx(1.1, abs=1e-4)
    student = (answer + 0.2).requires_grad_()
    teacher.join(before, student, inputs).total().backward()
    assert student.grad.abs().sum() > 0
    assert all(parameter.grad is None for parameter in wide.parameters())  # it teaches only


def test_several_teachers_teach_their_mean_radiance(wide, photos):
    brighter = copy.deepcopy(wide)
    brighter.decoder.up3.bias.data += math.log(3)
    none = torch.zeros(12, dtype=torch.bool)
    inputs = Inputs(photos, torch.zeros(12, 3, 3, 4), torch.zeros(12, dtype=torch.int64), none)
    one = Teacher([wide], 1.0).answer(inputs, 16)
    two = Teacher([wide, brighter], 1.0).answer(inputs, 16)
    torch.testing.assert_close(two, one + math.log(2))  # (1 + 3) / 2, not the middle of the logs
    torch.testing.assert_close(Teacher([wide, wide], 1.0).answer(inputs, 16), one)


def test_the_settings_name_the_teacher(root, tmp_path):
    golden = root / "tests" / "golden" / "tiny.onnx"
    config = preset("small", [f"distil.teacher={golden}"])
    assert Teacher.of(config).networks[0].output_size == 16
    both = preset("small", [f"distil.teacher={golden}, {golden}"])
    assert len(Teacher.of(both).networks) == 2
    landscape = preset("small-landscape", [f"distil.teacher={golden}"])
    with pytest.raises(ModelError, match="landscape"):
        Teacher.of(landscape)
    with pytest.raises(ModelError, match="no file"):
        Teacher.of(preset("small", [f"distil.teacher={tmp_path / 'none.onnx'}"]))

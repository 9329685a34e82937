"""TFLite files of the shipped model against the network they were made from, on real photos.

Needs the converter (docs/export.md) and a data set in data/sim; minutes, so they are `slow`.
"""

import numpy as np
import pytest
import torch

from deeplight.camera_response import encode, soft_clip
from deeplight.dataset import open_dataset
from deeplight.deploy.litert import export_litert
from deeplight.deploy.precision import PRECISIONS
from deeplight.estimators.open import open_model
from deeplight.evaluate.metrics import masked_l1
from deeplight.evaluate.scores import rendered_radiance
from deeplight.preprocess import normalise
from deeplight.reflectance import rig_bases
from deeplight.sphere import SPHERES
from deeplight.training.model_file import load_network

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200), pytest.mark.needs("litert_torch")]
EXAMPLES = 48
PHOTOS = 96


@pytest.fixture(scope="module")
def data(root):
    folder = root / "data" / "sim"
    if not folder.is_dir():
        pytest.skip("needs a data set in data/sim")
    return open_dataset(folder)


def spread(index, count):
    return np.linspace(0, len(index) - 1, count).astype(int)


@pytest.fixture(scope="module")
def views(data):
    index = data.index("val")
    return [index[int(number)] for number in spread(index, EXAMPLES)]


@pytest.fixture(scope="module")
def calibration(data):
    index = data.index("train")
    return normalise(np.stack([index.pixels(int(n))[0] for n in spread(index, PHOTOS)]))


@pytest.fixture(scope="module")
def network(root):
    return load_network(root / "src" / "deeplight" / "weights" / "deeplight.onnx")


def sphere_errors(data, views, log_radiance):
    """Mean L1 of each rendered sphere against the filmed one."""
    rig = data.rigs[views[0].meta.rig]
    rendered = rendered_radiance(rig_bases(rig, log_radiance.shape[1]), log_radiance)
    errors = {}
    for name in SPHERES:
        filmed = np.stack([view.spheres[name] for view in views]).astype(np.float32) / 255
        shown = encode(soft_clip(rendered[name]))
        errors[name] = masked_l1(shown, filmed, rig.views[name].mask()).mean()
    return errors


@pytest.mark.parametrize("precision", PRECISIONS)
def test_a_file_gives_what_the_training_network_gives(
    network, data, views, calibration, tmp_path, precision
):
    generator, contract = network
    path = tmp_path / "model.tflite"
    export_litert(generator, contract, path, precision, calibration)
    estimator = open_model(path, 1)
    assert estimator.contract == contract
    photos = normalise(np.stack([view.background for view in views]))
    with torch.no_grad():
        expected = generator(torch.from_numpy(photos)).permute(0, 2, 3, 1).numpy()
    found = estimator.estimate_inputs(photos)
    if precision == "float32":
        np.testing.assert_allclose(found, expected, atol=1e-4, rtol=0)
    # No photo's light is off as a whole: cut signals made it 1.5 times for some.
    assert np.abs((found - expected).mean((1, 2, 3))).max() < 0.1
    before, after = (sphere_errors(data, views, q) for q in (expected, found))
    dimmed = sphere_errors(data, views, found - 0.5)  # the twin that must fail
    assert max(abs(dimmed[name] - before[name]) for name in SPHERES) > 0.003
    for name in SPHERES:
        assert abs(after[name] - before[name]) <= 0.003, (name, after[name] - before[name])

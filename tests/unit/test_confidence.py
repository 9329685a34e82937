"""Confidence: what flips and cuts agree on is known, chance is not, and nothing is no answer."""

import numpy as np
import pytest

from deeplight.contract import ModelContract
from deeplight.estimators.confidence import TYPICAL_ERRORS, confidence_of, warnings_of
from deeplight.estimators.network import Estimate, NetworkEstimator
from deeplight.io.photos import Photo
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball
from deeplight.preprocess import frame_photo

UV = mirror_ball.grid(32)


class Fake(NetworkEstimator):
    """A network whose lamp stands left or right as the picture says, or anywhere by chance."""

    contract = ModelContract()

    def __init__(self, chance: bool) -> None:
        self.chance, self.random = chance, np.random.default_rng(0)

    def run(self, inputs: np.ndarray) -> np.ndarray:
        answers = []
        for picture in inputs:
            half = picture.shape[2] // 2
            side = 0.5 if picture[:, :, half:].mean() > picture[:, :, :half].mean() else -0.5
            u, v = self.random.uniform(-0.6, 0.6, 2) if self.chance else (side, 0.3)
            near = np.hypot(UV[0] - u, UV[1] - v) < 0.15
            answers.append(np.where(near, 3.0, -1.0)[..., None] * np.ones(3))
        return np.array(answers, np.float32).transpose(0, 3, 1, 2)


def confidence(fake: Fake, pixels: np.ndarray):
    framing = frame_photo(*pixels.shape[:2], 1.15)
    first = Lighting.from_log_radiance(Fake(False).estimate_inputs(_inputs(pixels))[0])
    return confidence_of(fake, Estimate(first, Photo(pixels), framing, (), {}))


def _inputs(pixels: np.ndarray) -> np.ndarray:
    return (pixels.transpose(2, 0, 1)[None] / 255 - 0.5).astype(np.float32)


@pytest.fixture
def pixels() -> np.ndarray:
    """Brighter on the right."""
    ramp = np.linspace(30, 220, 108)[None, :, None]
    return np.broadcast_to(ramp, (192, 108, 3)).astype(np.uint8)


def test_answers_that_agree_are_known(pixels):
    found = confidence(Fake(chance=False), pixels)
    assert found.direction_deg == pytest.approx(0, abs=1e-3)
    assert set(found.words.values()) == {"roughly known"}
    assert "35 degrees" in found.sentences[0]


def test_answers_by_chance_are_not(pixels):
    found = confidence(Fake(chance=True), pixels)
    assert found.direction_deg > 18
    assert found.words["direction"] == "not known"
    assert found.record()["typical_error"]["direction"] == TYPICAL_ERRORS["direction"]["not known"]


@pytest.mark.parametrize(("level", "word"), [(0, "black"), (255, "white"), (128, "one colour")])
def test_a_photo_of_nothing_is_named(level, word):
    blank = np.full((192, 108, 3), level, np.uint8)
    assert word in warnings_of(blank)[0]
    found = confidence(Fake(chance=False), blank)
    assert set(found.words.values()) == {"not known"}
    assert found.sentences == found.warnings


def test_an_ordinary_photo_has_no_warning(pixels):
    assert warnings_of(pixels) == ()

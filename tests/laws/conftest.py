"""What the law tests share: reproducible examples and an independent integral over the sphere."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import settings

# The same examples on every machine and every run: a law that fails, fails for everyone.
settings.register_profile("laws", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("laws")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20190616)


@pytest.fixture
def unit_vectors(rng: np.random.Generator) -> Callable[[int], np.ndarray]:
    """Directions spread evenly over the sphere."""

    def draw(count: int) -> np.ndarray:
        vectors = rng.normal(size=(count, 3))
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)

    return draw

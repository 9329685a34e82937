"""What `deeplight export` cannot do for a network is refused before a file is written."""

from pathlib import Path

import pytest

from deeplight.deploy.network import Refinement, write_network
from deeplight.errors import ConfigError

TINY = Path(__file__).parents[1] / "golden" / "tiny.onnx"


@pytest.mark.parametrize(
    ("name", "refinement", "shares", "expected"),
    [
        ("out.onnx", Refinement(lamp_gain=0.2), (), "a network with lamps for --lamp-gain"),
        ("out.tflite", Refinement(heads=("data",)), (), "ONNX for --heads"),
        ("out.tflite", Refinement(scales=("data",)), (), "ONNX for --heads, --scales"),
        ("out.tflite", Refinement(indoors=("data",)), (), "--scales and --indoors"),
        ("out.onnx", Refinement(scales=("data",)), (), "a network with heads for --scales"),
        ("out.onnx", Refinement(indoors=("data",)), (), "--scales and --indoors"),
        ("out.tflite", None, (1.0,), "several networks for --shares"),
        ("out.onnx", None, (1.0,), "several networks for --shares"),
    ],
)
def test_what_a_network_cannot_have_is_refused(
    tmp_path: Path, name: str, refinement: Refinement | None, shares: tuple[float], expected: str
) -> None:
    with pytest.raises(ConfigError, match=expected):
        write_network(TINY, tmp_path / name, refinement=refinement, shares=shares)
    assert not list(tmp_path.iterdir())

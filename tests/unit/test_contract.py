"""The contract inside a model file: round trip, and clear refusal of what is not ours."""

import json
import math

import pytest

from deeplight.contract import SINCE_VERSION_2, SINCE_VERSION_3, ModelContract
from deeplight.errors import ModelError


def test_it_comes_back_from_json_as_it_was() -> None:
    contract = ModelContract(trained_on="3 places, 10 steps")
    assert ModelContract.from_json(contract.to_json()) == contract


def test_the_defaults_are_the_papers_camera() -> None:
    contract = ModelContract()
    tangent = math.tan(math.radians(33))
    assert (contract.width, contract.height, contract.output_size) == (135, 192, 32)
    assert contract.top == pytest.approx(tangent)
    assert contract.bottom == pytest.approx(-0.6 * tangent)
    assert contract.right == pytest.approx(tangent * 9 / 16)
    cells_across = contract.width / (2 * contract.right)
    assert cells_across == pytest.approx(contract.height / (contract.top - contract.bottom))


def test_version_1_is_this_one_without_lamps() -> None:
    old = json.loads(ModelContract().to_json()) | {"version": 1}
    for name in (*SINCE_VERSION_2, *SINCE_VERSION_3):
        del old[name]
    assert ModelContract.from_json(json.dumps(old)) == ModelContract()
    with pytest.raises(ModelError, match="lamps"):  # only version 1 may lack them
        ModelContract.from_json(json.dumps(old | {"version": 2}))


def test_version_2_is_this_one_without_heads() -> None:
    lamps = ModelContract(lamps=3, brightness=0.9)
    old = json.loads(lamps.to_json()) | {"version": 2}
    for name in SINCE_VERSION_3:
        del old[name]
    assert ModelContract.from_json(json.dumps(old)) == lamps
    with pytest.raises(ModelError, match="heads"):
        ModelContract.from_json(json.dumps(old | {"version": 3}))


def test_names_of_heads_come_back_as_they_were() -> None:
    contract = ModelContract(heads=("pitch_rad", "upright_90"))
    assert ModelContract.from_json(contract.to_json()) == contract


def entries(**changed: object) -> str:
    return json.dumps(json.loads(ModelContract().to_json()) | changed)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "JSON"),
        ("[1]", "object"),
        ("{}", "version None"),
        (entries(version=99), "version 99"),
        (entries(added_later=1), "added_later"),
        ('{"version": 1}', "missing"),
        (entries(width="wide"), "numbers"),
        (entries(width=0), "width"),
        (entries(lamps=-1), "lamps"),
        (entries(brightness=2.0), "brightness"),
        (entries(heads=["pitch_rad"] * 65), "heads"),
        (entries(heads=3), "names"),
        (entries(heads="abc"), "a list of names"),
        (entries(background_fraction=1.5), "background_fraction"),
        (entries(output_mapping="angular map"), "output_mapping"),
        (entries(output_quantity="radiance"), "ln radiance"),
    ],
)
def test_what_is_not_ours_is_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        ModelContract.from_json(text)
    assert "\n" not in str(caught.value)

"""Lighting on disk: what is written comes back, and says what it is."""

import json
from pathlib import Path

import numpy as np
import pytest

from deeplight.errors import ImageFileError
from deeplight.formats.webxr import light_estimate
from deeplight.harmonics import dominant_light, irradiance, spherical_harmonics
from deeplight.io.environment_file import load_lighting
from deeplight.io.lighting_file import Turn, save_lighting
from deeplight.io.orientation import TOOLS
from deeplight.io.radiance import read_hdr
from deeplight.lighting import Lighting
from deeplight.mappings.mirror_ball import pixel_directions


def lit_room(lamp: float = 40.0) -> Lighting:
    """Dim light that is warmer from above, with a lamp on the upper left in front."""
    directions = pixel_directions(32)
    radiance = 0.3 + 0.2 * directions[..., 1:2] * np.array([1.0, 0.9, 0.7])
    to_lamp = np.array([-0.6, 0.64, -0.48])
    radiance = radiance + lamp * (directions @ to_lamp > 0.97)[..., None]
    return Lighting(radiance.astype(np.float32))


def test_json_comes_back_exactly(tmp_path: Path) -> None:
    lighting = lit_room()
    save_lighting(lighting, tmp_path / "a.b", facts={"model": {"sha256": "0"}})
    back = load_lighting(tmp_path / "a.b.json")
    np.testing.assert_array_equal(back.radiance, lighting.radiance)
    assert json.loads((tmp_path / "a.b.json").read_text())["model"] == {"sha256": "0"}


@pytest.mark.parametrize("tool", [None, *TOOLS])
def test_the_environment_comes_back_whatever_tool_it_was_turned_for(
    tmp_path: Path, tool: str | None
) -> None:
    lighting = lit_room()
    turn = Turn(tool, TOOLS[tool].view_u) if tool else None
    save_lighting(lighting, tmp_path / "room", turn=turn)
    back = load_lighting(tmp_path / "room.exr")
    np.testing.assert_allclose(back.power(), lighting.power(), rtol=0.02)
    to_lamp, found = dominant_light(lighting).direction, dominant_light(back).direction
    assert to_lamp @ found > np.cos(np.radians(2))


def test_radiance_hdr_holds_the_same_to_its_own_step(tmp_path: Path) -> None:
    files = save_lighting(lit_room(), tmp_path / "room", hdr=True)
    assert [file.name for file in files] == ["room.exr", "room.hdr", "room.json"]
    exr, hdr = read_hdr(tmp_path / "room.exr"), read_hdr(tmp_path / "room.hdr")
    assert exr.shape == (256, 512, 3)
    np.testing.assert_allclose(hdr, exr, rtol=0.02, atol=0.01 * exr.max(axis=-1).min())


def test_the_centre_column_is_the_view_and_right_of_it_is_plus_x(tmp_path: Path) -> None:
    directions = pixel_directions(32).astype(np.float32)
    save_lighting(Lighting(directions + 1.0), tmp_path / "axes")
    axes = read_hdr(tmp_path / "axes.exr") - 1.0
    for row, column, direction in [
        (128, 256, (0, 0, -1)),
        (128, 384, (1, 0, 0)),
        (128, 128, (-1, 0, 0)),
        (2, 256, (0, 1, 0)),
        (128, 2, (0, 0, 1)),
    ]:
        np.testing.assert_allclose(axes[row, column], direction, atol=0.15)


def test_json_offers_both_signs_and_names_them(tmp_path: Path) -> None:
    lighting = lit_room()
    save_lighting(lighting, tmp_path / "room")
    record = json.loads((tmp_path / "room.json").read_text())
    harmonics = record["spherical_harmonics"]
    positive = np.array(harmonics["spherical_harmonics_coefficients"])
    negated = np.array(harmonics["spherical_harmonics_coefficients_condon_shortley"])
    np.testing.assert_allclose(positive, spherical_harmonics(lighting), rtol=1e-6)
    np.testing.assert_array_equal(positive[[0, 2, 4, 6, 8]], negated[[0, 2, 4, 6, 8]])
    np.testing.assert_array_equal(positive[[1, 3, 5, 7]], -negated[[1, 3, 5, 7]])
    light = record["dominant_light"]
    assert np.array(light["primary_light_direction"]) @ [-0.6, 0.64, -0.48] > 0.98
    assert record["environment"]["view_u"] == 0.5


def test_webxr_splits_the_light_without_losing_any() -> None:
    """E(harmonics) + E(main light) = E(environment), for a surface that faces the main light."""
    lighting = lit_room()
    estimate = light_estimate(lighting)
    interleaved = np.array(estimate["sphericalHarmonicsCoefficients"]).reshape(9, 3)
    sign = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1])
    toward = np.array([estimate["primaryLightDirection"][axis] for axis in "xyz"])
    intensity = np.array([estimate["primaryLightIntensity"][axis] for axis in "xyz"])
    split = (
        irradiance((interleaved * sign[:, None]).astype(np.float32), toward[None])[0] + intensity
    )
    directions = pixel_directions(32).reshape(-1, 3)
    cosine = np.maximum(directions @ toward, 0)
    whole = (cosine[:, None] * lighting.radiance.reshape(-1, 3)).sum(0) * 16 / 32**2
    np.testing.assert_allclose(split, whole, rtol=0.02)
    assert estimate["primaryLightDirection"]["w"] == 0


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"format": "deeplight lighting", "format_version": 9}',
        '{"format": "deeplight lighting", "format_version": 1, "mirror_ball": {"size": 3}}',
        '{"format": "deeplight lighting", "format_version": 1,'
        ' "mirror_ball": {"size": 3, "radiance": "AAAA"}}',
    ],
)
def test_json_that_is_no_lighting_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(ImageFileError, match="lighting") as caught:
        load_lighting(path)
    assert "\n" not in str(caught.value)

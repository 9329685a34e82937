"""The light in Mitsuba, through the file that `deeplight convert --for mitsuba` writes."""

from pathlib import Path
from typing import Any

import mitsuba
import numpy as np
import pytest

from deeplight.environment import Environment
from deeplight.formats.files import FileSpec, write_environment
from round_trips import (
    MATERIALS,
    SIZE,
    Balls,
    assert_right,
    assert_wrong,
    labelled,
    mirrored,
    quarter_turned,
)

pytestmark = pytest.mark.slow


def ball(name: str, light: Path, samples: int) -> np.ndarray:
    """One ball before Mitsuba's own orthographic camera, which looks along +Z with +X left."""
    mitsuba.set_variant("scalar_rgb")
    transform = mitsuba.ScalarTransform4f
    grey = {"type": "rgb", "value": MATERIALS[name]}
    mirror = {"type": "conductor", "material": "none", "specular_reflectance": grey}
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "direct"},
        "sensor": {
            "type": "orthographic",
            "to_world": transform().translate([0, 0, -5]),
            "sampler": {"type": "independent", "sample_count": samples},
            "film": {
                "type": "hdrfilm",
                "width": SIZE,
                "height": SIZE,
                "pixel_format": "rgb",
                "rfilter": {"type": "box"},
            },
        },
        "ball": {
            "type": "sphere",
            "bsdf": {"type": "diffuse", "reflectance": grey} if name == "diffuse" else mirror,
        },
        "light": {"type": "envmap", "filename": str(light)},
    }
    return np.array(mitsuba.render(mitsuba.load_dict(scene), seed=1))


def rendered(environment: Environment, folder: Path, samples: int) -> Balls:
    light = folder / "light.exr"
    write_environment(environment, FileSpec(light, made_for="mitsuba", size=256))
    return Balls(**{name: ball(name, light, samples) for name in MATERIALS})


def test_mitsuba_sees_the_light_as_we_do(tmp_path: Path) -> None:
    assert_right(rendered(labelled(), tmp_path, samples=512), "Mitsuba")


@pytest.mark.parametrize("wrong", [mirrored, quarter_turned])
def test_a_wrong_panorama_would_be_found_in_mitsuba(tmp_path: Path, wrong) -> None:
    assert_wrong(rendered(wrong(), tmp_path, samples=16))

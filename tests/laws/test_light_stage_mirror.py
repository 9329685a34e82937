"""Lights found in the mirror ball: where they are and how bright."""

from pathlib import Path

import numpy as np
import pytest

from deeplight.io.light_stage_file import StageLights, write_lights
from deeplight.light_stage.measure import MeasureSettings, measure
from deeplight.reflectance import analytic_basis
from lab.light_stage.run import LightStage, lights_of, write_light_stage

STAGE = LightStage(("mirror", "diffuse"), photo_px=80, spacing_deg=30.0, supersample=2)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mirror")
    write_light_stage(folder, STAGE)
    return folder


def without(stage: Path, folder: Path, **changes: object) -> Path:
    """A list of the same lights with less in it."""
    lights = lights_of(STAGE)
    known = {"directions": lights.directions, "colours": lights.colours, "calibrated": False}
    write_lights(
        folder / "lights.json",
        StageLights(lights.files, distance_m=lights.distance_m, **{**known, **changes}),
    )
    return folder / "lights.json"


def errors_deg(found: np.ndarray) -> np.ndarray:
    true = lights_of(STAGE).directions
    assert true is not None
    return np.degrees(np.arccos(np.clip((found * true).sum(axis=1), -1, 1)))


def test_directions_are_found_within_half_a_degree(stage: Path, tmp_path: Path) -> None:
    """All in front of the sphere and next to it; at the very rim a pixel spans many degrees."""
    found = measure(stage, MeasureSettings(lights=without(stage, tmp_path, directions=None)))
    true = lights_of(STAGE).directions
    assert true is not None
    in_view = true[:, 2] > np.cos(np.radians(140))
    assert in_view.mean() > 0.8
    assert errors_deg(found.directions)[in_view].max() < 0.5
    assert any("directions from the mirror" in note for note in found.certificate.warnings)
    # Section 3.3: photographs of the mirror set scale and directions, never its basis.
    basis = found.bases["mirror"]
    assert (basis.weights == analytic_basis("mirror", basis.view).weights).all()


def test_lights_taken_as_far_away_would_be_found_out(stage: Path, tmp_path: Path) -> None:
    """The twin: without the lights' distance they are off by the sphere's own size."""
    path = without(stage, tmp_path, directions=None)
    path.write_text(path.read_text().replace('"distance_m": 1.2', '"distance_m": null'))
    found = measure(stage, MeasureSettings(lights=path))
    assert errors_deg(found.directions).max() > 0.5


def test_the_mirrors_reflectivity_sets_the_scale(stage: Path, tmp_path: Path) -> None:
    """Of lights of which nothing but the direction is known."""
    path = without(stage, tmp_path, colours=None)
    certificate = measure(stage, MeasureSettings(lights=path)).certificate
    assert certificate.scale_from == "the mirror's 0.827"
    assert certificate.spheres["diffuse"].measured == pytest.approx(0.345, rel=0.02)

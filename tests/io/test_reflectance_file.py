"""Bases, lists of lights and photographs: there and back, and nothing broken gets in."""

import json
from pathlib import Path

import numpy as np
import pytest

from deeplight.errors import DataSetError, ImageFileError
from deeplight.io.basis_file import load_bases, load_provenance, save_bases
from deeplight.io.light_stage_file import StageLights, read_lights, write_lights
from deeplight.io.photograph import read_photograph, write_photograph
from deeplight.reflectance import ReflectanceBasis, analytic_basis
from deeplight.sphere import PAPER_RIG, SphereView


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    weights = np.random.default_rng(0).random((16, 64)).astype(np.float32)
    view = SphereView(PAPER_RIG.views["diffuse"].ball_from_camera, 0.02, 4)
    save_bases(tmp_path / "b.npz", {"copper": ReflectanceBasis(weights, view, 8)}, {"who": "é"})
    return tmp_path / "b.npz"


def test_bases_come_back_as_they_were(saved: Path) -> None:
    basis = load_bases(saved)["copper"]
    want = np.random.default_rng(0).random((16, 64)).astype(np.float32)
    assert (basis.weights == want).all()
    assert (basis.view.size, basis.light_size, basis.view.angular_radius_rad) == (4, 8, 0.02)
    assert (basis.view.ball_from_camera == PAPER_RIG.views["diffuse"].ball_from_camera).all()
    assert load_provenance(saved) == {"who": "é"}


def test_for_a_rig_all_three_spheres_come_out(tmp_path: Path) -> None:
    view = SphereView(np.eye(3), PAPER_RIG.views["diffuse"].angular_radius_rad)
    save_bases(tmp_path / "b.npz", {"diffuse": analytic_basis("diffuse", view)}, {})
    bases = load_bases(tmp_path / "b.npz", PAPER_RIG)
    assert set(bases) == {"mirror", "matte_silver", "diffuse"}
    for name, basis in bases.items():
        assert (basis.view.ball_from_camera == PAPER_RIG.views[name].ball_from_camera).all()
    assert bases["mirror"] is analytic_basis("mirror", PAPER_RIG.views["mirror"])
    turned = bases["diffuse"].weights
    assert (
        np.abs(turned - analytic_basis("diffuse", PAPER_RIG.views["diffuse"]).weights).max() < 3e-4
    )
    assert np.abs(turned - analytic_basis("diffuse", view).weights).max() > 5e-4  # it did turn


def test_for_light_of_another_size_a_basis_renders_the_same(tmp_path: Path) -> None:
    """Light that is constant over 4 x 4 pixels of the measured size is the coarser light."""
    coarse = np.random.default_rng(1).random((8, 8)).astype(np.float32)
    view = PAPER_RIG.views["diffuse"]
    save_bases(tmp_path / "b.npz", {"diffuse": analytic_basis("diffuse", view)}, {})
    fine = load_bases(tmp_path / "b.npz", PAPER_RIG)["diffuse"]
    other = load_bases(tmp_path / "b.npz", PAPER_RIG, light_size=8)["diffuse"]
    assert other.light_size == 8
    shown = fine.weights @ coarse.repeat(4, 0).repeat(4, 1).ravel()
    np.testing.assert_allclose(other.weights @ coarse.ravel(), shown, atol=0.004)
    turned = load_bases(tmp_path / "b.npz", PAPER_RIG.mirrored(), light_size=8)["diffuse"]
    assert np.abs(turned.weights @ coarse.ravel() - shown).max() > 0.01  # the twin


@pytest.mark.parametrize("kind", ["pickle", "no zip", "truncated", "no basis", "NaN", "shape"])
def test_a_broken_file_is_reported(saved: Path, kind: str) -> None:
    arrays = dict(np.load(saved))
    if kind == "pickle":
        arrays["copper/weights"] = np.array([{"a": 1}], object)
    elif kind == "no basis":
        arrays = {"a": np.zeros(3)}
    elif kind == "NaN":
        arrays["copper/weights"] = arrays["copper/weights"] * np.nan
    elif kind == "shape":
        arrays["copper/weights"] = arrays["copper/weights"][:, :50]
    np.savez(saved, **arrays)
    if kind == "truncated":
        saved.write_bytes(saved.read_bytes()[:-200])
    elif kind == "no zip":
        saved.write_bytes(b"hello")
    with pytest.raises(DataSetError, match="reflectance bases in"):
        load_bases(saved)


def test_lights_there_and_back(tmp_path: Path, unit_directions: np.ndarray) -> None:
    colours = np.random.default_rng(1).random((5, 3)) + 0.1
    files = tuple(f"{n}.png" for n in range(5))
    write_lights(tmp_path / "l.json", StageLights(files, unit_directions, colours, 1.5, True))
    back = read_lights(tmp_path / "l.json")
    assert (back.files, back.distance_m, back.calibrated) == (files, 1.5, True)
    assert back.directions is not None
    assert back.colours is not None
    np.testing.assert_allclose(back.directions, unit_directions, atol=1e-6)
    np.testing.assert_allclose(back.colours, colours, atol=1e-6)


@pytest.fixture
def unit_directions() -> np.ndarray:
    vectors = np.random.default_rng(2).normal(size=(5, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def test_latitude_and_longitude_point_where_the_document_says(tmp_path: Path) -> None:
    (tmp_path / "l.csv").write_text(
        "file,latitude_deg,longitude_deg\na,0,0\nb,0,90\nc,90,0\nd,-30,180\n"
    )
    directions = read_lights(tmp_path / "l.csv").directions
    half, level = 0.5, np.sqrt(0.75)
    want = [[0, 0, 1], [1, 0, 0], [0, 1, 0], [0, -half, -level]]
    np.testing.assert_allclose(directions, want, atol=1e-12)


def test_a_table_of_directions_is_normalised(tmp_path: Path) -> None:
    (tmp_path / "l.csv").write_text("file,x,y,z,r,g,b\na,0,0,2,1,1,0.9\nb,3,0,0,1,1,1\n")
    lights = read_lights(tmp_path / "l.csv")
    np.testing.assert_allclose(lights.directions, [[0, 0, 1], [1, 0, 0]])
    np.testing.assert_allclose(lights.colours, [[1, 1, 0.9], [1, 1, 1]])


@pytest.mark.parametrize("lights", [[], {"a": 1}, [1], [{"direction": [0, 0, 1]}]])
def test_a_wrong_list_is_reported(tmp_path: Path, lights: object) -> None:
    (tmp_path / "l.json").write_text(json.dumps({"lights": lights}))
    with pytest.raises(DataSetError):
        read_lights(tmp_path / "l.json")


@pytest.mark.parametrize(("suffix", "step"), [(".png", 1 / 65535), (".exr", 1e-7)])
def test_photographs_keep_their_bits(tmp_path: Path, suffix: str, step: float) -> None:
    values = np.random.default_rng(3).random((20, 33, 3)).astype(np.float32)
    write_photograph(tmp_path / f"p{suffix}", values)
    np.testing.assert_allclose(read_photograph(tmp_path / f"p{suffix}", 1.0), values, atol=step)


def test_gamma_is_undone_for_integers_only(tmp_path: Path) -> None:
    values = np.full((4, 4, 3), 0.5, np.float32)
    for suffix, want in ((".png", 0.5**2.2), (".exr", 0.5)):
        write_photograph(tmp_path / f"p{suffix}", values)
        got = read_photograph(tmp_path / f"p{suffix}", 2.2)
        np.testing.assert_allclose(got, want, rtol=1e-4)


def test_other_formats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ImageFileError):
        write_photograph(tmp_path / "p.gif", np.zeros((4, 4, 3), np.float32))

"""Meshes made ready for transfer: cleaned, split, refused."""

import numpy as np
import pytest

from deeplight.compose.mesh import Finish, Mesh
from deeplight.errors import ConfigError, ImageFileError
from deeplight.transfer import mesh as transfer_mesh
from deeplight.transfer.mesh import prepared
from deeplight.transfer.precompute import TransferSettings, precompute

pytestmark = pytest.mark.needs("embreex")

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
# Two triangles for each side of the cube, anticlockwise seen from outside.
SIDES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)

FACES = np.concatenate([SIDES[:, [0, 1, 2]], SIDES[:, [0, 2, 3]]])
CUBE = Mesh(CORNERS * [3, 1, 1], FACES)


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = vertices[triangles].swapaxes(0, 1)
    return float((a * np.cross(b, c)).sum() / 6)


def edge_counts(triangles: np.ndarray) -> set[int]:
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, 1)], -1).reshape(-1, 2), axis=1)
    return set(np.unique(edges, axis=0, return_counts=True)[1].tolist())


def test_splitting_keeps_the_surface_whole() -> None:
    surface, notes = prepared([CUBE], 1 / 17)
    assert notes == (f"split 12 triangles into {len(surface.triangles):,}",)
    corners = surface.vertices[surface.triangles]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max() <= 1 / 17
    assert volume(surface.vertices, surface.triangles) == pytest.approx(1 / 9)
    assert edge_counts(surface.triangles) == {2}  # closed: no gap, no edge with a loose vertex
    np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1, atol=1e-9)
    coarse, none = prepared([CUBE], 2.0)
    assert (len(coarse.vertices), none) == (8, ())


def test_it_stands_in_the_middle_and_is_1_long() -> None:
    surface, _ = prepared([CUBE], 2.0)
    np.testing.assert_allclose(surface.vertices.min(0), [-0.5, 0, -1 / 6])
    np.testing.assert_allclose(surface.vertices.max(0), [0.5, 1 / 3, 1 / 6])


def test_what_has_no_area_and_no_use_is_left_out_and_reported() -> None:
    vertices = np.concatenate([CORNERS, [[0.5, 0.5, 0.5]]])
    faces = np.concatenate([FACES, [[0, 0, 1], [2, 2, 2]]])
    surface, notes = prepared([Mesh(vertices, faces)], 2.0)
    assert len(surface.vertices) == 8
    assert len(surface.triangles) == 12
    assert notes == ("left out 2 triangles without area, 1 unused vertices",)


def test_nothing_left_is_reported() -> None:
    with pytest.raises(ImageFileError, match="without area"):
        prepared([Mesh(CORNERS, np.array([[0, 1, 1], [0, 0, 3]]))], 1.0)


def test_broken_normals_are_made_anew() -> None:
    outward = CORNERS * 2 - 1
    given = outward / np.sqrt(3)
    given[0] = 0
    surface, _ = prepared([Mesh(CORNERS, FACES, given)], 2.0)
    assert (surface.normals @ outward.T).diagonal().min() > 1


def test_too_many_vertices_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transfer_mesh, "MAX_VERTICES", 7)
    with pytest.raises(ImageFileError, match="at most 7 vertices; got one of 8"):
        prepared([CUBE], 2.0)
    monkeypatch.setattr(transfer_mesh, "MAX_VERTICES", 500)
    assert len(prepared([CUBE], 1 / 400)[0].vertices) <= 500  # splitting stops in time


def test_gloss_of_a_high_order_must_fit_into_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deeplight.transfer.precompute._MOST_GLOSSY", 7 * 81**2)
    with pytest.raises(ConfigError, match="at most 7 vertices for a glossy finish of order 8"):
        precompute([CUBE], TransferSettings(order=8, longest_edge=2.0))


def test_a_mesh_turned_inside_out_is_reported() -> None:
    settings = TransferSettings(samples=32, glossy=None, ground=None, longest_edge=0.6)
    inwards = Mesh(CORNERS, FACES[:, ::-1])
    assert "look inwards" in precompute([inwards], settings)[1][-1]
    assert not any("inwards" in note for note in precompute([CUBE], settings)[1])


def test_textures_become_colours_of_vertices() -> None:
    picture = np.zeros((2, 2, 3), np.uint8)
    picture[0, 1] = [255, 0, 0]  # the upper right
    uv = np.tile([[0.9, 0.9], [0.1, 0.1]], (4, 1))
    mesh = Mesh(CORNERS, FACES, None, uv, None, Finish(colour_map=picture))
    surface, _ = prepared([mesh], 2.0)
    np.testing.assert_array_equal(surface.colours[:2], [[1, 0, 0], [0, 0, 0]])


@pytest.mark.parametrize(
    "wrong",
    [{"order": 9}, {"samples": 3}, {"bounces": -1}, {"diffuse": 1.5}, {"roughness": 0.01}],
)
def test_settings_out_of_range_are_reported(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError) as refused:
        TransferSettings(**wrong)  # type: ignore[arg-type]
    assert refused.value.got == f"{next(iter(wrong.values()))}"

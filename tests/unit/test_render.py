"""What rendering needs besides Mitsuba: the camera over the plane, meshes, tilt, look, engine."""

import struct
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin

from deeplight.camera import PinholeCamera
from deeplight.compose import mitsuba_variant as engine
from deeplight.compose import shapes
from deeplight.compose.compose import Item, placed
from deeplight.compose.composite import composite, radiance_of, write_layers
from deeplight.compose.denoise import denoised
from deeplight.compose.ground import Viewpoint
from deeplight.compose.look import blurred, grain, look_of
from deeplight.compose.mesh import load, standing
from deeplight.compose.trace import Layers
from deeplight.errors import ConfigError, ImageFileError
from deeplight.frames import UP, world_from_camera
from deeplight.io.environment_file import read_environment
from deeplight.io.tilt import tilt_of

VIEW = Viewpoint(PinholeCamera(640, 480, np.radians(50)), 1.4, np.radians(-20), np.radians(7))
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("pixel", [(320, 400), (20, 470), (600, 250)])
def test_a_point_of_the_plane_is_seen_where_it_was_asked_for(pixel: tuple[int, int]) -> None:
    point = VIEW.point(*pixel)
    assert point[1] == pytest.approx(0, abs=1e-12)
    assert VIEW.pixels(point[None])[0] == pytest.approx(pixel)


def test_the_middle_of_a_level_photo_is_its_horizon() -> None:
    level = Viewpoint(VIEW.camera, 1.4, 0.0)
    with pytest.raises(ConfigError, match="horizon"):
        level.point(320, 240)
    assert level.point(320, 480)[2] == pytest.approx(-1.4 / np.tan(np.radians(25)))
    assert level.point(640, 400)[0] > 0  # right is +X


@pytest.mark.parametrize(
    "wrong", [{"height_m": 0.0}, {"height_m": float("nan")}, {"pitch_rad": 2.0}, {"roll_rad": -2.0}]
)
def test_an_impossible_camera_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        Viewpoint(VIEW.camera, **wrong)


@pytest.mark.parametrize("at", [(-1, 100), (320, 481), (float("nan"), 3)])
def test_a_place_outside_the_photo_is_refused(at: tuple[float, float]) -> None:
    with pytest.raises(ConfigError):
        VIEW.point(*at)


@pytest.mark.parametrize("turn_deg", [0, 35, 200])
def test_an_object_stands_on_its_place_at_its_size(turn_deg: float) -> None:
    at = np.array([1.0, 0.0, -2.0])
    (mesh,) = standing(load("bunny"), at, 0.3, np.radians(turn_deg))
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    assert low[1] == pytest.approx(0, abs=1e-9)
    assert high[1] - low[1] == pytest.approx(0.3, rel=1e-6)  # its ears are its longest side
    assert (low + high)[[0, 2]] / 2 == pytest.approx(at[[0, 2]])


@pytest.mark.parametrize("shape", [shapes.bunny, shapes.ball])
def test_built_in_objects_are_closed_and_face_outwards(shape: Any) -> None:
    vertices, faces, normals = shape()
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, times = np.unique(edges, axis=0, return_counts=True)
    assert (times == 2).mean() > 0.999  # surface nets join four faces where two sheets touch
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((across * normals[faces].mean(1)).sum(-1) > 0).mean() > 0.99
    volume = (corners[:, 0] * across).sum() / 6
    assert volume > 0
    if shape is shapes.ball:
        assert volume == pytest.approx(np.pi / 6, rel=0.01)


def text(content: str, name: str, folder: Path) -> str:
    (folder / name).write_text(content)
    return str(folder / name)


PLY = "ply\nformat ascii 1.0\nelement vertex 3\n"
PLY += "".join(f"property float {axis}\n" for axis in "xyz")
BROKEN = {
    "empty.obj": "",
    "words.ply": "this is no mesh\n",
    "words.glb": "this is no mesh\n",
    "words.gltf": "{}",
    "points.ply": PLY + "end_header\n0 0 0\n1 0 0\n0 1 0\n",
    "no_faces.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "nan.obj": "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "flat_point.obj": "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n",
    "cut_off.ply": PLY
    + "element face 5\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0",
    "far.obj": "v 0 0 0\nv 1e30 0 0\nv 0 1 0\nf 1 2 3\n",
    "picture.png": "x",
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_bad_mesh_is_reported_in_one_line(name: str, tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    with pytest.raises(ImageFileError) as caught:
        load(text(BROKEN[name], name, tmp_path))
    assert "\n" not in str(caught.value)


def test_a_missing_mesh_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load(str(tmp_path / "none.glb"))


def test_an_open_surface_may_be_used_and_z_may_be_up(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    content = "v 0 0 0\nv 2 0 0\nv 0 0 5\nf 1 2 3\n"
    path = text(content, "open.obj", tmp_path)
    (lying,), (upright,) = load(path), load(path, "z")
    assert np.ptp(lying.vertices, axis=0) == pytest.approx([2, 0, 5])
    assert np.ptp(upright.vertices, axis=0) == pytest.approx([2, 5, 0])
    assert upright.vertices[:, 1].max() == pytest.approx(5)  # up, not down


def test_edges_are_sharp_and_round_things_round_where_a_file_has_no_normals(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    box, ball = trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(2)
    for name, shape in (("box", box), ("ball", ball)):
        shape.export(tmp_path / f"{name}.ply", vertex_normal=False)
    (flat,), (round_,) = (load(str(tmp_path / f"{name}.ply")) for name in ("box", "ball"))
    assert flat.normals is not None
    assert round_.normals is not None
    outwards = np.abs(flat.normals).max(1)  # a box's: along one axis each
    assert outwards == pytest.approx(1)
    assert len(round_.vertices) == len(ball.vertices)
    cosine = (round_.normals * round_.vertices).sum(1)
    assert cosine.min() > 0.99


def test_a_mesh_is_read_anew_when_its_file_has_changed(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    path = tmp_path / "a.ply"
    trimesh.creation.box((1, 1, 1)).export(path)
    assert load(str(path)) is load(str(path))
    trimesh.creation.icosphere(1).export(path)
    assert len(load(str(path))[0].faces) == 80


def test_a_large_texture_is_reduced_and_a_huge_one_refused_by_name(
    tmp_path: Path, monkeypatch
) -> None:
    trimesh = pytest.importorskip("trimesh")
    picture = Image.fromarray(np.full((64, 32, 3), 200, np.uint8))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=picture)
    box = trimesh.creation.box((1, 1, 1))
    box.visual = trimesh.visual.TextureVisuals(np.zeros((len(box.vertices), 2)), material=material)
    for name in ("a.glb", "b.glb"):
        (tmp_path / name).write_bytes(box.export(file_type="glb"))
    monkeypatch.setattr("deeplight.compose.textures.KEPT_TEXTURE_PX", 30)
    (kept,) = load(str(tmp_path / "a.glb"))
    assert kept.finish.colour_map is not None
    assert kept.finish.colour_map.shape == (22, 11, 3)
    monkeypatch.setattr("deeplight.compose.textures.MAX_TEXTURE_PX", 50)
    with pytest.raises(ImageFileError, match=r"b\.glb.*32 x 64"):
        load(str(tmp_path / "b.glb"))


def test_a_glb_keeps_its_place_material_and_texture(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    picture = Image.new("RGB", (4, 4), (200, 100, 50))
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=picture, roughnessFactor=0.25, metallicFactor=0.75
    )
    box = trimesh.creation.box((1, 2, 3))
    box.visual = trimesh.visual.TextureVisuals(np.zeros((len(box.vertices), 2)), material=material)
    scene = trimesh.Scene()
    scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    path = tmp_path / "box.glb"
    path.write_bytes(scene.export(file_type="glb"))
    (mesh,) = load(str(path))
    assert mesh.vertices.mean(0)[0] == pytest.approx(5)
    assert (mesh.finish.roughness, mesh.finish.metallic) == (0.25, 0.75)
    assert mesh.finish.colour_map is not None
    assert mesh.finish.colour_map[0, 0].tolist() == [200, 100, 50]
    assert not mesh.finish.lost


def test_a_sharp_edged_part_keeps_a_colour_without_texture(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((1, 2, 3))
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[51, 102, 255, 255], roughnessFactor=0.5, metallicFactor=0.25
    )
    box.visual = trimesh.visual.TextureVisuals(material=material)
    path = tmp_path / "box.glb"
    path.write_bytes(box.export(file_type="glb"))
    (mesh,) = load(str(path))
    assert mesh.finish.colour == pytest.approx((0.2, 0.4, 1.0))
    assert (mesh.finish.roughness, mesh.finish.metallic) == (0.5, 0.25)


def test_colours_of_faces_are_kept(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((1, 1, 1))
    box.visual.face_colors = np.arange(12)[:, None] * [20, 10, 0, 0] + [0, 0, 0, 255]
    box.export(tmp_path / "box.ply")
    (mesh,) = load(str(tmp_path / "box.ply"))
    assert mesh.colours is not None
    of_faces = mesh.colours[mesh.faces]
    assert np.ptp(of_faces, axis=1).max() < 1e-6
    assert len(np.unique(of_faces[:, 0, 0].round(4))) == 12


def test_a_texture_that_cannot_be_read_is_reported(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    content = "mtllib none.mtl\nusemtl x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (mesh,) = load(text(content, "board.obj", tmp_path))
    assert mesh.finish.lost
    camera = Viewpoint(PinholeCamera(64, 48, 1.0), pitch_rad=-0.5)
    _, notes = placed(camera, [Item(str(tmp_path / "board.obj"))])
    assert any("could not be read" in note for note in notes)
    (mesh,) = load(text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "plain.obj", tmp_path))
    assert not mesh.finish.lost


@pytest.mark.parametrize(
    "wrong", [{"material": "gold"}, {"size_m": -1.0}, {"up": "x"}, {"material": "file"}]
)
def test_a_wrong_item_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        Item("bunny", **wrong)


def iphone_photo(up: np.ndarray, orientation: int, path: Path) -> Path:
    """A photo whose maker note says that `up` (camera frame of the upright picture) is up."""
    x, y = up[:2]
    phone = {1: (y, -x), 3: (-y, x), 6: (x, y), 8: (-x, -y)}[orientation]
    note = b"Apple iOS\0\0\x01MM" + struct.pack(">HHHII", 1, 8, 10, 3, 32) + bytes(4)
    for value in (*phone, up[2]):
        note += struct.pack(">ii", round(-value * 10_000), 10_000)
    exif = Image.Exif()
    exif[0x0112] = orientation
    exif.get_ifd(0x8769)[0x927C] = note
    Image.new("RGB", (64, 48)).save(path, exif=exif)
    return path


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
@pytest.mark.parametrize(("pitch", "roll"), [(-0.4, 0.1), (0.3, -0.2), (0.0, 0.0)])
def test_an_iphones_tilt_is_read(
    orientation: int, pitch: float, roll: float, tmp_path: Path
) -> None:
    up = world_from_camera(1.0, pitch, roll).T @ UP
    tilt = tilt_of(iphone_photo(up, orientation, tmp_path / "photo.jpg"))
    assert tilt is not None
    assert (tilt.pitch_rad, tilt.roll_rad) == pytest.approx((pitch, roll), abs=1e-3)


def elevated(path: Path, value: object) -> Path:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0x9405] = value
    Image.new("RGB", (64, 48)).save(path, exif=exif)
    return path


def test_the_cameras_elevation_is_read_where_it_is_known(tmp_path: Path) -> None:
    known = tilt_of(elevated(tmp_path / "a.jpg", TiffImagePlugin.IFDRational(-25, 2)))
    assert known is not None
    assert known.pitch_rad == pytest.approx(np.radians(-12.5))
    content = (tmp_path / "a.jpg").read_bytes()
    packed = struct.pack(">2i", -25, 2)
    assert content.count(packed) == 1
    (tmp_path / "a.jpg").write_bytes(content.replace(packed, struct.pack(">2I", 0, 0xFFFFFFFF)))
    assert tilt_of(tmp_path / "a.jpg") is None
    assert tilt_of(elevated(tmp_path / "b.jpg", "n/a")) is None


def test_an_iphones_heic_is_read_with_the_cameras_own_orientation(tmp_path: Path) -> None:
    heif = pytest.importorskip("pillow_heif")
    up = world_from_camera(1.0, -0.3, 0.1).T @ UP
    iphone_photo(up, 6, tmp_path / "photo.jpg")
    with Image.open(tmp_path / "photo.jpg") as picture:
        exif = picture.getexif().tobytes()
        heif.from_pillow(picture).save(tmp_path / "photo.heic", exif=exif)
    tilt = tilt_of(tmp_path / "photo.heic")
    assert tilt is not None
    assert (tilt.pitch_rad, tilt.roll_rad) == pytest.approx((-0.3, 0.1), abs=1e-3)


@pytest.mark.parametrize("name", ["text", "unknown"])
def test_elevations_of_other_programs_are_unknown(name: str, cases: Path) -> None:
    assert tilt_of(cases / f"sound/exif_elevation_{name}.jpg") is None


def test_no_tilt_is_invented(tmp_path: Path) -> None:
    Image.new("RGB", (64, 48)).save(tmp_path / "plain.jpg")
    assert tilt_of(tmp_path / "plain.jpg") is None
    assert tilt_of(tmp_path / "missing.jpg") is None
    assert tilt_of(None) is None
    shaken = iphone_photo(np.array([0.0, 3.0, 0.0]), 6, tmp_path / "shaken.jpg")
    assert tilt_of(shaken) is None


def test_grain_is_measured_and_given_back() -> None:
    x = np.linspace(60, 180, 256)
    clean = np.stack([np.tile(x, (192, 1))] * 3, -1)
    noisy = (clean + RNG.normal(0, [2.0, 3.0, 5.0], clean.shape)).round().astype(np.uint8)
    look = look_of(noisy)
    assert np.sqrt(np.diag(look.grain)) * 255 == pytest.approx([2, 3, 5], rel=0.15)
    given = grain(look, 100, 100, seed=1).std((0, 1))
    assert given == pytest.approx(np.sqrt(np.diag(look.grain)), rel=0.05)
    assert np.sqrt(np.diag(look_of(clean.astype(np.uint8)).grain)).max() * 255 < 1


@pytest.mark.parametrize("sigma", [0.0, 0.8, 1.6])
def test_blur_is_measured(sigma: float) -> None:
    y, x = np.mgrid[:800, :800] / 4
    edges = (np.sin(x / 9 + y / 23) > 0) * 150.0 + 50
    fine = np.repeat(edges[..., None], 3, -1).reshape(200, 4, 200, 4, 3).mean((1, 3))
    photo = blurred(fine, sigma).round().astype(np.uint8)
    assert look_of(photo).blur_px == pytest.approx(sigma, abs=0.25)


def test_denoising_borrows_from_like_surface_only() -> None:
    cover = np.ones((12, 20))
    cover[:, 16:] = 0
    normal = np.zeros((12, 20, 3))
    normal[:, :8, 0], normal[:, 8:, 1] = 1, 1
    clean = (
        np.where(np.arange(20)[:, None] < 8, [0.2, 0.4, 0.6], [2.0, 1.0, 0.5]) * cover[..., None]
    )
    assert denoised(clean, cover, normal * cover[..., None]) == pytest.approx(clean, abs=1e-6)
    noisy = clean + RNG.normal(0, 0.05, clean.shape) * cover[..., None]
    error = denoised(noisy, cover, normal * cover[..., None]) - clean
    assert error.std() < 0.35 * (noisy - clean).std()


def layers_of(height: int, width: int, crop: tuple[int, int, int, int]) -> Layers:
    cover = RNG.random((height, width)).astype(np.float32)
    radiance = RNG.random((height, width, 3)).astype(np.float32) * cover[..., None]
    return Layers(crop, radiance, cover, RNG.random((height, width, 3)).astype(np.float32))


def test_the_layers_file_gives_the_picture_back(tmp_path: Path) -> None:
    import OpenImageIO as oiio

    photo = RNG.integers(0, 250, (40, 50, 3), np.uint8)
    layers = layers_of(20, 30, (5, 10, 35, 30))
    write_layers(tmp_path / "a.exr", layers, 40, 50)
    file = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    names, values = file.spec().channelnames, file.read_image()
    file.close()
    get = {name: values[..., i] for i, name in enumerate(names)}
    assert (get["A"] == get["mask.Y"]).all()
    rgb = np.stack([get[c] for c in "RGB"], -1)
    shadow = np.stack([get[f"shadow.{c}"] for c in "RGB"], -1)
    linear = radiance_of(photo) * shadow * (1 - get["A"][..., None]) + rgb
    from deeplight.compose.composite import RESPONSE

    expected = RESPONSE.pixel_from_radiance(linear.astype(np.float32)) * 255
    assert np.abs(composite(photo, layers).pixels - expected).max() <= 0.51


def test_layers_must_be_exr(tmp_path: Path) -> None:
    with pytest.raises(ImageFileError):
        write_layers(tmp_path / "a.png", layers_of(2, 2, (0, 0, 2, 2)), 4, 4)


def fake_probe(returncode: int, calls: list[Any]) -> Any:
    def run(command: list[str], **_: Any) -> SimpleNamespace:
        calls.append(command)
        return SimpleNamespace(returncode=returncode)

    return run


@pytest.mark.parametrize(("returncode", "works"), [(0, True), (-6, False), (1, False)])
def test_llvm_is_tried_once_in_a_child_process(
    returncode: int, works: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []
    monkeypatch.setattr(subprocess, "run", fake_probe(returncode, calls))
    engine.llvm_works.cache_clear()
    assert engine.llvm_works() is works
    assert engine.llvm_works() is works
    assert len(calls) == 1
    if not works:
        with pytest.raises(ConfigError):
            engine.mitsuba("llvm")
        assert engine.mitsuba("auto").variant() == "scalar_rgb"
    engine.llvm_works.cache_clear()


def test_a_panorama_as_light_keeps_its_direction(tmp_path: Path) -> None:
    from deeplight.io.lighting_file import VIEW_U
    from deeplight.io.radiance import write_exr

    panorama = np.full((16, 32, 3), 0.1, np.float32)
    panorama[4, 24] = 100  # right of the view
    write_exr(tmp_path / "ours.exr", panorama)
    write_exr(tmp_path / "turned.exr", np.roll(panorama, -8, axis=1), {VIEW_U: 0.25})
    for name in ("ours.exr", "turned.exr"):
        assert read_environment(tmp_path / name).radiance == pytest.approx(panorama)
    write_exr(tmp_path / "narrow.exr", panorama[:, :20])
    with pytest.raises(ImageFileError):
        read_environment(tmp_path / "narrow.exr")
    write_exr(tmp_path / "black.exr", panorama * 0)
    with pytest.raises(ImageFileError):
        read_environment(tmp_path / "black.exr")

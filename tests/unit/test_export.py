"""Each format of light out: what it holds, read back by other means than the writer's."""

import base64
import io
import json
import runpy
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from deeplight.environment import Environment
from deeplight.errors import InputError, ShapeError
from deeplight.formats.files import FileSpec, write_environment
from deeplight.formats.gltf import rgbd
from deeplight.formats.labelled import LABELS, LAMP_DIRECTION, LAMP_RADIUS_DEG, labelled_environment
from deeplight.formats.webxr import light_estimate_file
from deeplight.harmonics import CONDON_SHORTLEY, basis, irradiance
from deeplight.io.gain_map import write_gain_map_jpeg
from deeplight.io.orientation import GLTF_SIGN, TOOLS, faces_for, turned_for, turned_from
from deeplight.io.radiance import read_hdr
from deeplight.mappings import cube, latlong
from deeplight.mappings.layouts import cube_from_latlong


@pytest.fixture(scope="module")
def environment() -> Environment:
    return labelled_environment(128)


def irradiance_of(environment: Environment, normals: np.ndarray) -> np.ndarray:
    """E by the sum over all of the panorama: what every split must add up to."""
    height, width, _ = environment.radiance.shape
    directions = latlong.directions(height, width).reshape(-1, 3)
    power = environment.radiance.reshape(-1, 3) * latlong.solid_angles(height, width).reshape(-1, 1)
    return np.maximum(normals @ directions.T, 0) @ power


def whole_sphere() -> np.ndarray:
    return latlong.directions(8, 16).reshape(-1, 3)


def test_the_labelled_panorama_has_each_colour_and_lamp_where_it_says(environment) -> None:
    for name, (_, colour) in LABELS.items():
        forward = np.eye(3)["xyz".index(name[1])] * float(f"{name[0]}1")
        aside = forward + 0.8 * (forward == 0)  # in a corner, next to the letters
        row, column = latlong.position((aside / np.linalg.norm(aside))[None], 128, 256)
        seen = environment.radiance[round(row[0]), round(column[0]) % 256]
        np.testing.assert_allclose(seen, colour, atol=0.01)
    light = environment.main_light
    assert light.direction @ LAMP_DIRECTION > np.cos(np.radians(2))
    assert np.degrees(light.angular_radius_rad) == pytest.approx(LAMP_RADIUS_DEG, rel=0.2)
    np.testing.assert_allclose(light.colour, [1, 0.9, 0.75], atol=0.08)  # the walls add theirs


def test_webxr_file_names_its_sign_and_splits_the_light(environment) -> None:
    """E(harmonics) + E(main) = E(all), everywhere the order-2 harmonics can follow."""
    content = light_estimate_file(environment.lighting, environment.main_light)
    assert "Condon-Shortley" in content["about"]["sign"]
    coefficients = np.array(content["sphericalHarmonicsCoefficients"]).reshape(9, 3)
    toward = np.array([content["primaryLightDirection"][axis] for axis in "xyz"])
    intensity = np.array([content["primaryLightIntensity"][axis] for axis in "xyz"])
    normals = whole_sphere()
    split = irradiance((coefficients * CONDON_SHORTLEY[:, None]).astype(np.float32), normals)
    split = split + np.maximum(normals @ toward, 0)[:, None] * intensity
    whole = irradiance_of(environment, normals)
    assert np.abs(split - whole).mean() < 0.02 * whole.mean()
    # The twin: coefficients taken in the other sign are far off.
    wrong = irradiance(coefficients.astype(np.float32), normals)
    wrong = wrong + np.maximum(normals @ toward, 0)[:, None] * intensity
    assert np.abs(wrong - whole).mean() > 0.1 * whole.mean()


def test_webxr_cube_is_opengls(environment) -> None:
    content = light_estimate_file(environment.lighting)["reflectionCubeMap"]
    faces = [
        np.frombuffer(base64.b64decode(face), "<f4").reshape(content["size"], -1, 3)
        for face in content["data"]
    ]
    assert content["faces"] == ["+X", "-X", "+Y", "-Y", "+Z", "-Z"]
    # OpenGL's table: on +X, s runs along -Z and t along -Y.
    ours = environment.lighting.cube(content["size"])
    np.testing.assert_allclose(faces[0], ours[0][:, ::-1], rtol=1e-5)
    np.testing.assert_allclose(faces[2], ours[2][::-1], rtol=1e-5)


def opengl_face(direction: np.ndarray) -> tuple[int, float, float]:
    """OpenGL 4.6, table 8.19: which face a vector hits, and (s, t) from its first texel."""
    x, y, z = direction
    axis = int(np.abs(direction).argmax())
    major = abs(direction[axis])
    sc, tc = {
        (0, True): (-z, -y), (0, False): (z, -y), (1, True): (x, z), (1, False): (x, -z),
        (2, True): (x, -y), (2, False): (-x, -y),
    }[axis, bool(direction[axis] > 0)]  # fmt: skip
    face = 2 * axis + int(direction[axis] < 0)
    return face, (sc / major + 1) / 2, (tc / major + 1) / 2


@pytest.mark.parametrize(("tool", "x_sign"), [("webxr", 1), ("three", -1)])
def test_cube_faces_hold_each_direction_where_the_tool_looks_it_up(tool, x_sign) -> None:
    size = 32
    faces = faces_for(cube.directions(size).astype(np.float32), tool)
    for direction in whole_sphere():
        face, s, t = opengl_face(direction * [x_sign, 1, 1])  # three.js negates x
        seen = faces[face][min(int(t * size), size - 1), min(int(s * size), size - 1)]
        assert seen @ direction > np.cos(np.radians(5))
    np.testing.assert_array_equal(faces_for(faces, tool), cube.directions(size).astype(np.float32))


def test_ktx2_says_what_it_holds_and_holds_opengls_faces(environment, tmp_path: Path) -> None:
    (path,) = write_environment(environment, FileSpec(tmp_path / "light.ktx2", size=32))
    data = path.read_bytes()
    assert data[:12] == bytes.fromhex("AB4B5458203230BB0D0A1A0A")
    form, _, width, height, depth, layers, faces, levels, packed = struct.unpack_from(
        "<9I", data, 12
    )
    assert (form, width, height, depth, layers, faces, levels, packed) == (
        109,
        32,
        32,
        0,
        0,
        6,
        1,
        0,
    )
    at, length, whole = struct.unpack_from("<3Q", data, 80)
    assert at % 16 == 0
    assert length == whole == len(data) - at == 6 * 32 * 32 * 16
    stored = np.frombuffer(data, "<f4", offset=at).reshape(6, 32, 32, 4)
    assert (stored[..., 3] == 1).all()
    ours = cube_from_latlong(environment.radiance, 32)
    for direction in whole_sphere():
        face, s, t = opengl_face(direction)
        column, row = min(int(s * 32), 31), min(int(t * 32), 31)
        aimed = (cube.directions(32) @ direction).argmax()  # the texel of ours that looks there
        expected = ours.reshape(-1, 3)[aimed]
        assert stored[face, row, column, :3] == pytest.approx(expected, rel=0.02), direction


@pytest.mark.parametrize("tool", TOOLS)
def test_turning_for_a_tool_is_undone(tool, environment) -> None:
    back = turned_from(turned_for(environment.radiance, tool), tool)
    np.testing.assert_array_equal(back, environment.radiance)


@pytest.fixture(scope="module")
def document(environment, tmp_path_factory) -> dict[str, Any]:
    """The glTF as JSON."""
    spec = FileSpec(tmp_path_factory.mktemp("gltf") / "light.gltf")
    (path,) = write_environment(environment, spec)
    return json.loads(path.read_text())


def test_gltf_splits_the_light_and_the_lamp_shines_from_its_direction(
    environment, document
) -> None:
    (image,) = document["extensions"]["EXT_lights_image_based"]["lights"]
    (punctual,) = document["extensions"]["KHR_lights_punctual"]["lights"]
    x, y, z, w = document["nodes"][0]["rotation"]
    shines = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]) * -1
    np.testing.assert_allclose(-shines, LAMP_DIRECTION, atol=0.03)
    positive = np.array(image["irradianceCoefficients"]) * GLTF_SIGN[:, None]
    normals = whole_sphere()
    whole = irradiance_of(environment, normals)
    main = np.array(punctual["color"]) * punctual["intensity"]
    split = basis(normals) @ positive + np.maximum(normals @ -shines, 0)[:, None] * main
    assert np.abs(split - whole).mean() < 0.02 * whole.mean()
    np.testing.assert_allclose(
        positive, image["extras"]["irradianceCoefficientsAllPositive"], rtol=1e-6
    )


def test_gltf_mips_halve_and_keep_the_mean(document) -> None:
    (image,) = document["extensions"]["EXT_lights_image_based"]["lights"]
    sizes, means = [], []
    for mip in image["specularImages"]:
        faces = []
        for index in mip:
            packed = document["images"][index]["uri"].partition(",")[2]
            pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(packed))), float) / 255
            faces.append(pixels[..., :3] ** 2.2 / pixels[..., 3:])
        size = len(faces[0])
        sizes.append(size)
        means.append(np.einsum("fijc,ij->c", np.array(faces), cube.solid_angles(size)))
    assert sizes == [128, 64, 32, 16]
    assert image["specularImageSize"] == 128
    for mean in means[1:]:
        np.testing.assert_allclose(mean, means[0], rtol=0.03)


def test_glb_is_the_same_document_with_its_pictures_behind_it(
    environment, document, tmp_path
) -> None:
    (path,) = write_environment(environment, FileSpec(tmp_path / "light.glb"))
    content = path.read_bytes()
    assert struct.unpack("<4sII", content[:12]) == (b"glTF", 2, len(content))
    size = struct.unpack("<I", content[12:16])[0]
    inside = json.loads(content[20 : 20 + size])
    assert inside["extensions"] == document["extensions"]
    binary = content[28 + size :]
    for image, view in zip(document["images"], inside["bufferViews"], strict=True):
        png = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        assert png == base64.b64decode(image["uri"].partition(",")[2])


def test_rgbd_holds_radiance_to_a_few_percent() -> None:
    radiance = np.geomspace(0.01, 200, 64 * 3).reshape(8, 8, 3).astype(np.float32)
    packed = rgbd(radiance).astype(float) / 255
    back = packed[..., :3] ** 2.2 / packed[..., 3:]
    bright = radiance > 0.1 * radiance.max(axis=-1, keepdims=True)
    np.testing.assert_allclose(back[bright], radiance[bright], rtol=0.05)


def test_gain_map_jpeg_opens_as_a_picture_and_gives_the_radiance_back(tmp_path) -> None:
    radiance = labelled_environment(64).radiance * [1, 1, 1.2]
    path = tmp_path / "light.jpg"
    write_gain_map_jpeg(path, radiance.astype(np.float32))
    content = path.read_bytes()
    second = content.index(b"\xff\xd8\xff", 2)
    base, gains = (
        np.asarray(Image.open(io.BytesIO(part)), float) / 255
        for part in (content, content[second:])
    )
    assert base.shape == gains.shape == (64, 128, 3)
    tags = {}
    for name in ("GainMapMin", "GainMapMax", "OffsetSDR", "OffsetHDR"):
        tags[name] = float(content[second:].split(f'hdrgm:{name}="'.encode())[1].split(b'"')[0])
    linear = np.where(base <= 0.04045, base / 12.92, ((base + 0.055) / 1.055) ** 2.4)
    stops = tags["GainMapMin"] + gains * (tags["GainMapMax"] - tags["GainMapMin"])
    back = (linear + tags["OffsetSDR"]) * 2**stops - tags["OffsetHDR"]
    error = np.abs(back - radiance) / (radiance + 0.05)
    assert np.median(error) < 0.03
    lamp = radiance.max(axis=-1) > 40
    np.testing.assert_allclose(back[lamp].mean(axis=0), radiance[lamp].mean(axis=0), rtol=0.1)
    # MPF: the second picture is where the directory says.
    header = content.index(b"MPF\0") + 4
    size, offset = struct.unpack(">II", content[header + 70 : header + 78])
    assert (header + offset, size) == (second, len(content) - second)


def test_a_blender_script_is_python_and_its_exr_is_turned(environment, tmp_path) -> None:
    exr, script = write_environment(environment, FileSpec(tmp_path / "my light.py"))
    compile(script.read_text(), str(script), "exec")
    assert f'ENVIRONMENT = "{exr.name}"' in script.read_text()
    np.testing.assert_array_equal(read_hdr(exr), turned_for(environment.radiance, "blender"))
    with pytest.raises(ModuleNotFoundError, match="bpy"):
        runpy.run_path(str(script))


def test_a_three_module_has_its_light_in_the_all_positive_sign(environment, tmp_path) -> None:
    exr, module = write_environment(environment, FileSpec(tmp_path / "light.js"))
    text = module.read_text()
    assert "@" not in text.replace("@augments", "")
    light = json.loads(text.split("mainLight = ")[1].split(";")[0])
    np.testing.assert_allclose(light["direction"], environment.main_light.direction, rtol=1e-6)
    np.testing.assert_array_equal(read_hdr(exr), turned_for(environment.radiance, "three"))


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ({"path": Path("light.tga")}, "--format"),
        ({"path": Path("a.glb"), "mapping": "cross"}, "picture"),
        ({"path": Path("a.exr"), "mapping": "cross", "made_for": "blender"}, "latlong or a cube"),
        ({"path": Path("a.exr"), "size": 3}, "size"),
        ({"path": Path("a.dat"), "format": "exr"}, "ending in .exr"),
        ({"path": Path("a.exr"), "format": "json"}, "ending in .json"),
        ({"path": Path("a.exr"), "size": 99999}, "size"),
        ({"path": Path("a.exr"), "size": 65}, "even"),
    ],
)
def test_impossible_wishes_are_refused(spec, said) -> None:
    with pytest.raises(InputError, match=said):
        FileSpec(**spec)


def test_a_cube_for_a_tool_that_takes_none_is_refused(environment, tmp_path) -> None:
    with pytest.raises(InputError, match="latlong"):
        write_environment(
            environment, FileSpec(tmp_path / "a.exr", mapping="cube", made_for="unity")
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("radiance", "said"),
    [
        (np.ones((8, 17, 3)), "twice as wide"),
        (np.full((8, 16, 3), np.nan), "finite"),
        (np.full((8, 16, 3), -1.0), "negative"),
        (np.zeros((8, 16, 3)), "black"),
    ],
)
def test_what_is_no_light_is_refused(radiance, said) -> None:
    with pytest.raises(ShapeError, match=said):
        Environment(radiance)


def test_a_little_ringing_is_let_through_as_black() -> None:
    radiance = np.ones((8, 16, 3))
    radiance[0, 0] = -0.5
    assert Environment(radiance).radiance.min() == 0


def test_faces_come_from_the_panorama(environment) -> None:
    faces = cube_from_latlong(environment.radiance, 16)
    mean = np.einsum("fijc,ij->c", faces, cube.solid_angles(16)) / (4 * np.pi)
    weights = latlong.solid_angles(128, 256) / (4 * np.pi)
    np.testing.assert_allclose(
        mean, np.einsum("ijc,ij->c", environment.radiance, weights), rtol=0.03
    )

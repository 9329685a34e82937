"""Small good files of every format that is read, made here: nothing is fetched or shipped."""

import base64
import io
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, features

from deeplight.io.gain_map import write_gain_map_jpeg
from deeplight.io.lighting_file import save_lighting
from deeplight.io.radiance import write_exr, write_hdr
from deeplight.io.video_writer import VideoWriter
from deeplight.lighting import Lighting
from lab.fuzz.dng import write_dng
from lab.fuzz.seeds_kept import GOLDEN, KEPT, written

SIDE = 48
_rng = np.random.default_rng(18)
PIXELS = (_rng.random((SIDE, SIDE, 3)) * 255).astype(np.uint8)
PANORAMA = _rng.random((32, 64, 3)).astype(np.float32)


def _picture(format_: str, mode: str = "RGB", **options: Any) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        exif = Image.Exif()
        exif[0x0112] = 6
        exif.get_ifd(0x8769).update({0x920A: 4.2, 0xA405: 26})
        more = {"exif": exif} if format_ in ("JPEG", "PNG", "WEBP", "AVIF", "HEIF") else {}
        Image.fromarray(PIXELS).convert(mode).save(path, format_, **more, **options)

    return write


def _heif(path: Path) -> None:
    import pillow_heif

    pillow_heif.register_heif_opener()
    _picture("HEIF")(path)


def _video(codec: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        pixels: np.ndarray = np.tile(PIXELS, (2, 2, 1))[:64, :64]
        if codec == "libx265":
            pixels = pixels.astype(np.uint16) * 257
        with VideoWriter(path, 64, 64, 30, codec, rotation_deg=90) as video:
            for number in range(4):
                video.write(np.roll(pixels, number, axis=0))

    return write


def _container(codec: str, **options: str) -> Callable[[Path], None]:
    """A film in another container than the program's own writer makes."""

    def write(path: Path) -> None:
        import av

        with av.open(str(path), "w") as file:
            stream: Any = file.add_stream(codec, rate=30)
            stream.width = stream.height = 64
            stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            stream.options = options
            stream.codec_context.thread_count = 1
            for number in range(4):
                pixels = np.roll(np.tile(PIXELS, (2, 2, 1))[:64, :64], number, axis=0)
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), "rgb24")
                file.mux(stream.encode(frame))
            file.mux(stream.encode())

    return write


def _panorama_photo(path: Path) -> None:
    xmp = b'http://ns.adobe.com/xap/1.0/\0<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
    xmp += b'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description '
    xmp += b'xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" '
    sizes = {"CroppedAreaImageWidthPixels": 192, "CroppedAreaImageHeightPixels": 96,
             "FullPanoWidthPixels": 192, "FullPanoHeightPixels": 96,
             "CroppedAreaLeftPixels": 0, "CroppedAreaTopPixels": 0}  # fmt: skip
    xmp += b"".join(b'GPano:%s="%d" ' % (name.encode(), size) for name, size in sizes.items())
    xmp += b'GPano:ProjectionType="equirectangular"/></rdf:RDF></x:xmpmeta>'
    file = io.BytesIO()
    Image.fromarray(np.tile(PIXELS, (2, 4, 1))).save(file, "JPEG")
    segment = b"\xff\xe1" + struct.pack(">H", 2 + len(xmp)) + xmp
    path.write_bytes(file.getvalue()[:2] + segment + file.getvalue()[2:])


def _float_tif(path: Path) -> None:
    import OpenImageIO as oiio

    file: Any = oiio.ImageOutput.create(str(path))
    file.open(str(path), oiio.ImageSpec(64, 32, 3, "float"))
    file.write_image(PANORAMA)
    file.close()


def _layers(path: Path) -> None:
    import OpenImageIO as oiio

    names = [f"ViewLayer.{layer}.{c}" for layer in ("Combined", "DiffCol") for c in "RGB"]
    spec = oiio.ImageSpec(64, 32, 6, "half")
    spec.channelnames = names
    file: Any = oiio.ImageOutput.create(str(path))
    file.open(str(path), spec)
    file.write_image(np.concatenate([PANORAMA, PANORAMA], axis=-1))
    file.close()


def _dng(path: Path) -> None:
    write_dng(path, PIXELS.astype(np.float32) / 255, thumbnail=True)


def _lighting(path: Path) -> None:
    ball = _rng.random((8, 8, 3)).astype(np.float32)
    save_lighting(Lighting(ball), path.with_suffix(""), latlong=PANORAMA)


def glb(json_: dict[str, Any], buffer: bytes) -> bytes:
    """Pack a glTF document and its buffer into one file."""
    text = json.dumps(json_).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + struct.pack("<II", 2, 28 + len(text) + len(buffer))
    chunks = struct.pack("<I", len(text)) + b"JSON" + text
    return head + chunks + struct.pack("<I", len(buffer)) + b"BIN\0" + buffer


def _gltf() -> tuple[dict[str, Any], bytes]:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.array([0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2], np.uint16)
    picture = io.BytesIO()
    Image.fromarray(PIXELS[:4, :4]).save(picture, "PNG")
    arrays: list[tuple[Any, str, Any]] = [
        (points, "VEC3", {}), (faces, "SCALAR", {}), (points[:, :2].copy(), "VEC2", {}),
        (np.full((4, 4), 128, np.uint8), "VEC4", {"normalized": True}),
        (np.zeros((4, 4), np.uint8), "VEC4", {}),
        (np.tile(np.array([1, 0, 0, 0], np.float32), (4, 1)), "VEC4", {}),
    ]  # fmt: skip
    kinds = {"float32": 5126, "uint16": 5123, "uint8": 5121}
    buffer, views, accessors = b"", [], []
    for values, kind, more in arrays:
        views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": values.nbytes})
        entry = {"bufferView": len(views) - 1, "componentType": kinds[str(values.dtype)]}
        accessors.append({**entry, "count": len(values), "type": kind, **more})
        buffer += values.tobytes()
    views.append({"buffer": 0, "byteOffset": len(buffer), "byteLength": picture.tell()})
    buffer += picture.getvalue()
    buffer += bytes(-len(buffer) % 4)
    names = {"POSITION": 0, "TEXCOORD_0": 2, "COLOR_0": 3, "JOINTS_0": 4, "WEIGHTS_0": 5}
    moved = {"extensions": {"KHR_texture_transform": {"scale": [2, 2], "rotation": 1.0}}}
    sparse = {
        "count": 1,
        "indices": {"bufferView": 1, "componentType": 5123},
        "values": {"bufferView": 0},
    }
    primitive = {"attributes": names, "indices": 1, "material": 0, "targets": [{"POSITION": 6}]}
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0, "skin": 0}, {"rotation": [0, 0, 0, 1], "children": [2]},
                  {"mesh": 0, "scale": [1, 2, -1], "translation": [3, 0, 0]}],
        "meshes": [{"primitives": [primitive], "weights": [0.5]}],
        "skins": [{"joints": [1, 2]}],
        "accessors": [*accessors, {"componentType": 5126, "count": 4, "type": "VEC3",
                                   "sparse": sparse}],
        "bufferViews": views, "buffers": [{"byteLength": len(buffer)}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **moved},
                                                "baseColorFactor": [1, 0.5, 0.5, 1]}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": len(views) - 1, "mimeType": "image/png"}],
    }, buffer  # fmt: skip


def _glb(path: Path) -> None:
    path.write_bytes(glb(*_gltf()))


def _gltf_text(path: Path) -> None:
    document, buffer = _gltf()
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    document["buffers"][0]["uri"] = uri
    path.write_text(json.dumps(document))


OBJ = b"mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\n"
OBJ += b"v 0.2 0.2 0\nusemtl a\nf 1/1/1 2/1/1 3/1/1\nf 1 3 4\nf -1 -2 -3\nf 2 5 3 \\\n 1\n"
PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex 4\n"
PLY += b"".join(b"property float %c\n" % axis for axis in b"xyz") + b"property uchar red\n"
PLY += b"property uchar green\nproperty uchar blue\nelement face 2\n"
PLY += b"property list uchar int vertex_indices\nend_header\n"
CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0.2, 0.2, 0))
PLY += b"".join(struct.pack("<fffBBB", *at, 9, 99, 200) for at in CORNERS)
PLY += struct.pack("<Biii", 3, 0, 1, 2) + struct.pack("<Biiii", 4, 1, 3, 2, 0)  # not convex


def _npz(path: Path) -> None:
    np.savez_compressed(path, a=PANORAMA, b=np.arange(5), provenance=np.array("{}"), version=1)


def _onnx(path: Path) -> None:
    import onnx
    from onnx import helper, numpy_helper

    from deeplight.contract import CONTRACT_KEY, ModelContract

    contract = ModelContract(width=6, height=8, output_size=4)
    shape = numpy_helper.from_array(np.array([1, 3, 4, 4], np.int64), "shape")
    name = contract.input_name
    nodes = [
        helper.make_node("ReduceMean", [name], ["mean"]),
        helper.make_node("Expand", ["mean", "shape"], [contract.output_name]),
    ]
    photo = helper.make_tensor_value_info(name, 1, ["n", 3, 8, 6])
    light = helper.make_tensor_value_info(contract.output_name, 1, ["n", 3, 4, 4])
    graph = helper.make_graph(nodes, "graph", [photo], [light], [shape])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    entry = model.metadata_props.add()
    entry.key, entry.value = CONTRACT_KEY, contract.to_json()
    onnx.save(model, str(path))


SEEDS: dict[str, Callable[[Path], None]] = {
    "png": _picture("PNG"),
    "rgba.png": _picture("PNG", "RGBA"),
    "palette.png": _picture("PNG", "P"),
    "jpg": _picture("JPEG", icc_profile=None),
    "webp": _picture("WEBP"),
    "tif": _picture("TIFF", compression="tiff_lzw"),
    "gif": _picture("GIF", "P"),
    "bmp": _picture("BMP"),
    "jp2": _picture("JPEG2000"),
    "avif": _picture("AVIF"),
    "heic": _heif,
    "exr": lambda path: write_exr(path, PANORAMA),
    "hdr": lambda path: write_hdr(path, PANORAMA),
    "gain.jpg": lambda path: write_gain_map_jpeg(path, np.repeat(np.repeat(PANORAMA, 2, 0), 2, 1)),
    "mp4": _video("libx264"),
    "hevc.mp4": _video("libx265"),
    "light.json": _lighting,
    "npz": _npz,
    "glb": _glb,
    "obj": written(OBJ),
    "ply": written(PLY),
    "onnx": _onnx,
    "pano.jpg": _panorama_photo,
    "float.tif": _float_tif,
    "layers.exr": _layers,
    "dng": _dng,
    "mov": _container("mpeg4"),
    "mkv": _container("libx264", preset="ultrafast"),
    "webm": _container("libvpx-vp9", deadline="realtime"),
    "avi": _container("mjpeg"),
    "gltf": _gltf_text,
    **KEPT,
}
"""Format -> a function that writes a good file of it."""

PACKAGES = {
    "heic": "pillow_heif", "onnx": "onnx", "npz": "torch", "safetensors": "torch", "dng": "rawpy",
    "session.npz": "cv2", "transfer": "embreex", "tflite": "ai_edge_litert",
    **dict.fromkeys(("mp4", "hevc.mp4", "mov", "mkv", "webm", "avi"), "av"),
    **dict.fromkeys(("glb", "gltf", "obj", "ply"), "trimesh"),
}  # fmt: skip


def available() -> list[str]:
    """The formats that this installation can write and read."""
    from importlib.util import find_spec

    found = [name for name in SEEDS if find_spec(PACKAGES.get(name, "numpy"))]
    found = [name for name in found if name != "tflite" or (GOLDEN / "tiny.tflite").is_file()]
    wanted = {"avif": "avif", "jp2": "jpg_2000", "webp": "webp"}
    return [name for name in found if name not in wanted or features.check(wanted[name])]

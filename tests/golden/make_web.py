"""Make what the live page shares with Python: python tests/golden/make_web.py.

The constants go to web/packages/deeplight/src/contract/generated.ts, golden values to
web/tests/golden; make_web_scene.py makes those of a photo in its light. Nothing in them is typed by
hand on either side.
"""

import base64
import inspect
import json
import re
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

import numpy as np
from make_nouns import light
from PIL import Image

from deeplight import brdf, camera_response, contract, harmonics, lobe, preprocess
from deeplight.contract import ModelContract
from deeplight.estimators import (
    confidence,
    continuation,
    fill,
    lamps,
    look,
    projection,
    sureness,
    surroundings,
    tilt,
    upright,
    upright_edges,
)
from deeplight.estimators.environment import ITSELF, SceneLight
from deeplight.estimators.network import WHOLE_VIEW, lamps_of
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.results import elsewhere_record, write_results
from deeplight.frames import turned, world_from_camera
from deeplight.fuse import blend, gains, merge, session, steady, view
from deeplight.io import colour, lighting_file
from deeplight.lighting import LIGHTING_SIZE, Lighting
from deeplight.mappings import mirror_ball
from deeplight.relight import relight_rig
from deeplight.sphere import CROP_SIZE, PAPER_RIG
from deeplight.transfer import file as transfer_file

ROOT = Path(__file__).resolve().parents[2]
GENERATED = ROOT / "web/packages/deeplight/src/contract/generated.ts"
PYTHONS_OWN = ("KEPT_UP_TO", "TILE", "TOGETHER", "LEAST_WEIGHT", "BLAS_ALONE")
"""Constants of how numpy is made fast: the page has other ways, and pays for each byte."""
GOLDEN = ROOT / "web/tests/golden"
TURN = world_from_camera(0.7, -0.4, 0.2)


def generated() -> str:
    """The TypeScript file of constants."""
    lines = ["// Made by tests/golden/make_web.py from the Python package. Do not edit."]
    for name, value in constants().items():
        text = json.dumps(value, indent=2, ensure_ascii=False)
        lines.append(f"export const {name} = {text} as const;")
    return "\n\n".join(lines) + "\n"


def constants() -> dict[str, Any]:
    """Every number and word that both sides must know."""
    cone = inspect.signature(harmonics.dominant_light).parameters["cone_rad"].default
    rig = {
        name: {
            "ballFromCamera": view.ball_from_camera.round(12).ravel().tolist(),
            "angularRadiusRad": round(view.angular_radius_rad, 12),
        }
        for name, view in PAPER_RIG.views.items()
    }
    return {
        "CONTRACT_KEY": contract.CONTRACT_KEY,
        "CONTRACT": asdict(ModelContract()),
        "SERVED": dict(contract.SERVED),
        "SINCE_VERSION_2": dict(contract.SINCE_VERSION_2),
        "SINCE_VERSION_3": dict(contract.SINCE_VERSION_3),
        "LIGHTING_SIZE": LIGHTING_SIZE,
        "CROP_SIZE": CROP_SIZE,
        "ASSUMED_LONG_SIDE_FOV_RAD": preprocess.ASSUMED_LONG_SIDE_FOV_RAD,
        "WHOLE_VIEW": WHOLE_VIEW,
        "LEAST_RADIANCE": lobe.LEAST_RADIANCE,
        "SLIDE": {
            "FITS": preprocess.FITS,
            "LEAST": preprocess.LEAST_SLIDE,
            "ROOM": preprocess.ROOM,
            "FARTHEST": preprocess.FARTHEST,
        },
        "AGREEING": {
            "NEARNESS": lobe.NEARNESS,
            "TRUST": lobe.TRUST,
            "LEAST_FLUX": look.LEAST_FLUX,
        },
        "MID_GREY": colour.MID_GREY,
        "GAMMA": camera_response.GAMMA,
        "SOFT_CLIP_N": camera_response.SOFT_CLIP_N,
        "LUMINANCE": camera_response.LUMINANCE.tolist(),
        "REFLECTIVITY": brdf.REFLECTIVITY,
        "MATTE_SILVER_ROUGHNESS": brdf.MATTE_SILVER_ROUGHNESS,
        "PAPER_RIG": rig,
        "MAIN_LIGHT_CONE_RAD": cone,
        "CONDON_SHORTLEY": harmonics.CONDON_SHORTLEY.tolist(),
        "LATLONG_HEIGHT": lighting_file.LATLONG_HEIGHT,
        "LIGHTING_FILE": lighting_file_words(),
        "CONFIDENCE": numbers_of(confidence),
        "SURENESS_LIMITS": sureness.LIMITS,
        "SCENE_FILE": scene_file_words(),
        "TRANSFER": transfer_file.LAYOUT,
        "FUSE": numbers_of(view, gains, blend, merge, steady, session),
        "PHOTO_LIGHT": numbers_of(projection, surroundings, lamps),
        "CONTINUATION": numbers_of(continuation),
        "DETAIL": numbers_of(fill),
        "UPRIGHT": numbers_of(upright),
        "UPRIGHT_EDGES": {"SURE_RAD": tilt.SURE_RAD, **numbers_of(upright_edges)},
    }


def numbers_of(*modules: ModuleType) -> dict[str, Any]:
    """Constants of modules by name, a leading underscore dropped: numbers and tuples of them."""
    found: dict[str, Any] = {}
    for name, value in ((n, v) for module in modules for n, v in vars(module).items()):
        numbers = np.asarray(value if isinstance(value, int | float | tuple) else "")
        if not re.fullmatch("_?[A-Z][A-Z_]*", name) or numbers.dtype.kind not in "if":
            continue
        if name.lstrip("_") in PYTHONS_OWN:
            continue
        if found.setdefault(name.lstrip("_"), numbers.tolist()) != numbers.tolist():
            raise ValueError(f"expected one meaning of {name}, got two")
    return found


def lighting_file_words() -> dict[str, Any]:
    """The entries of a lighting file that are the same for every light."""
    with TemporaryDirectory() as folder:
        white = Lighting(np.ones((LIGHTING_SIZE, LIGHTING_SIZE, 3), np.float32))
        files = lighting_file.save_lighting(white, f"{folder}/white")
        record = json.loads(files[-1].read_text())
    record["environment"]["files"] = []
    for entry in [record, *(record[part] for part in record if isinstance(record[part], dict))]:
        numbers = [key for key, value in entry.items() if _is_result(key, value)]
        for key in numbers:
            entry[key] = None
    return record


def scene_file_words() -> dict[str, Any]:
    """What a lighting file says of lamps and of what a photo shows, whatever these are."""
    lamp_entry = lighting_file.lamps_record((), in_environment=True)
    seen_entry = lighting_file.seen_record(
        np.ones((lighting_file.SEEN_HEIGHT, 2 * lighting_file.SEEN_HEIGHT))
    )
    nothing = np.zeros((1, 2, 3), np.float32)
    words = {
        name: elsewhere_record(SceneLight(nothing, (), nothing[..., 0], detail_of))["elsewhere"]
        for name, detail_of in {"smooth": None, "rows": ITSELF, "invented": "a place"}.items()
    }
    return {
        "lamps": lamp_entry,
        "seen": seen_entry | {"levels": None},
        "itself": ITSELF,
        "elsewhere": words,
    }


def _is_result(key: str, value: Any) -> bool:
    return key in ("radiance", "share_of_power") or (isinstance(value, list) and key != "files")


def light_golden() -> dict[str, Any]:
    """One light and everything that is computed from it."""
    lighting = light()
    main = harmonics.dominant_light(lighting)
    sent = np.random.default_rng(5).normal(size=(40, 3))
    sent /= np.linalg.norm(sent, axis=1, keepdims=True)
    linear = np.array([0, 1e-3, 0.2, 0.8, 0.99, 1, 1.1, 5], float)
    normals = sent[:8]
    return {
        "radiance": packed(lighting.radiance),
        "directions": packed(sent),
        "ball_pixel": mirror_ball.pixel_of_directions(sent, 32).tolist(),
        "ball_uv": packed(np.stack(mirror_ball.uv_from_directions(sent), -1)),
        "pixel_directions_9": packed(mirror_ball.pixel_directions(9)),
        "coverage": {str(n): packed(mirror_ball.coverage(n)) for n in (5, 32)},
        "linear": packed(linear),
        "pixel": packed(camera_response.encode(camera_response.soft_clip(linear))),
        "basis_6": packed(harmonics.basis(sent, 6)),
        "harmonics": {str(n): packed(harmonics.spherical_harmonics(lighting, n)) for n in (2, 6)},
        "irradiance": packed(
            harmonics.irradiance(harmonics.spherical_harmonics(lighting), normals)
        ),
        "turn": TURN.ravel().tolist(),
        "turned": packed(area_turned(lighting, TURN)),
        "turned_harmonics": packed(harmonics.spherical_harmonics(lighting.rotated(TURN))),
        "equirect_16": packed(lighting.latlong(16)),
        "spheres": {n: packed(s) for n, s in relight_rig(PAPER_RIG, lighting).items()},
        "of_16": _light_of_16(lighting),
        "main_light": main_light_record(main),
    }


def main_light_record(main: harmonics.DominantLight) -> dict[str, Any]:
    return {
        "direction": packed(main.direction),
        "irradiance": packed(main.irradiance),
        "share": main.share,
        "angular_radius_rad": main.angular_radius_rad,
        "remainder_harmonics": packed(harmonics.spherical_harmonics(main.remainder)),
    }


def _light_of_16(lighting: Lighting) -> dict[str, Any]:
    """The spheres in the light of a smaller network, every fourth row and column."""
    small = Lighting.from_latlong(lighting.latlong(), size=16)
    spheres = relight_rig(PAPER_RIG, small)
    return {
        "radiance": packed(small.radiance),
        "spheres": {name: packed(sphere[::4, ::4]) for name, sphere in spheres.items()},
    }


def area_turned(lighting: Lighting, new_from_old: np.ndarray) -> np.ndarray:
    """The light turned as the page does it: the mean over 4 x 4 places in each new pixel."""
    directions, inside = mirror_ball.subpixels(lighting.size)
    old = mirror_ball.pixel_of_directions(turned(directions, new_from_old.T), lighting.size)
    seen = lighting.radiance.reshape(-1, 3)[old] * inside[..., None]
    means = seen.sum(axis=1) / np.maximum(inside.sum(axis=1), 1)[:, None]
    return means.reshape(lighting.radiance.shape)


def photo_golden() -> dict[str, Any]:
    """Photos, what the network is shown of them, and the light of one."""
    estimator = OnnxEstimator(threads=1)
    sizes = [(1920, 1080, None), (1080, 1920, None), (600, 800, 0.95), (37, 23, 0.3), (50, 50, 2.4)]
    photo = example_photo()
    framing = preprocess.frame_photo(*photo.shape[:2], contract=estimator.contract)
    shown = preprocess.network_input(photo, framing)
    return {
        "framings": [_framing(*size) for size in sizes],
        "turned": _looks(),
        "averages": [_average(*size) for size in [(37, 23, 0.3), (37, 23, 1.15), (9, 70, 2.0)]],
        "model_sha256": estimator.sha256,
        "photo": {"height": photo.shape[0], "width": photo.shape[1], "rgb": as_text(photo)},
        "shown_every_16th_row": packed(shown[:, ::16]),
        "log_radiance": packed(estimator.estimate_inputs(shown[None])[0]),
        **_record(estimator),
    }


def example_photo() -> np.ndarray:
    """A photo small enough to store."""
    path = sorted((ROOT / "examples/photos").glob("*.jpg"))[0]
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB").reduce(max(picture.size) // 160))


def _framing(height: int, width: int, fov_rad: float | None) -> dict[str, Any]:
    framing = preprocess.frame_photo(height, width, fov_rad)
    shares = {name: getattr(framing, name) for name in ("visible_fraction", "used_fraction")}
    slid = preprocess.slid_into_photo(framing)
    views = preprocess.looks(slid)
    moved, last = ({**asdict(view), "pitch_rad": view.pitch_rad} for view in (slid, views[-1]))
    shown = {"looks": len(views), "last_look": last, "hull": asdict(preprocess.hull(views))}
    return {"given_fov_rad": fov_rad, **asdict(framing), **shares, "slid": moved, **shown}


def _looks() -> dict[str, Any]:
    """Two answers with lamps and a pitch, of views slid in a photo, and as one in its frame."""
    framing = preprocess.frame_photo(300, 400, 0.9)
    views = [framing, framing.slid(40.0, -90.0)]
    numbers = np.array(
        [
            [[0.0, 0.6, -0.8, 1.0, 0.9, 0.8, 0.1], [0.6, -0.0, 0.8, 0.5, 0.6, 0.7, 0.3]],
            [[0.3, 0.7, -0.6, 0.9, 0.7, 0.8, 0.2], [-0.6, 0.8, 0.0, 0.1, 0.3, 0.4, 0.3]],
        ]
    ).astype(np.float32)
    given = []
    for own in map(lamps_of, numbers):
        whole = light().radiance + sum(lobe.lobe_on_ball(lamp) for lamp in own)
        log = np.log(np.maximum(whole, 1e-6)).astype(np.float32)
        given.append(look.Answer(log, own, {"pitch_rad": 0.05 + len(given)}))
    found = look.seen_from_photo(given, views)
    return {
        "views": [asdict(view) for view in views],
        "given": [packed(answer.log_radiance) for answer in given],
        "given_lamps": [packed(own[None]) for own in numbers],
        "given_pitch_rad": [answer.heads["pitch_rad"] for answer in given],
        "log_radiance": packed(found.log_radiance),
        "lamps": [[*lamp.direction, *lamp.flux, lamp.angular_radius_rad] for lamp in found.lamps],
        "head_pitch_rad": found.heads["pitch_rad"],
    }


def _average(height: int, width: int, fov_rad: float) -> dict[str, Any]:
    photo = np.random.default_rng(height).integers(0, 256, (height, width, 3), np.uint8)
    small = ModelContract(width=9, height=12)
    framing = preprocess.frame_photo(height, width, fov_rad, contract=small)
    cells = preprocess.network_input(photo, framing)
    return {"framing": asdict(framing), "rgb": as_text(photo), "cells": packed(cells)}


def _record(estimator: OnnxEstimator) -> dict[str, Any]:
    """The JSON file of `deeplight estimate`, without its largest entry and its confidence, and the
    light it is of, which two looks gave."""
    estimate = estimator.explain(example_photo())
    with TemporaryDirectory() as folder:
        write_results(estimate, estimator, Path(folder), "photo")
        record: dict[str, Any] = json.loads((Path(folder) / "photo.json").read_text())
    del record["mirror_ball"]["radiance"]
    record.pop("confidence", None)  # the page shows it and leaves it out of its file
    light = np.log(np.maximum(estimate.lighting.radiance, lobe.LEAST_RADIANCE))
    return {"record_log_radiance": packed(light), "record": record}


def packed(values: np.ndarray) -> dict[str, Any]:
    """An array as text: base64 of 32-bit floats, little-endian."""
    return {"shape": list(values.shape), "float32": as_text(np.asarray(values, "<f4"))}


def as_text(values: np.ndarray) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()


def golden_files() -> dict[str, dict[str, Any]]:
    """The golden values by file name."""
    return {
        "light.json": light_golden(),
        "photo.json": photo_golden(),
    }


if __name__ == "__main__":
    GENERATED.write_text(generated(), encoding="utf-8")
    for name, values in golden_files().items():
        (GOLDEN / name).write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")

"""Make what the page's photo in its light is checked with.

python tests/golden/make_web_scene.py

A made-up photo in made-up light goes to web/tests/golden/scene.json.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from make_nouns import light
from make_web import GOLDEN, as_text, main_light_record, packed

from deeplight import lobe
from deeplight.estimators import fill, projection
from deeplight.estimators.environment import assemble
from deeplight.estimators.results import elsewhere_record
from deeplight.frames import normalised
from deeplight.io.tilt import Tilt
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.mappings import latlong

FILE = GOLDEN / "scene.json"
SCENE_ROWS, SCENE_FOV_RAD = 160, 1.3
SCENE_TILT = Tilt(-0.25, 0.1, "made up", 0.1)


class BlockyPlace(fill.LibraryPlace):
    """A place of the library whose picture is no JPEG, but few levels, each of many pixels."""

    def detail(self) -> np.ndarray:
        levels = np.frombuffer(self.picture, np.uint8).reshape(8, 16, 3).astype(np.float32)
        times = np.ones((fill.DETAIL_ROWS // 8, fill.DETAIL_ROWS // 8, 1), np.float32)
        return np.kron((levels - 128) * (np.log(fill.LARGEST_RATIO) / 127), times).astype("f4")


def made_up_library() -> tuple[BlockyPlace, ...]:
    """Places of random light and detail: the best of the indoor ones fits as it is, that of the
    others mirrored."""
    made = np.random.default_rng(2)
    sky = np.linspace(0.8, -0.8, fill.ROWS)[:, None, None]
    return tuple(
        BlockyPlace(
            f"place {number}",
            kind,
            (sky + made.normal(0, 0.5, (fill.ROWS, 2 * fill.ROWS, 3))).astype(np.float32),
            made.integers(60, 200, (8, 16, 3), np.uint8).tobytes(),
        )
        for number, kind in enumerate(["indoor", "outdoor", "indoor", "outdoor", "indoor"])
    )


@contextmanager
def library_of(places: tuple[BlockyPlace, ...]) -> Iterator[None]:
    """Detail comes from these places meanwhile."""
    own = fill.library
    fill.library = lambda: places
    fill._maps.cache_clear()
    yield
    fill.library = own
    fill._maps.cache_clear()


def _place(place: BlockyPlace) -> dict[str, Any]:
    return {
        "name": place.name,
        "kind": place.kind,
        "smooth": packed(place.smooth),
        "levels": as_text(np.frombuffer(place.picture, np.uint8)),
    }


def golden() -> dict[str, Any]:
    """A made-up photo put into a made-up light: with the lamps of a network, without any, with the
    photo going on all around, and with made-up detail over that."""
    lighting = light()
    own = [
        Lamp(normalised(np.array([0.1, 0.35, -1.0])), np.array([3.0, 2.5, 2.0]), 0.12),
        Lamp(normalised(np.array([0.9, 0.5, 0.4])), np.array([4.0, 4.0, 3.0]), 0.2),
        Lamp(normalised(np.array([-0.5, 0.1, 0.9])), np.array([1.0, 1.0, 1.0]), 0.5),
        Lamp(normalised(np.array([0.9, 0.4, 0.2])), np.array([2.0, 2.0, 2.0]), 0.15),
    ]
    drawn = lighting.radiance + sum(lobe.lobe_on_ball(lamp) for lamp in own)
    photo = made_up_photo()
    plane = projection.ImagePlane.centred(*photo.shape[:2], SCENE_FOV_RAD)
    cases = {
        "lamps": (Lighting(drawn), own, None),
        "no_lamps": (lighting, [], None),
        "upright": (Lighting(drawn), own, SCENE_TILT),
        "indoor": (Lighting(drawn), own, SCENE_TILT, "indoor"),
        "outdoor": (lighting, [], None, "outdoor"),
    }
    places = made_up_library()
    with library_of(places):
        found = {name: _scene(photo, plane, *case) for name, case in cases.items()}
    chances = [0.0, 0.25, 0.2501, 0.5, 0.7499, 0.75, 1.0]
    return {
        "places": [_place(place) for place in places],
        "fills": [[chance, fill.chosen("auto", {"indoors": chance})] for chance in chances],
        "vertical_fov_rad": SCENE_FOV_RAD,
        "photo": {"height": len(photo), "width": photo.shape[1], "rgb": as_text(photo)},
        "rows": SCENE_ROWS,
        "own_lamps": [_lamp(lamp) for lamp in own],
        "tilt": {"up": SCENE_TILT.up.tolist(), "scaleRad": SCENE_TILT.scale_rad},
        **found,
    }


def made_up_photo() -> np.ndarray:
    """Waves, a small round lamp, a clipped window and a bright floor that does not clip."""
    row, column = np.mgrid[:150, :120]
    value = 90 + 50 * np.sin(column / 17) + 30 * np.cos(row / 11 + column / 40)
    photo = np.stack([value, value + 10, value - 20], -1)
    photo[np.hypot(row - 30, column - 70) < 5] = 255
    photo[60:90, 8:30] = [255, 255, 240]
    photo[130:] += 60
    return photo.clip(0, 255).astype(np.uint8)


def _scene(
    photo: np.ndarray,
    plane: projection.ImagePlane,
    lighting: Lighting,
    own: list[Lamp],
    tilt: Tilt | None,
    filling: fill.Chosen = "photo",
) -> dict[str, Any]:
    scene = assemble(lighting, photo, plane, SCENE_ROWS, own, filling, tilt)
    environment = scene.environment
    return {
        "ball": packed(lighting.radiance),
        "lamps": [_lamp(lamp) for lamp in scene.lamps],
        "radiance_every_8th_row": packed(environment.radiance[::8]),
        "seen_every_8th_row": packed(scene.seen[::8]),
        "power": np.einsum(
            "hw,hwc->c", latlong.solid_angles(SCENE_ROWS, 2 * SCENE_ROWS), environment.radiance
        ).tolist(),
        "as_ball": packed(environment.lighting.radiance),
        "main_light": main_light_record(environment.main_light),
        "elsewhere": elsewhere_record(scene),
    }


def _lamp(lamp: Lamp) -> dict[str, Any]:
    return {
        "direction": lamp.direction.tolist(),
        "flux": lamp.flux.tolist(),
        "angularRadiusRad": lamp.angular_radius_rad,
    }


if __name__ == "__main__":
    FILE.write_text(json.dumps(golden(), indent=1) + "\n", encoding="utf-8")

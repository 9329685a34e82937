"""Objects into a photo in one call: read it, estimate its light, stand them there."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from deeplight.compose.compose import Composed, ComposeSettings, Item, compose
from deeplight.compose.gravity import CameraPlacement, viewpoint_of
from deeplight.compose.trace import Progress
from deeplight.environment import Environment
from deeplight.estimators.estimate import load_estimator
from deeplight.estimators.fill import Fill
from deeplight.estimators.sun import SunHint, scene_in_sun
from deeplight.estimators.sureness import glow_rad, soft_note
from deeplight.estimators.tilt import tilt_of_estimate
from deeplight.io.photo_like import as_photo


def compose_photo(
    photo: Any,
    objects: Sequence[Item | str] = ("bunny",),
    light: Environment | None = None,
    *,
    placement: CameraPlacement | None = None,
    settings: ComposeSettings | None = None,
    stops: float = 0.0,
    sun: SunHint | None = None,
    fill: Fill | None = "auto",
    progress: Progress = lambda done, total: None,
) -> Composed:
    """Put objects into a photo, lit by its own light, with their shadow on its own surface.

    Args:
        photo: as `estimate` takes it; nothing may stand in the way.
        objects: "bunny", "sphere", "pot", a .glb, .gltf, .obj or .ply file, or `Item`s, which say
            material, place, size and turn.
        light: left out, what `estimate` gives for the photo.
        placement: what is known of how the camera stood; the rest is looked for in EXIF data.
        settings: how to render; left out, a preview.
        stops: make the light brighter by this number of doublings.
        sun: where the sun stands; left out, where the photo's EXIF data say, if they do. Only for
            an estimated light.
        fill: what reflections show where the photo does not look: "photo", its own rows going on to
            both sides; "indoor", "outdoor" or "any", detail of a real place of that kind over them;
            "auto", of the kind that the network is sure of, else "photo"; None leaves it smooth.
            The power of the light stays the same. Only for an estimated light.
        progress: called with (rays done, rays in all).

    Returns:
        `.composite.pixels` is the picture, `.composite.layers` objects, shadow and cover apart,
        `.notes` what was assumed.

    Raises:
        InputError: the photo, an object or its place cannot be used.
        OSError: a file cannot be read.
        ModuleNotFoundError: the extra `render` is not installed.
    """
    opened, network = as_photo(photo), load_estimator()
    where = placement or CameraPlacement()
    estimate = network.explain(opened, where.fov_deg)
    framing = estimate.framing
    tilt, doubts = tilt_of_estimate(estimate, where.pitch_deg, where.roll_deg)
    if light is None:
        scene, found = scene_in_sun(estimate, sun, fill=fill, tilt=tilt)
        light = scene.environment
        notes = (*estimate.notes, *(() if found is None else (found.note,)))
        glow = glow_rad(estimate.heads)
        if scene.lamps and glow and not (found and found.used):
            light, notes = scene.softened(glow).environment, (*notes, soft_note(estimate.heads))
    else:
        notes = opened.notes
    viewpoint, assumed = viewpoint_of(framing.camera, where, tilt)
    items = [Item(given) if isinstance(given, str) else given for given in objects]
    radiance = light.radiance * np.float32(2.0**stops)
    how = settings or ComposeSettings()
    composed = compose(opened.pixels, radiance, viewpoint, items, how, framing.bottom, progress)
    return replace(composed, notes=(*notes, *doubts, *assumed, *composed.notes))

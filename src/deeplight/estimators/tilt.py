"""How the camera of an estimated photo was tilted, and who says so."""

from collections.abc import Mapping
from math import degrees, radians

import numpy as np
from jaxtyping import UInt8

from deeplight.estimators.network import Estimate
from deeplight.estimators.projection import ImagePlane
from deeplight.estimators.upright import guessed_tilt
from deeplight.estimators.upright_edges import LEAST_EVIDENCE, tilt_with_edges
from deeplight.io.tilt import Tilt, with_given

SURE_RAD = radians(8)
"""A guess of the pitch that is less off, by its own word, is left as it is: edges would mend it by
some tenths of a degree (`lab/evidence/horizon_accuracy.py`), and the light is a little worse then
(validation places; docs/journal.md)."""
CONTRADICTS_RAD = radians(30)
"""EXIF's pitch is doubted from this difference on, and from three scales of what is seen."""


def tilt_of_estimate(
    estimate: Estimate, pitch_deg: float | None = None, roll_deg: float | None = None
) -> tuple[Tilt | None, tuple[str, ...]]:
    """The camera's tilt: as somebody says, else EXIF's, else what is seen in the photo.

    Returns:
        The tilt, None where nothing says what the pitch is, and a note if EXIF's is doubtful.
    """
    known = estimate.photo.tilt
    if pitch_deg is not None:
        return with_given(known or guessed_tilt(estimate.heads), pitch_deg, roll_deg), ()
    pixels = estimate.photo.pixels
    height, width, _ = pixels.shape
    plane = ImagePlane.centred(height, width, estimate.framing.vertical_fov_rad)
    if known is None:
        return with_given(seen_tilt(pixels, plane, estimate.heads), None, roll_deg), ()
    seen, evidence = tilt_with_edges(pixels, plane, guessed_tilt(estimate.heads))
    notes = _contradiction(known, seen) if seen and evidence >= LEAST_EVIDENCE else ()
    return with_given(known, None, roll_deg), notes


def seen_tilt(
    pixels: UInt8[np.ndarray, "rows columns 3"], plane: ImagePlane, heads: Mapping[str, float]
) -> Tilt | None:
    """The tilt by the network's guess, and by upright edges where that is not sure.

    None where neither says anything, and of a photo that seems to need turning: upright edges lie
    there.

    Args:
        pixels: upright, gamma-encoded.
        plane: where they lie.
        heads: what the network says, by name.
    """
    guess = guessed_tilt(heads)
    is_turned = bool(heads) and guess is None
    if is_turned or (guess is not None and guess.scale_rad < SURE_RAD):
        return guess
    return tilt_with_edges(pixels, plane, guess)[0]


def _contradiction(known: Tilt, seen: Tilt) -> tuple[str, ...]:
    """A note where what is known of the pitch is not what is seen."""
    off = abs(known.pitch_rad - seen.pitch_rad)
    if off < max(CONTRADICTS_RAD, 3 * seen.scale_rad):
        return ()
    said, looks = (round(degrees(tilt.pitch_rad)) for tilt in (known, seen))
    return (
        f"{known.source} says a pitch of {said} degrees, which is taken, but {seen.source} say "
        f"{looks}: give --pitch if that is right",
    )

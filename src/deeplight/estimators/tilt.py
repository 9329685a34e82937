"""How the camera of an estimated photo was tilted, and who says so."""

from deeplight.estimators.network import Estimate
from deeplight.estimators.upright import guessed_tilt
from deeplight.io.tilt import Tilt, with_given


def tilt_of_estimate(
    estimate: Estimate, pitch_deg: float | None = None, roll_deg: float | None = None
) -> Tilt | None:
    """The camera's tilt: as somebody says, else EXIF's, else the network's guess."""
    known = estimate.photo.tilt or guessed_tilt(estimate.heads)
    if known is None and roll_deg is not None:
        pitch_deg = pitch_deg or 0.0
    return with_given(known, pitch_deg, roll_deg)

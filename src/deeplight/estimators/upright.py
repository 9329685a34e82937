"""Whether a photo is upright, by what the network says."""

from collections.abc import Mapping

from deeplight.io.tilt import Tilt

SURE_CHANCE, LYING_CHANCE = 0.6, 0.7
"""From the first chance on a photo is said to lie on one side or stand on its head, from the other
to lie on its side, left or right: of validation photos one of 72 upright ones, and three of ten
turned ones (`lab/evidence/sideways.py`)."""

_POSES = {
    90: "lie on its side: try it turned 90 degrees clockwise",
    180: "stand on its head: try it turned round",
    270: "lie on its side: try it turned 90 degrees counter-clockwise",
}
_EITHER_WAY = "lie on its side: try it turned 90 degrees, one way or the other"


def likeliest_turn(heads: Mapping[str, float]) -> tuple[int, float]:
    """By how many degrees clockwise the photo should be turned to be upright, and the chance."""
    turns = (0, 90, 180, 270)
    best = max(turns, key=lambda turn: heads[f"upright_{turn}"])
    return best, heads[f"upright_{best}"]


def lying(heads: Mapping[str, float]) -> float:
    """The chance that the photo lies on its side, left or right."""
    return heads["upright_90"] + heads["upright_270"]


def guessed_tilt(heads: Mapping[str, float]) -> Tilt | None:
    """The tilt that the network takes the camera to have, without roll, of which it knows nothing;
    None where it does not say, and of a photo that seems to need turning."""
    if not heads or _pose(heads):
        return None
    return Tilt(heads["pitch_rad"], 0.0, "the network's guess", heads["pitch_scale"])


def turn_notes(heads: Mapping[str, float]) -> tuple[str, ...]:
    """What a user should know of a photo that seems to need turning; nothing of others and where
    the network does not say."""
    pose = _pose(heads) if heads else ""
    return (f"this photo may {pose}",) if pose else ()


def _pose(heads: Mapping[str, float]) -> str:
    """How a photo lies that seems to need turning, and what to do; nothing of others.

    That it lies on its side is seen far more often than on which.
    """
    turn, chance = likeliest_turn(heads)
    if turn and chance >= SURE_CHANCE:
        return _POSES[turn]
    return _EITHER_WAY if lying(heads) >= LYING_CHANCE else ""

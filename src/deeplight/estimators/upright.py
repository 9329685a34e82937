"""Whether a photo is upright, by what the network says."""

from collections.abc import Mapping

from deeplight.io.tilt import Tilt

SURE_CHANCE = 0.6
"""From this chance on a photo is said to lie on its side or stand on its head: of validation photos
no upright one, and a fifth of the turned ones (`lab/evidence/sideways.py`)."""

_POSES = {
    90: "lie on its side: try it turned 90 degrees clockwise",
    180: "stand on its head: try it turned round",
    270: "lie on its side: try it turned 90 degrees counter-clockwise",
}


def likeliest_turn(heads: Mapping[str, float]) -> tuple[int, float]:
    """By how many degrees clockwise the photo should be turned to be upright, and the chance."""
    turns = (0, 90, 180, 270)
    best = max(turns, key=lambda turn: heads[f"upright_{turn}"])
    return best, heads[f"upright_{best}"]


def guessed_tilt(heads: Mapping[str, float]) -> Tilt | None:
    """The tilt that the network takes the camera to have, without roll, of which it knows nothing;
    None where it does not say, and of a photo that seems to need turning."""
    if not heads:
        return None
    turn, chance = likeliest_turn(heads)
    if turn and chance >= SURE_CHANCE:
        return None
    return Tilt(heads["pitch_rad"], 0.0, "the network's guess", heads["pitch_scale"])


def turn_notes(heads: Mapping[str, float]) -> tuple[str, ...]:
    """What a user should know of a photo that seems to need turning; nothing of others and where
    the network does not say."""
    if not heads:
        return ()
    turn, chance = likeliest_turn(heads)
    if turn == 0 or chance < SURE_CHANCE:
        return ()
    return (f"this photo may {_POSES[turn]}",)

"""What keeps a light steady that is shown while one turns.

What was seen stays itself. What is only believed keeps its power, until that is contradicted by
more than its uncertainty, and the lamp that stands for power whose place nobody knows keeps its
place, until another is clearly brighter: each further estimate has it elsewhere.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight.camera_response import LUMINANCE
from deeplight.frames import Rotation

ENOUGH_SEEN = 0.5
"""Share of the sphere from which on the brightness is believed to be what it is."""
ROOM = 0.3
"""ln by which a steady light's power may miss what is believed while little was seen."""
CLEARLY = 1.5
"""Times as bright as where the lamp is another place must be for it to move there."""
_MOST_SHADE = 5.0  # what is only believed is made so much brighter or darker at most

Direction = Float[np.ndarray, "3"]


@dataclass
class Kept:
    """What was shown last; None before anything was.

    Attributes:
        log_power: ln of its power, in the session's unit.
        lamp: where the lamp was put, in the world.
    """

    log_power: float | None = None
    lamp: Direction | None = None


@dataclass(frozen=True, eq=False)
class Steadily:
    """How to show the next light.

    Attributes:
        kept: what was shown, and will have been.
        unit: ln of the gain relative to whose white the light is.
        world_from_frame: the frame that it is in.
    """

    kept: Kept
    unit: Direction
    world_from_frame: Rotation

    def place(self, brightest: Direction, brightness: Callable[[Direction], float]) -> Direction:
        """Where to put the lamp.

        Args:
            brightest: where nothing was shown yet.
            brightness: how bright the surroundings of a direction are; 0 where it was seen.
        """
        found = brightest
        if self.kept.lamp is not None:
            before = self.world_from_frame.T @ self.kept.lamp
            if brightness(brightest) < CLEARLY * brightness(before):
                found = before
        self.kept.lamp = self.world_from_frame @ found
        return found

    def shade(self, known: Direction, believed: Direction, seen: float) -> float:
        """By what factor to change the light that is only believed.

        Args:
            known, believed: power of what is known and of what is believed, summed over all
                directions, RGB.
            seen: share of the sphere.
        """
        scale = np.exp(-self.unit)
        sure, rest = (float((part * scale) @ LUMINANCE) for part in (known, believed))
        if not rest > 0:
            return 1.0
        log, shown = float(np.log(sure + rest)), self.kept.log_power
        room = ROOM * max(0.0, 1 - seen / ENOUGH_SEEN)
        wanted = log if shown is None else float(np.clip(shown, log - room, log + room))
        factor = float(np.clip((np.exp(wanted) - sure) / rest, 1 / _MOST_SHADE, _MOST_SHADE))
        self.kept.log_power = float(np.log(sure + factor * rest))
        return factor

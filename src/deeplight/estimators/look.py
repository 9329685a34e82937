"""The network's answers, each in the frame of what it was shown, as one in the photo's frame.

A photo that shows more than the network's view is looked at twice, and the view may be slid away
from its centre (`preprocess.looks`). Maps are turned back and averaged. Lamps are turned by
themselves, so that they stay as sharp as they were; a mean of them would be many weak ones: those
that point alike take the flux of those that stand alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32

from deeplight.lamp import Lamp
from deeplight.lobe import LEAST_RADIANCE, NEARNESS, TRUST, lobe_on_ball
from deeplight.mappings import mirror_ball
from deeplight.mappings.resample import sample_ball
from deeplight.preprocess import Framing

Ball = Float32[np.ndarray, "size size 3"]
LEAST_FLUX = 1e-4
"""Of the strongest lamp's: one that lost more than that to others is none."""


@dataclass(frozen=True, eq=False)
class Answer:
    """What the network says of one view.

    Attributes:
        log_radiance: ln radiance on the mirror ball, which holds the lamps.
        lamps: the compact lights, the strongest first.
        heads: what else it says, by name.
    """

    log_radiance: Ball
    lamps: tuple[Lamp, ...] = ()
    heads: Mapping[str, float] = field(default_factory=dict)


def seen_from_photo(answers: Sequence[Answer], views: Sequence[Framing]) -> Answer:
    """One answer, in the photo's camera frame, of those that the network gave to its views.

    The power of the light is the answers' mean. Of one view around the photo's centre it is the
    network's own, untouched.
    """
    if len(answers) == 1 and views[0].is_centred:
        return answers[0]
    turns = [view.photo_from_view for view in views]
    soft = np.mean([_soft(*pair) for pair in zip(answers, views, strict=True)], 0)
    lamps = agreeing(
        [
            lamp.turned(turn).scaled(1 / len(answers))
            for answer, turn in zip(answers, turns, strict=True)
            for lamp in answer.lamps
        ]
    )
    light = soft + sum(lobe_on_ball(lamp, len(soft)) for lamp in lamps)
    return Answer(np.log(light).astype(np.float32), lamps, _heads(answers, views))


def _soft(answer: Answer, view: Framing) -> Ball:
    """An answer's radiance without its lamps, turned to the photo's frame."""
    size = len(answer.log_radiance)
    soft = np.exp(answer.log_radiance) - sum(lobe_on_ball(lamp, size) for lamp in answer.lamps)
    soft = np.maximum(soft, np.float32(LEAST_RADIANCE))
    if view.is_centred:  # straight ahead is the whole rim: looked up, it is one place of it
        return soft
    directions = mirror_ball.pixel_directions(size).reshape(-1, 3) @ view.photo_from_view
    log_soft = sample_ball(np.log(soft), directions)
    turned: Ball = np.exp(log_soft).reshape(size, size, 3)
    return turned


def agreeing(lamps: Sequence[Lamp]) -> tuple[Lamp, ...]:
    """Lamps with the same flux together, more of it where they point alike; the strongest first.

    Of each channel its shares count, so that a gain of white balance stays a gain.
    """
    if not lamps:
        return ()
    directions = np.stack([lamp.direction for lamp in lamps])
    flux = np.stack([lamp.flux for lamp in lamps])
    whole = np.maximum(flux.sum(0), LEAST_RADIANCE)
    alike = np.exp(NEARNESS * (directions @ directions.T - 1)) @ (flux / whole).mean(1)
    trusted = flux * (alike / alike.max())[:, None] ** TRUST
    trusted *= whole / np.maximum(trusted.sum(0), LEAST_RADIANCE)
    found = [
        Lamp(lamp.direction, own, lamp.angular_radius_rad)
        for lamp, own in zip(lamps, trusted, strict=True)
    ]
    strongest = max(lamp.luminous_flux for lamp in found)
    kept = [lamp for lamp in found if lamp.luminous_flux >= LEAST_FLUX * strongest]
    return tuple(sorted(kept, key=lambda lamp: -lamp.luminous_flux))


def _heads(answers: Sequence[Answer], views: Sequence[Framing]) -> dict[str, float]:
    """What the answers say besides light, on average; the pitch is the photo's."""
    of_photo = [
        {**answer.heads, "pitch_rad": answer.heads["pitch_rad"] - view.pitch_rad}
        if "pitch_rad" in answer.heads
        else answer.heads
        for answer, view in zip(answers, views, strict=True)
    ]
    return {name: sum(own[name] for own in of_photo) / len(of_photo) for name in of_photo[0]}

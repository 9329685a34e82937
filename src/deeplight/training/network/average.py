"""Several networks that answer as one: the mean of their radiance, of the flipped photo's too.

Networks that learnt from other starts err in other ways, and a network errs otherwise on a photo's
mirror image; what they have in common is nearer to the truth (Lakshminarayanan et al., 2017).
"""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from deeplight.training.network.generator import Generator

FLUX = slice(3, 6)
"""Where a lamp's numbers have ln of its flux; see `ModelContract.lamps`."""


class Average(nn.Module):
    """The mean radiance of some networks' answers, in the form of one network.

    Args:
        members: of one input and output size; in evaluation mode, batch norm folded.
        flips: answer the mirrored photo as well and turn its light back. Then the light of a photo
            and of its mirror image are mirror images exactly.
    """

    def __init__(self, members: Sequence[Generator], flips: bool = False) -> None:
        super().__init__()
        self.members, self.flips = nn.ModuleList(members), flips

    def forward(self, photo: Float[Tensor, "n 3 height width"]) -> Float[Tensor, "n 3 size size"]:
        return self.light(photo)[0]

    def light(
        self, photo: Float[Tensor, "n 3 height width"]
    ) -> tuple[Float[Tensor, "n 3 size size"], Float[Tensor, "n lamp 7"] | None]:
        """ln of the mean radiance, and every member's lamps, each with its share of its flux.

        Map and lamps are averaged alike, so the lamps are still part of the light exactly.
        """
        answers = [member.light(photo) for member in self.members]  # type: ignore[operator]
        if self.flips:
            answers += [turned(member.light(photo.flip(-1))) for member in self.members]  # type: ignore[operator]
        share = math.log(len(answers))
        together = torch.logsumexp(torch.stack([answer for answer, _ in answers]), 0) - share
        lamps = [dimmed(own, share) for _, own in answers if own is not None]
        return together, torch.cat(lamps, 1) if lamps else None


def turned(
    answer: tuple[Float[Tensor, "n 3 size size"], Float[Tensor, "n lamp 7"] | None],
) -> tuple[Float[Tensor, "n 3 size size"], Float[Tensor, "n lamp 7"] | None]:
    """Light and lamps of the mirrored scene: left is right."""
    log_radiance, lamps = answer
    if lamps is not None:
        lamps = torch.cat((-lamps[..., :1], lamps[..., 1:]), -1)
    return log_radiance.flip(-1), lamps


def dimmed(lamps: Float[Tensor, "n lamp 7"], by: float) -> Float[Tensor, "n lamp 7"]:
    """Lamps with their flux divided by exp(`by`)."""
    return torch.cat((lamps[..., :3], lamps[..., FLUX] - by, lamps[..., 6:]), -1)

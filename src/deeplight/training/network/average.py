"""Several networks that answer as one: the mean of their maps, and the lamps they agree on.

Networks that learnt from other starts err in other ways, and a network errs otherwise on a photo's
mirror image; what they have in common is nearer to the truth (Lakshminarayanan et al., 2017). A
mean of maps does that for soft light. A mean of lamps would be many weak ones: here lamps that
point alike take the flux of those that stand alone.
"""

import math
from collections.abc import Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from deeplight.camera_response import LUMINANCE
from deeplight.errors import ConfigError
from deeplight.lobe import LEAST_RADIANCE, NEARNESS, TRUST
from deeplight.training.network.generator import Generator

Answer = tuple[Float[Tensor, "n 3 size size"], Float[Tensor, "n lamp 7"] | None]


class Average(nn.Module):
    """Some networks in the form of one.

    Args:
        members: of one input and output size; in evaluation mode, batch norm folded.
        flips: answer the mirrored photo as well and turn its light back. Then the light of a photo
            and of its mirror image are mirror images exactly.
        shares: of each member in the mean, divided by their sum; left out, all alike.

    Raises:
        ConfigError: other than one share above 0 for each member.
    """

    def __init__(
        self, members: Sequence[Generator], flips: bool = False, shares: Sequence[float] = ()
    ) -> None:
        super().__init__()
        shares = shares or [1.0] * len(members)
        if len(shares) != len(members) or min(shares) <= 0:
            got = ", ".join(f"{share:g}" for share in shares)
            raise ConfigError(f"{len(members)} shares above 0", got, "give one for each network")
        self.members, self.flips = nn.ModuleList(members), flips
        self.shares = [share / sum(shares) / (2 if flips else 1) for share in shares]

    def forward(self, photo: Float[Tensor, "n 3 height width"]) -> Float[Tensor, "n 3 size size"]:
        return self.light(photo)[0]

    def light(self, photo: Float[Tensor, "n 3 height width"]) -> Answer:
        """ln radiance and lamps, as `Generator.light`; the power of the light is the mean power."""
        maps, lamps = [], []
        for member, share in zip(self.members, self.shares, strict=True):
            answers: list[Answer] = [member.light(photo)]  # type: ignore[operator]
            if self.flips:
                answers.append(turned(*member.light(photo.flip(-1))))  # type: ignore[operator]
            for log_radiance, own in answers:
                radiance = log_radiance.exp()
                if own is not None:
                    radiance = (radiance - drawn(member, own)).clamp_min(LEAST_RADIANCE)
                    lamps.append(dimmed(own, -math.log(share)))
                    drawing = member
                maps.append(share * radiance)
        together = torch.stack(maps).sum(0)
        if not lamps:
            return together.log(), None
        agreed = agreeing(torch.cat(lamps, 1))
        return (together + drawn(drawing, agreed)).log(), agreed


def drawn(member: nn.Module, lamps: Float[Tensor, "n lamp 7"]) -> Float[Tensor, "n 3 size size"]:
    """Radiance of lamps on the ball of a network that has some."""
    concentration = torch.sin(lamps[..., 6:] / 2) ** -2
    radiance: Tensor = member.ball(lamps[..., :3], lamps[..., 3:6], concentration)  # type: ignore[operator]
    return radiance


def turned(
    log_radiance: Float[Tensor, "n 3 size size"], lamps: Float[Tensor, "n lamp 7"] | None
) -> Answer:
    """Light and lamps of the mirrored scene: left is right."""
    if lamps is not None:
        lamps = torch.cat((-lamps[..., :1], lamps[..., 1:]), -1)
    return log_radiance.flip(-1), lamps


def dimmed(lamps: Float[Tensor, "n lamp 7"], by: float) -> Float[Tensor, "n lamp 7"]:
    """Lamps with their flux divided by exp(`by`)."""
    return torch.cat((lamps[..., :3], lamps[..., 3:6] - by, lamps[..., 6:]), -1)


def agreeing(lamps: Float[Tensor, "n lamp 7"]) -> Float[Tensor, "n lamp 7"]:
    """The same lamps with the same flux together, more of it where they point alike."""
    direction, log_flux = lamps[..., :3], lamps[..., 3:6]
    luminance = torch.tensor(LUMINANCE, dtype=log_flux.dtype, device=log_flux.device)
    luminous = log_flux.exp() @ luminance  # (n, lamp)
    alike = torch.exp(NEARNESS * (direction @ direction.mT - 1))
    agreement = (alike @ luminous[..., None]).log()  # (n, lamp, 1)
    trusted = log_flux + TRUST * agreement
    whole = torch.logsumexp(log_flux, 1, keepdim=True) - torch.logsumexp(trusted, 1, keepdim=True)
    return torch.cat((direction, trusted + whole, lamps[..., 6:]), -1)

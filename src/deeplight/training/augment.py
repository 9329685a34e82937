"""From a batch of bytes to the network's input, with the augmentation of the paper and a few more.

All random numbers come from torch's global generators; the loop seeds these from (seed, step),
so step 1000 of a resumed run sees what step 1000 of an uninterrupted one saw.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int, UInt8
from torch import Tensor

from deeplight.camera_response import GAMMA
from deeplight.training.share import ALONE, Share


@dataclass(frozen=True)
class AugmentConfig:
    """Random changes of a training example; the paper's only one is the horizontal flip."""

    flip: bool = True
    """Mirror half of the scenes, left to right."""
    cutout: float = 0.0
    """Largest share of the photo's height and width hidden behind one grey rectangle."""
    noise: float = 0.0
    """Standard deviation of pixel noise added to the photo, in pixel value (1 = white)."""
    exposure_stops: float = 0.0
    """Standard deviation of an exposure change of photo and spheres; no benefit in the paper."""
    white_balance: float = 0.0
    """Standard deviation of the logarithm of a gain per channel; no benefit in the paper."""
    channel_shuffle: float = 0.0
    """Share of examples whose colour channels change places, in photo and spheres alike. Light is
    transported channel by channel, so the result is as true as the original; it keeps a network
    that knows few places from recognising them by their colours."""


@dataclass(frozen=True, eq=False)
class Inputs:
    """A batch ready for the network, on its device.

    A flipped example is a photo of the mirrored scene; its spheres stay as they were. The loss
    turns the predicted light back (u -> -u) instead of mirroring the spheres, their views and
    their bases: for the mirror image P of pixels and lights, (P R P) (P L) = P (R L).
    """

    photo: Float[Tensor, "n 3 height width"]
    spheres: Float[Tensor, "n sphere 3 pixel"]
    rig: Int[Tensor, "n"]
    flipped: Bool[Tensor, "n"]


def prepare(
    photo: UInt8[Tensor, "n height width 3"],
    spheres: UInt8[Tensor, "n sphere size size 3"],
    rig: Int[Tensor, "n"],
) -> Inputs:
    """Bytes to floats without any augmentation: photos in [-0.5, 0.5], spheres in [0, 1].

    The photo is what `preprocess.normalise` gives, computed on the device.

    The photo keeps its bytes' order in memory, which is torch's channels_last.
    """
    return Inputs(
        photo=photo.permute(0, 3, 1, 2).float().div_(255.0).sub_(0.5),
        spheres=spheres.flatten(2, 3).transpose(2, 3).float().div_(255.0),
        rig=rig,
        flipped=torch.zeros(len(photo), dtype=torch.bool, device=photo.device),
    )


def augment(inputs: Inputs, config: AugmentConfig, share: Share = ALONE) -> Inputs:
    """A new random version of the batch; draws nothing for what is switched off.

    `share` says which rows of the whole batch these are; it is the whole batch that is drawn for.
    """
    if config.exposure_stops or config.white_balance:
        inputs = jitter(inputs, config.exposure_stops, config.white_balance, share)
    if config.channel_shuffle:
        inputs = shuffle_channels(inputs, config.channel_shuffle, share)
    if config.flip:
        inputs = flip(inputs, share)
    photo = inputs.photo
    if config.noise:
        whole = torch.cat([photo] * share.ranks) if share.ranks > 1 else photo
        photo = photo + config.noise * share.own(torch.randn_like(whole))
    if config.cutout:
        photo = cut_out(photo, config.cutout, share)
    return replace(inputs, photo=photo)


def flip(inputs: Inputs, share: Share = ALONE) -> Inputs:
    """Mirror a random half of the photos and mark them."""
    drawn = share.own(torch.rand(share.whole(len(inputs.photo))))
    flipped = (drawn < 0.5).to(inputs.photo.device, non_blocking=True)
    photo = torch.where(flipped[:, None, None, None], inputs.photo.flip(-1), inputs.photo)
    return replace(inputs, photo=photo, flipped=flipped)


def both_ways(inputs: Inputs) -> Inputs:
    """Each photo as it is and after them each photo mirrored."""
    return Inputs(
        torch.cat((inputs.photo, inputs.photo.flip(-1))),
        torch.cat((inputs.spheres, inputs.spheres)),
        torch.cat((inputs.rig, inputs.rig)),
        torch.cat((inputs.flipped, ~inputs.flipped)),
    )


def turn_back(
    log_radiance: Float[Tensor, "n 3 height width"], flipped: Bool[Tensor, "n"]
) -> Float[Tensor, "n 3 height width"]:
    """The light of the scene as it was before `flip`: u -> -u on the mirror ball."""
    return torch.where(flipped[:, None, None, None], log_radiance.flip(-1), log_radiance)


def jitter(
    inputs: Inputs, exposure_stops: float, white_balance: float, share: Share = ALONE
) -> Inputs:
    """One linear gain per example and channel on photo and spheres alike, clipped at white.

    What was clipped already does not come back when the gain is below 1: a camera that does
    not exist, which may be why the paper found no benefit.
    """
    n, device = share.whole(len(inputs.photo)), inputs.photo.device
    stops = exposure_stops * torch.randn(n, 1)
    gain = share.own(torch.exp2(stops) * torch.exp(white_balance * torch.randn(n, 3)))
    pixel_gain = (gain ** (1.0 / GAMMA)).to(device, non_blocking=True)
    photo = ((inputs.photo + 0.5) * pixel_gain[:, :, None, None]).clamp_max(1.0) - 0.5
    spheres = (inputs.spheres * pixel_gain[:, None, :, None]).clamp_max(1.0)
    return replace(inputs, photo=photo, spheres=spheres)


def shuffle_channels(inputs: Inputs, part: float, share: Share = ALONE) -> Inputs:
    """Permute red, green and blue of a random `part` of the examples."""
    n, device = share.whole(len(inputs.photo)), inputs.photo.device
    permuted = torch.rand(n, 3).argsort(1)
    chosen = torch.rand(n, 1) < part
    order = share.own(torch.where(chosen, permuted, torch.arange(3)))
    order = order.to(device, non_blocking=True)
    photo = inputs.photo.gather(1, order[:, :, None, None].expand_as(inputs.photo))
    spheres = inputs.spheres.gather(2, order[:, None, :, None].expand_as(inputs.spheres))
    return replace(inputs, photo=photo, spheres=spheres)


def cut_out(
    photo: Float[Tensor, "n 3 height width"], largest: float, share: Share = ALONE
) -> Float[Tensor, "n 3 height width"]:
    """Set one random rectangle of each photo to mid-grey."""
    n, (height, width) = share.whole(len(photo)), photo.shape[2:]
    size = largest * torch.rand(n, 2)
    start = torch.rand(n, 2) * (1.0 - size)
    size, start = share.own(size), share.own(start)
    first, last = start.to(photo.device), (start + size).to(photo.device)
    row = (torch.arange(height, device=photo.device) + 0.5) / height
    column = (torch.arange(width, device=photo.device) + 0.5) / width
    rows = (row >= first[:, :1]) & (row < last[:, :1])
    columns = (column >= first[:, 1:]) & (column < last[:, 1:])
    hidden = rows[:, None, :, None] & columns[:, None, None, :]
    return photo.masked_fill(hidden, 0.0)

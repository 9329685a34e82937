"""One run on several devices: each takes its rows of every batch, all learn the same.

Everything random is drawn for the whole batch on every device, and batch norm takes its
statistics over the whole batch: so a run is the same, up to rounding, on any number of devices.
"""

import os
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from deeplight.errors import ConfigError
from deeplight.training.config import RunConfig
from deeplight.training.share import Share

try:  # the same Fabric comes in two packages
    from lightning_fabric import Fabric
except ImportError:
    from lightning.fabric import Fabric  # type: ignore[no-redef]


def first_process() -> bool:
    """Whether this is the process that reports; before Fabric has started the others it is."""
    return all(int(os.environ.get(name, "0")) == 0 for name in ("LOCAL_RANK", "NODE_RANK"))


def fabric(config: RunConfig, batch_size: int = 0) -> Fabric:
    """Fabric on the devices asked for, not yet launched.

    Raises:
        ConfigError: this machine has no such accelerator or not enough, or the batch cannot be
            divided by the number of devices.
    """
    processes = config.devices * config.nodes
    if processes < 1 or batch_size % processes:
        raise ConfigError(
            "at least one device and schedule.batch_size a multiple of devices x nodes",
            f"batches of {batch_size} on {config.devices} x {config.nodes}",
            "change one of them",
        )
    try:
        return Fabric(
            accelerator=config.accelerator,
            devices=config.devices,
            num_nodes=config.nodes,
            precision=config.precision,
            strategy="ddp" if processes > 1 else "auto",
        )
    except (ValueError, RuntimeError) as error:  # of Fabric's own checks
        do = "use auto or cpu, or fewer devices"
        raise ConfigError("an accelerator of this machine", str(error), do) from None


def device_name(device: torch.device) -> str:
    """The accelerator's name, or cpu."""
    return torch.cuda.get_device_name(device) if device.type == "cuda" else device.type


def over_all_devices(network: nn.Module, share: Share) -> nn.Module:
    """Let batch norm and dropout of `network` see the whole batch; unchanged on one device.

    Weights and names of the network's state stay as they are.
    """
    if share.ranks == 1:
        return network
    for name, child in network.named_children():
        new = child
        if isinstance(child, nn.BatchNorm1d | nn.BatchNorm2d):
            new = WholeBatchNorm(child, share)
        elif isinstance(child, nn.Dropout):
            new = WholeBatchDropout(child.p, share)
        else:
            over_all_devices(child, share)
        setattr(network, name, new)
    return network


class WholeBatchNorm(nn.modules.batchnorm._BatchNorm):
    """Batch norm over the rows of all devices, each of which has equally many.

    torch's own SyncBatchNorm does not run on CPUs.
    """

    def __init__(self, norm: nn.BatchNorm1d | nn.BatchNorm2d, share: Share) -> None:
        super().__init__(
            norm.num_features, norm.eps, norm.momentum, norm.affine, norm.track_running_stats
        )
        self.share = share
        self.weight, self.bias = norm.weight, norm.bias
        self.running_mean, self.running_var = norm.running_mean, norm.running_var
        self.num_batches_tracked = norm.num_batches_tracked
        self.train(norm.training)

    def _check_input_dim(self, input: Tensor) -> None:  # noqa: A002 - torch's name
        pass

    def forward(self, x: Tensor) -> Tensor:
        if not self.training and self.track_running_stats:
            return super().forward(x)
        dims = [0, *range(2, x.ndim)]
        shape = (1, -1, *(1 for _ in dims[1:]))
        mean = mean_over(x.float().mean(dims), self.share)
        centred = x.float() - mean.view(shape)
        variance = mean_over(centred.square().mean(dims), self.share)
        if self.track_running_stats:
            self.remember(mean.detach(), variance.detach(), x[:, 0].numel() * self.share.ranks)
        scale = torch.rsqrt(variance + self.eps) * self.weight
        return (centred * scale.view(shape) + self.bias.view(shape)).to(x.dtype)

    @torch.no_grad()
    def remember(self, mean: Tensor, variance: Tensor, count: int) -> None:
        """Move the running statistics as torch's batch norm does."""
        assert self.running_mean is not None
        assert self.running_var is not None
        assert self.num_batches_tracked is not None
        momentum = self.momentum or 0.0
        self.num_batches_tracked += 1
        self.running_mean.lerp_(mean, momentum)
        self.running_var.lerp_(variance * (count / max(1, count - 1)), momentum)


class WholeBatchDropout(nn.Dropout):
    """Dropout that draws for the whole batch and takes its own rows."""

    def __init__(self, p: float, share: Share) -> None:
        super().__init__(p)
        self.share = share

    def forward(self, x: Tensor) -> Tensor:
        if not self.training or self.p == 0:
            return x
        ones = x.new_ones(self.share.whole(len(x)), *x.shape[1:])
        kept: Tensor = self.share.own(functional.dropout(ones, self.p))
        return x * kept


def mean_over(values: Tensor, share: Share) -> Tensor:
    """The mean over all devices, through which gradients flow to every one of them."""
    mean: Tensor = MeanOverDevices.apply(values, share.ranks)  # type: ignore[no-untyped-call]
    return mean


class MeanOverDevices(torch.autograd.Function):
    """The mean is its own transpose: each device's gradient is the mean of all devices'."""

    @staticmethod
    def forward(context: Any, values: Tensor, ranks: int) -> Tensor:
        context.ranks = ranks
        total = values.clone(memory_format=torch.contiguous_format)
        torch.distributed.all_reduce(total)
        return total / ranks

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor, None]:
        return MeanOverDevices.apply(gradient, context.ranks), None  # type: ignore[no-untyped-call]

"""The other player: teaches D along with G, and gives G its adversarial term."""

from typing import TYPE_CHECKING

import torch
from jaxtyping import Float
from torch import Tensor

from deeplight.training import checkpoint
from deeplight.training.augment import Inputs
from deeplight.training.config import TrainConfig
from deeplight.training.devices import over_all_devices
from deeplight.training.losses import LossTerms, RigBases
from deeplight.training.network.discriminator import (
    Discriminator,
    discriminator_loss,
    generator_term,
    mirror_pictures,
)
from deeplight.training.share import Share

if TYPE_CHECKING:
    from lightning_fabric import Fabric

PICTURES_KEPT = 8


class Adversary:
    """D, its optimiser, and one step of the game.

    D learns first, then G is judged by what D has become: they alternate batch by batch.
    """

    def __init__(self, config: TrainConfig, bases: RigBases, fabric: "Fabric", share: Share):
        self.config, self.bases, self.fabric = config.adversarial, bases, fabric
        self.form = config.loss.form
        torch.manual_seed(config.run.seed)
        size = round(bases.mask.shape[-1] ** 0.5)
        module = Discriminator(self.config.widths, size)
        self.discriminator = over_all_devices(module, share).to(fabric.device)
        self.optimiser = torch.optim.Adam(
            self.discriminator.parameters(),
            betas=(config.optimiser.beta1, config.optimiser.beta2),
            fused=fabric.device.type in ("cpu", "cuda"),
        )
        self.network, self.fabric_optimiser = fabric.setup(self.discriminator, self.optimiser)
        self.pictures: tuple[Tensor, Tensor] | None = None

    def join(
        self,
        terms: LossTerms,
        log_radiance: Float[Tensor, "n 3 light light"],
        inputs: Inputs,
        learning_rate: float,
    ) -> LossTerms:
        """Teach D this batch; give equation 6's terms for G: lambda_rec L_rec + the rest L_adv.

        Args:
            terms: the reconstruction alone.
            log_radiance: as for `mirror_pictures`.
            learning_rate: G's, of this step.
        """
        real, fake = mirror_pictures(self.bases, self.form, log_radiance, inputs)
        self.pictures = real[:PICTURES_KEPT], fake[:PICTURES_KEPT].detach()
        about_d = self.teach(real, fake.detach(), learning_rate)
        adversarial = self.judge(real, fake)
        share = self.config.lambda_rec
        weighted = {name: share * term for name, term in terms.weighted.items()}
        return LossTerms(
            weighted | {"adversarial": (1.0 - share) * adversarial},
            {**terms.reported, "adversarial": adversarial.detach(), **about_d},
        )

    def teach(self, real: Tensor, fake: Tensor, learning_rate: float) -> dict[str, Tensor]:
        """One step of D; its loss and its accuracy on real and on predicted balls before it."""
        for group in self.optimiser.param_groups:
            group["lr"] = learning_rate * self.config.learning_rate_factor
        self.discriminator.requires_grad_(True)
        real_logit, fake_logit = self.logits(self.network, real, fake)
        loss = discriminator_loss(real_logit, fake_logit)
        self.fabric_optimiser.zero_grad()
        self.fabric.backward(loss)
        self.fabric_optimiser.step()
        return {
            "d_loss": loss.detach(),
            "d_real": (real_logit > 0).float().mean(),
            "d_fake": (fake_logit < 0).float().mean(),
        }

    def judge(self, real: Tensor, fake: Tensor) -> Float[Tensor, ""]:
        """G's adversarial term; D stays as it is."""
        self.discriminator.requires_grad_(False)
        with self.fabric.autocast():
            _, fake_logit = self.logits(self.discriminator, real, fake)
        return generator_term(fake_logit, self.config.form)

    def logits(
        self, network: torch.nn.Module, real: Tensor, fake: Tensor
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n"]]:
        """D's logits of filmed and of predicted balls."""
        if self.config.norm_over == "each":
            return network(real), network(fake)
        both = network(torch.cat((real, fake)))
        return both[: len(real)], both[len(real) :]

    def states(self) -> dict[str, dict[str, Tensor]]:
        """What a checkpoint keeps of it, by group."""
        return {
            "discriminator": self.discriminator.state_dict(),
            "discriminator_optimiser": checkpoint.optimiser_state(self.optimiser),
        }

    def restore(self, states: dict[str, dict[str, Tensor]]) -> None:
        """Put `states` back."""
        self.discriminator.load_state_dict(states["discriminator"])
        checkpoint.load_optimiser(self.optimiser, states["discriminator_optimiser"])

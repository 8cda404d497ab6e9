"""What a step makes smaller: the paper's unpaired objective, and the default preset's on pairs."""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from spark.network.config import Config
from spark.training import losses
from spark.training.batch import Batch, UnpairedBatch
from spark.training.model import Spark
from spark.training.precision import exactly
from spark.training.settings import TrainConfig
from spark.training.tensors import forward_kinematics

Terms = dict[str, Float[Tensor, ""]]


def network(config: TrainConfig, name_width: int) -> Config:
    """The network of a training run: the preset's, with the ablations' switches thrown."""
    preset = Config.paper() if config.preset == "paper" else Config.default()
    return replace(
        preset,
        width=config.width,
        heads=config.heads,
        encoder_blocks=config.blocks,
        decoder_blocks=config.blocks,
        name_width=name_width + 2,
        share_joints="share" not in config.ablate,
        mask_joints=0.0 if "mask" in config.ablate else preset.mask_joints,
        positions_in=preset.positions_in ^ ("pos" in config.ablate),
    )


class Objective(nn.Module):
    """A network with its loss: what one step makes smaller."""

    def __init__(self, model: Spark, config: TrainConfig) -> None:
        super().__init__()
        self.model = model
        weights = losses.PAIR_LOSS_WEIGHTS if model.config.residual else losses.PAPER_LOSS_WEIGHTS
        self.weights = {k: w for k, w in weights.items() if k != "fk" or "fk" not in config.ablate}

    def forward(self, batch: Batch | UnpairedBatch) -> tuple[Float[Tensor, ""], Terms]:
        """The weighted sum of the terms, and each of them without its weight."""
        if self.model.config.residual:
            assert isinstance(batch, Batch)
            terms = self._paired(batch)
        else:
            terms = self._unpaired(batch)
        with exactly(batch.pose.root):
            return torch.stack([w * terms[k] for k, w in self.weights.items()]).sum(), terms

    def _unpaired(self, batch: Batch | UnpairedBatch) -> Terms:
        """Section 4.5: A reconstructs A; what A becomes on B is encoded as A was."""
        latent = self.model.encode(batch.pose, batch.source)
        same = self.model.decode(latent, batch.source)
        moved = self.model.decode(latent, batch.target)
        again = self.model.encode(moved, batch.target)
        with exactly(batch.pose.root):
            return {
                "rec": losses.reconstruction(same, batch.pose, batch.source),
                "cyc": losses.cycle(latent.float(), again.float()),
                "root": losses.root(same, batch.pose),
                "fk": losses.positions(
                    forward_kinematics(same, batch.source),
                    forward_kinematics(batch.pose, batch.source),
                    batch.source,
                ),
            }

    def _paired(self, batch: Batch) -> Terms:
        """Against the exact answer on B, with the feet and the ends of limbs on top."""
        moved = self.model(batch.pose, batch.source, batch.target, batch.start)
        with exactly(batch.pose.root):
            positions = forward_kinematics(moved, batch.target)
            truth = forward_kinematics(batch.truth, batch.target)
            return {
                "rec": losses.reconstruction(moved, batch.truth, batch.target),
                "root": losses.root(moved, batch.truth),
                "fk": losses.positions(positions, truth, batch.target),
                "contact": losses.contact(positions, batch.planted, batch.frame_time, batch.target),
                "ends": losses.end_effectors(positions, truth, batch.effectors),
            }

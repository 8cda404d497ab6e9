"""What a network, and the target's own recording, add to the analytic transfer onto a character."""

from functools import cache
from pathlib import Path

from spark.inference.weights import SHIPPED, read_weights
from spark.network.retarget import NetworkRetargeter
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.target_prior import with_target_prior


def filled_in(
    source: CanonicalMotion, recording: CanonicalMotion, checkpoint: Path | None = None
) -> CanonicalMotion:
    """`source` on the rig of `recording`: joints without a counterpart as the network of
    `checkpoint` (the one that ships, where that is None) fills them in, and as the target moves
    them in `recording`; the legs fitted, on its own soles. A network that says where every joint is
    has said all of that. Raises `FileFormatError` where the checkpoint is none."""
    network = _shipped() if checkpoint is None else NetworkRetargeter(read_weights(checkpoint))
    if not network.network.config.residual:
        return network(source, recording.rig)
    moved = with_target_prior(network, source, recording)
    return network.fit_legs(source, moved, recording)


@cache
def _shipped() -> NetworkRetargeter:
    return NetworkRetargeter(read_weights(SHIPPED))

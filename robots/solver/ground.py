"""The ground under a robot's soles where its source climbs: as high as the source's, scaled."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from robots.model.morphology import Morphology
from sim.report.treads import Treads
from spark.rig.rig import Rig
from spark.runs import true_runs
from spark.transfer.footfalls import between_contacts


class GroundUnderSoles(NamedTuple):
    """Of each sole over time [m]: the `ground` under it, in swing from that of one place to that of
    the next by as much of its way as it has gone; and the `floor` that it is always over, in swing
    the lower of both."""

    ground: Float[np.ndarray, "T S"]
    floor: Float[np.ndarray, "T S"]


def under_soles(
    ground: Float[np.ndarray, "T S"],
    contacts: Bool[np.ndarray, "T S 2"],
    toes: Float[np.ndarray, "T S 2"],
) -> GroundUnderSoles:
    """As high all through a contact as in its median; `toes` [m] are where the feet go."""
    ground, floor = ground.copy(), np.zeros_like(ground)
    if not ground.any():
        return GroundUnderSoles(ground, floor)
    for s in range(ground.shape[1]):
        stands: Bool[np.ndarray, T] = np.any(contacts[:, s], axis=1)
        for start, stop in true_runs(stands):
            ground[start:stop, s] = np.median(ground[start:stop, s])
        ground[:, s] = between_contacts(ground[:, s, None], stands, toes[:, s])[:, 0]
        floor[:, s] = ground[:, s]
        for start, stop in true_runs(~stands):
            floor[start:stop, s] = ground[start:stop, s].min()
    return GroundUnderSoles(ground, floor)


def climbs(treads: Treads, source: Rig, robot: Morphology) -> tuple[str, ...]:
    """A note where the source's feet stand on more than the floor."""
    if treads.level or not robot.soles:
        return ()
    top = robot.rig.hip_height / source.hip_height * treads.top
    return (
        f"feet of the source stand on something up to {100 * treads.top:.0f} cm above its floor: "
        f"the robot's do up to {100 * top:.0f} cm above its own, where nothing is in its model; "
        "hands and knees are not held there",
    )

"""Where the joints of a source are: by MuJoCo's kinematics, in a few microseconds a frame."""

import mujoco
import numpy as np
from jaxtyping import Float

from robots.solver.window_dofs import as_slice
from spark.skeleton import Skeleton


class SourcePoses:
    """The kinematics of a skeleton: a tree of bodies that are put into each frame's pose. They have
    no joints, which long chains would take minutes to compile with."""

    def __init__(self, skeleton: Skeleton) -> None:
        spec = mujoco.MjSpec()
        bodies: list[mujoco.MjsBody] = []
        for parent in skeleton.parents.tolist():
            above = spec.worldbody if parent < 0 else bodies[parent]
            bodies.append(above.add_body())
        self._model = model = spec.compile()
        self._data = data = mujoco.MjData(self._model)
        self._bodies = as_slice(np.array([body.id for body in bodies]))
        self._root = bodies[0].id
        self._local = model.body_pos, model.body_quat
        self._found = data.xmat.reshape(-1, 3, 3), data.xpos

    def of(
        self,
        root_pos: Float[np.ndarray, "3"],
        rotations: Float[np.ndarray, "N 4"],
        offsets: Float[np.ndarray, "N 3"],
    ) -> tuple[Float[np.ndarray, "N 3 3"], Float[np.ndarray, "N 3"]]:
        """Rotations (`R_world_joint`) and places [m, world] of the joints whose local ones are
        `rotations` (`q_parent_joint`) and `offsets` [m]; the root is at `root_pos`. Both are views,
        until the next frame."""
        own, (local_places, turns) = self._bodies, self._local
        local_places[own], turns[own] = offsets, rotations
        local_places[self._root] = root_pos
        mujoco.mj_kinematics(self._model, self._data)
        axes, places = self._found
        return axes[own], places[own]

"""Where the joints of a source are: by MuJoCo's kinematics, in a few microseconds a frame."""

import mujoco
import numpy as np
from jaxtyping import Float

from spark.skeleton import Skeleton


class SourcePoses:
    """The kinematics of a skeleton: a body of a ball joint each."""

    def __init__(self, skeleton: Skeleton) -> None:
        spec = mujoco.MjSpec()
        bodies: list[mujoco.MjsBody] = []
        for parent, offset in zip(skeleton.parents.tolist(), skeleton.offsets, strict=True):
            above = spec.worldbody if parent < 0 else bodies[parent]
            # A body that moves needs a mass; nothing here asks for it.
            body = above.add_body(pos=offset, mass=1.0, inertia=np.ones(3), explicitinertial=True)
            body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL)
            bodies.append(body)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._bodies = np.array([body.id for body in bodies])
        self._qpos = self._model.jnt_qposadr[self._model.body_jntadr[self._bodies]]
        self._quats = self._qpos[:, None] + np.arange(4)

    def of(
        self,
        root_pos: Float[np.ndarray, "3"],
        rotations: Float[np.ndarray, "N 4"],
        offsets: Float[np.ndarray, "N 3"],
    ) -> tuple[Float[np.ndarray, "N 3 3"], Float[np.ndarray, "N 3"]]:
        """Rotations (`R_world_joint`) and places [m, world] of the joints whose local ones are
        `rotations` (`q_parent_joint`) and `offsets` [m]; the root is at `root_pos`."""
        model, data = self._model, self._data
        model.body_pos[self._bodies] = offsets
        model.body_pos[self._bodies[0]] = root_pos
        data.qpos[self._quats] = rotations
        mujoco.mj_kinematics(model, data)
        return data.xmat[self._bodies].reshape(-1, 3, 3), data.xpos[self._bodies]

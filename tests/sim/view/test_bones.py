"""A model without shapes is seen by its bones."""

import mujoco
import numpy as np
import pytest

from sim.view.bones import bones_of

LEGS = """
<mujoco><worldbody><body name="hips" pos="0 0 0.9"><freejoint/>{trunk}
  <body name="thigh" pos="0 0.1 0" euler="20 0 10"><joint axis="0 1 0" pos="0 0 0.01"/>{shape}
    <body name="casing" pos="0.01 0 -0.2" euler="0 30 0">
      <body name="shank" pos="0 0.02 -0.2"><joint axis="0 1 0"/>{shape}
        <body name="badge" pos="0 0 0.1"/>
      </body></body></body>
  <body name="other" pos="0 -0.1 0"><joint axis="1 0 0"/>{shape}</body>
</body></worldbody></mujoco>"""
INERTIA = '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>'
BALL = '<geom size="0.05"/>'


def model_of(trunk: str, shape: str) -> mujoco.MjModel:
    spec = mujoco.MjSpec.from_string(LEGS.format(trunk=trunk, shape=shape))
    return spec.compile()


def test_bones_lead_from_joint_to_joint() -> None:
    model = model_of(INERTIA, INERTIA)
    data = mujoco.MjData(model)
    data.qpos[7:] = [0.4, -0.7, 0.2]
    mujoco.mj_forward(model, data)
    bones = bones_of(model, range(1, model.nbody), set())
    ends = np.concatenate(
        [data.xpos[b] + ends @ data.xmat[b].reshape(3, 3).T for b, ends, _ in bones]
    )
    for anchor in data.xanchor:
        assert np.linalg.norm(ends - anchor, axis=1).min() < 1e-9
    assert len(bones) == 4  # to both thighs, to the casing and on to the shank; none to the badge


@pytest.mark.parametrize(("trunk", "seen"), [(BALL, False), (INERTIA, True)])
def test_there_are_none_where_half_of_the_bodies_have_shapes(trunk: str, seen: bool) -> None:
    model = model_of(trunk, INERTIA)
    shown = {int(b) for b in model.geom_bodyid} | {int(model.body("thigh").id)}
    assert bool(bones_of(model, range(1, model.nbody), shown)) == seen

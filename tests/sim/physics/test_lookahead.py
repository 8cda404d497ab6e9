"""The model that is looked ahead with, beside the whole one."""

import mujoco
import numpy as np
import pytest

from sim.physics.lookahead import LookaheadModel, lookahead_model

BODY = """
<mujoco>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="trunk" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.1 0.1 0.3" mass="40"/>
      <body name="arm" pos="0.2 0 0">
        <joint name="shoulder" type="ball"/>
        <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.05" mass="4"/>
        <body name="finger" pos="0.4 0 0">
          <joint name="knuckle" axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0.05 0 0" size="0.01" mass="0.02"/>
          <body name="tip" pos="0.05 0 0">
            <joint name="last" axis="0 1 0"/>
            <geom type="capsule" fromto="0 0 0 0.02 0 0" size="0.01" mass="0.01"/>
          </body>
        </body>
      </body>
      <body name="leg" pos="0 0 -0.3">
        <joint name="hip" axis="0 1 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.6" size="0.05" mass="8"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="a" joint="knuckle" kp="1"/>
    <position name="b" joint="hip" kp="100"/>
  </actuator>
  {more}
</mujoco>"""


def both(more: str = "", *, carries: tuple[str, ...] = ()) -> tuple[mujoco.MjModel, LookaheadModel]:
    spec = mujoco.MjSpec.from_string(BODY.format(more=more))
    model = spec.compile()
    names = [model.body(b).name for b in range(model.nbody)]
    return model, lookahead_model(spec, model, 1, np.isin(names, carries), 0.006)


def test_fingers_do_not_move_in_it() -> None:
    model, ahead = both()
    own = ahead.model
    assert [own.joint(j).name for j in range(1, own.njnt)] == ["shoulder", "hip"]
    assert [own.actuator(a).name for a in range(own.nu)] == ["b"]
    assert own.body_subtreemass[1] == pytest.approx(model.body_subtreemass[1])
    assert own.opt.timestep == 0.006
    np.testing.assert_array_equal(ahead.servos, [1])


def test_it_is_where_the_whole_body_is() -> None:
    model, ahead = both()
    data, own = mujoco.MjData(model), mujoco.MjData(ahead.model)
    data.qvel[:] = np.arange(model.nv) / 10
    mujoco.mj_integratePos(model, data.qpos, np.linspace(-0.5, 0.5, model.nv), 1.0)
    data.joint("knuckle").qpos[:] = data.joint("last").qpos[:] = 0.0
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    mujoco.mj_setState(ahead.model, own, ahead.state(data), kind)
    for each, its in ((model, data), (ahead.model, own)):
        mujoco.mj_forward(each, its)
    np.testing.assert_allclose(own.xpos, data.xpos, atol=1e-12)
    np.testing.assert_allclose(own.xquat, data.xquat, atol=1e-12)
    np.testing.assert_array_equal(own.joint("hip").qvel, data.joint("hip").qvel)
    np.testing.assert_array_equal(own.joint("shoulder").qvel, data.joint("shoulder").qvel)


@pytest.mark.parametrize(
    ("more", "carries"),
    [
        ('<equality><joint joint1="knuckle" joint2="last"/></equality>', ()),
        ("", ("finger", "tip")),
    ],
    ids=["joints that hang on each other", "fingers that carry"],
)
def test_what_is_needed_moves(more: str, carries: tuple[str, ...]) -> None:
    model, ahead = both(more, carries=carries)
    assert ahead.model.nv == model.nv
    np.testing.assert_array_equal(ahead.qpos, np.arange(model.nq))
    np.testing.assert_array_equal(ahead.dofs, np.arange(model.nv))
    np.testing.assert_array_equal(ahead.servos, np.arange(model.nu))

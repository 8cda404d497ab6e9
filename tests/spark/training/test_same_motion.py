"""One motion on two bodies is told from two motions of one name."""

from dataclasses import replace

import numpy as np
import pytest

from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.training.same_motion import same_motion
from spark.transfer.analytic import transfer
from spark.transfer.foot_lock import lock_feet
from spark.transfer.leg_fit import fit_legs
from tests.helpers.proportions import stout, striding, waving
from tests.helpers.stick import joint, stick_rig, without


@pytest.mark.parametrize("finished", [lambda s, m: m, fit_legs, lock_feet])
def test_a_motion_is_itself_on_another_body(finished) -> None:  # type: ignore[no-untyped-def]
    source = waving(striding(stick_rig()), 2)
    for rig in (stout(), without(stout(), Role.LEFT_TOE, Role.RIGHT_TOE)):
        moved = finished(source, transfer(source, rig))
        assert same_motion(source, moved)
        assert same_motion(moved, source)


def test_hands_that_are_held_otherwise_all_the_while_change_nothing() -> None:
    source = waving(striding(stick_rig()), 2)
    rotations = source.rotations.copy()
    turn = quat_from_rotvec(np.array([0.3, 0.6, 0.0]))
    for role in (Role.LEFT_HAND, Role.RIGHT_HAND, Role.LEFT_UPPER_ARM):
        rotations[:, joint(role)] = quat_mul(rotations[:, joint(role)], turn)
    assert same_motion(source, replace(source, rotations=rotations))


def test_another_motion_of_one_length_is_another() -> None:
    source = waving(striding(stick_rig()), 2)
    assert not same_motion(source, transfer(waving(striding(stick_rig()), 3), stout()))


def test_another_length_is_another_and_a_frame_lost_is_not() -> None:
    source = waving(striding(stick_rig()), 2)
    assert same_motion(source, source.frames(0, len(source) - 1))
    assert not same_motion(source, source.frames(0, len(source) - 9))


def test_what_does_not_move_tells_nothing() -> None:
    still = replace(striding(stick_rig()))
    still = replace(still, rotations=np.tile(still.rotations[:1], (len(still), 1, 1)))
    assert same_motion(still, transfer(still, stout()))

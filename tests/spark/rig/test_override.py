"""What the user says of a rig is above all evidence."""

from dataclasses import replace

import pytest

from spark.errors import SkeletonError
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role
from tests.helpers.rigs import RIGS, build


def test_the_map_is_above_all_evidence() -> None:
    skeleton, _ = build(RIGS["smpl"])
    wrist, hand = (skeleton.names.index(name) for name in ("L_Wrist", "L_Hand"))
    roles = assign_roles(skeleton, override={Role.LEFT_HAND: (hand,), Role.RIGHT_TOE: ()})
    assert roles.joints(Role.LEFT_HAND) == (hand,)
    assert roles.roles[wrist] is None
    assert roles.joints(Role.RIGHT_TOE) == ()
    assert roles.confidence[hand] == 1.0
    assert roles.reasons[hand] == "given by the map"


def test_a_refused_body_is_taken_with_a_map_that_suffices() -> None:
    """A quadruped as somebody on all fours: the map says so, nothing else is inferred."""
    skeleton, right = build(
        RIGS["lafan1"].replace("Arm", "Frontleg").replace("Shoulder", "Frontclav")
    )
    skeleton = replace(skeleton, names=tuple(f"joint_{j}" for j in range(len(skeleton))))
    bare = replace(skeleton, offsets=skeleton.offsets * 0, end_offsets=skeleton.end_offsets * 0)
    given_ = {role: (j,) for j, role in enumerate(right) if role and "leg" in role.value}
    with pytest.raises(SkeletonError, match="lacks pelvis"):
        assign_roles(bare, override=given_)
    roles = assign_roles(bare, override={**given_, Role.PELVIS: (0,)})
    assert {str(r) for r in roles.roles if r} == {"pelvis", *map(str, given_)}


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ({Role.HEAD: (0,), Role.PELVIS: (0,)}, "'Hips' is given to head and to pelvis"),
        ({Role.LEFT_FOOT: (1, 2)}, "left_foot is given 2 joints"),
        ({Role.HEAD: (99,)}, "joint 99; expected 0 to 21"),
        (
            {Role.LEFT_LOWER_LEG: (4,)},
            "left_foot 'LeftFoot' .* is not below left_lower",
        ),
    ],
)
def test_a_map_that_makes_no_sense_is_refused(
    override: dict[Role, tuple[int, ...]], message: str
) -> None:
    skeleton, _ = build(RIGS["lafan1"])
    with pytest.raises(SkeletonError, match=message):
        assign_roles(skeleton, override=override)

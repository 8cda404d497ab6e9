"""What holds a body up, or lets it sink, in no world but its model's: taken off a simulation."""

import mujoco

from sim.trajectory import subtree
from spark.errors import name_list

_SWITCHED_ON = {
    "gravity": mujoco.mjtDisableBit.mjDSBL_GRAVITY,
    "contacts": mujoco.mjtDisableBit.mjDSBL_CONTACT,
    "constraints": mujoco.mjtDisableBit.mjDSBL_CONSTRAINT,
    "actuators": mujoco.mjtDisableBit.mjDSBL_ACTUATION,
}
_TIES = (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD))
_BODY = int(mujoco.mjtObj.mjOBJ_BODY)


def leave_unaided(spec: mujoco.MjSpec, model: mujoco.MjModel, root: int, notes: list[str]) -> None:
    """Let what hangs on the `root` weigh what it weighs, touch the floor, and be tied to nothing
    else; what is changed in the spec of the `model` is added to `notes`."""
    off = [name for name, bit in _SWITCHED_ON.items() if spec.option.disableflags & int(bit)]
    if off:
        notes.append(f"the model's options switch off {', '.join(off)}: on here")
    for bit in _SWITCHED_ON.values():
        spec.option.disableflags &= ~int(bit)
    own = {*subtree(model, root)}
    light = [body for body in spec.bodies if body.id in own and body.gravcomp]
    for body in light:
        body.gravcomp = 0.0
    if light:
        lifted = name_list([body.name for body in light])
        notes.append(f"the model lifts {lifted} against gravity (gravcomp): not here")
    ties = [tie for k, tie in enumerate(spec.equalities) if _holds(model, k, own)]
    for tie in ties:
        tie.active = False
    if ties:
        notes.append(
            f"the model ties the body to what is not part of it ({len(ties)} of its equality "
            "constraints): not here"
        )


def _holds(model: mujoco.MjModel, equality: int, own: set[int]) -> bool:
    """Whether an equality constraint ties one of these bodies to another one."""
    if int(model.eq_type[equality]) not in _TIES or not model.eq_active0[equality]:
        return False
    ends = [int(model.eq_obj1id[equality]), int(model.eq_obj2id[equality])]
    if int(model.eq_objtype[equality]) != _BODY:
        ends = [int(model.site_bodyid[end]) for end in ends]
    return len({end in own for end in ends}) == 2

"""Parts of a body that are in each other however it stands: they don't push each other apart."""

import mujoco

from sim.self_contact import colliding, self_contacts
from sim.trajectory import ModelTrajectory, subtree


def let_overlap(spec: mujoco.MjSpec, body: ModelTrajectory, notes: list[str]) -> None:
    """Exclude contacts of parts that are in each other in the T-pose, where it is known, as convex
    hulls of a URDF's meshes often are; what is changed is added to `notes`."""
    if body.tpose is None:
        return
    model = colliding(body.model)
    own = {*subtree(model, body.root)}
    depths = self_contacts(model, mujoco.MjData(model), body.tpose, own)
    for first, second in depths:
        spec.add_exclude(bodyname1=model.body(first).name, bodyname2=model.body(second).name)
    if depths:
        pair = max(depths, key=lambda each: depths[each])
        names = " and ".join(repr(model.body(b).name) for b in pair)
        pairs = "one pair" if len(depths) == 1 else f"{len(depths)} pairs"
        notes.append(
            f"{pairs} of the model's parts are in each other in the T-pose, {names} by "
            f"{100 * depths[pair]:.1f} cm: they don't push each other here"
        )

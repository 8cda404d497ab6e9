"""Robots like the known ones, but with other limbs, limits and joints: for `train_start.py`."""

from dataclasses import replace

import numpy as np

from robots.known import known
from robots.mjcf import read_mjcf
from robots.morphology import Morphology
from robots.registry import find
from robots.understand import understand_robot

LONGER = 0.12  # standard deviation of the logarithm of lengths
RANGE = (0.6, 1.15)  # of the limits of these parts' joints
NARROWED = ("upper_leg", "foot", "spine", "upper_arm")
STRETCHED = ("pelvis", "spine", "upper_leg", "lower_leg", "upper_arm", "forearm")
FIXED = 0.3  # how often a robot has no roll in its ankles, one hinge less in its waist, no wrists


def variant(name: str, seed: int) -> Morphology:
    """The robot itself for seed 0. Raises `SkeletonError` where it can't stand in a T-pose."""
    robot = known(name)
    if seed == 0:
        return robot
    rng = np.random.default_rng([seed, *name.encode()])
    mjcf = read_mjcf(find(name), visuals=False)
    model, spec = mjcf.model, mjcf.spec
    longer = {part: float(np.exp(LONGER * rng.normal())) for part in STRETCHED}
    narrower = {part: rng.uniform(*RANGE, 3) for part in NARROWED}
    fixed = {part: bool(rng.random() < FIXED) for part in ("foot", "spine", "hand")}
    ends, dropped = {}, []
    for part, links in groups_of(robot):
        body = mjcf.root if not links else int(model.jnt_bodyid[robot.mj_joints[links[-1]]])
        ends[body] = part
        for k, link in enumerate(links):
            joint = model.joint(robot.mj_joints[link]).name
            only = part == "hand" or len(links) > 1
            if not joint:
                continue
            if fixed.get(part) and only and (k == (len(links) - 1 if part == "foot" else 0)):
                dropped.append(joint)
            elif part in narrower:
                spec.joint(joint).range = spec.joint(joint).range * narrower[part][min(k, 2)]
    for body in mjcf.bodies():
        above = ends.get(int(model.body_parentid[body]))
        if above in longer and (own := model.body(body).name):
            spec.body(own).pos = spec.body(own).pos * longer[above]
    drop(spec, dropped)
    root = model.body(mjcf.root).name
    model = spec.compile()
    return understand_robot(replace(mjcf, model=model, root=int(model.body(root).id)))


def groups_of(robot: Morphology) -> list[tuple[str, list[int]]]:
    """The links that turn each part which has a role, from the body outwards."""
    ends, out = set(robot.links.tolist()), []
    for link, role in zip(robot.links.tolist(), robot.rig.roles.roles, strict=True):
        if role is None:
            continue
        links = [link] if link >= 0 else []
        while links and (above := int(robot.tree.parents[links[0]])) >= 0 and above not in ends:
            links.insert(0, above)
        out.append((role.value.removeprefix("left_").removeprefix("right_"), links))
    return out


def drop(spec, joints: list[str]) -> None:
    """Take joints out of a model, with what refers to them."""
    for key in list(spec.keys):
        spec.delete(key)
    for joint in joints:
        for things in (spec.actuators, spec.sensors, spec.equalities):
            for thing in list(things):
                names = (getattr(thing, field, "") for field in ("target", "objname", "name1"))
                if joint in names:
                    spec.delete(thing)
        spec.delete(spec.joint(joint))

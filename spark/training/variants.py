"""Random skeletons that carry a known motion: training pairs with exact answers.

Nobody has one motion on many skeletons by measurement. But a motion on a *changed copy* of its own
skeleton is known exactly: bones scaled, joints split (as SAN does) or merged, toes, collarbones and
hands dropped, everything renamed after another rig's convention. Rotations since the T-pose stay
what they were, a new joint's lie between its neighbours', and only the feet need to be planted
again (`spark.transfer.leg_ik`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.network.features import BodyFeatures
from spark.rig.groups import groups_of
from spark.rig.name_conventions import CONVENTIONS, HELD_OUT, name_joints
from spark.rig.rig import Rig
from spark.rig.roles import Role, RoleMap
from spark.rotation import quat_slerp
from spark.skeleton import Skeleton

_LOG_SCALE = {  # standard deviation of the logarithm of each segment's length factor
    "leg": 0.12,
    "foot": 0.15,
    "torso": 0.12,
    "arm": 0.15,
    "width": 0.15,
    "head": 0.15,
}
_SEGMENT = {  # the bone that *ends* at a joint of this kind
    "spine": "torso",
    "neck": "torso",
    "head": "head",
    "clavicle": "width",
    "upper_arm": "width",
    "forearm": "arm",
    "hand": "arm",
    "upper_leg": "width",
    "lower_leg": "leg",
    "foot": "leg",
    "toe": "foot",
}
_DROP = {"toe": 0.15, "clavicle": 0.15, "hand": 0.1, "spine": 0.3, "neck": 0.3}
_SPARSE = 0.15  # share of skeletons that have as little as a robot: one joint of each kind at most
_SPLIT = {"spine": 0.3, "neck": 0.1, "upper_arm": 0.15, "forearm": 0.1, "lower_leg": 0.1}


@dataclass(frozen=True, eq=False)
class Variant:
    """A changed copy of a body of `base` joints: joint k turns from `first[k]` towards `second[k]`
    by `mix[k]`."""

    body: BodyFeatures
    base: int
    first: Int[np.ndarray, "K"]
    second: Int[np.ndarray, "K"]
    mix: Float[np.ndarray, "K"]

    def rotations(self, base: Float[np.ndarray, "*n J 4"]) -> Float[np.ndarray, "*n K 4"]:
        """World rotations since the T-pose on this skeleton, from those on the base's."""
        out = base[..., self.first, :].copy()
        between = np.flatnonzero(self.mix)
        if len(between):
            out[..., between, :] = quat_slerp(
                base[..., self.first[between], :],
                base[..., self.second[between], :],
                np.broadcast_to(self.mix[between], (*base.shape[:-2], len(between))),
            )
        return out


@dataclass
class _Node:
    parent: "_Node | None"
    offset: Float[np.ndarray, "3"]
    role: Role | None
    first: int
    second: int
    mix: float = 0.0
    name: str = ""

    @property
    def kind(self) -> str:
        return self.role.part if self.role else ""


def random_variant(
    base: BodyFeatures, rng: np.random.Generator, convention: str | None = None
) -> Variant:
    """A random skeleton made from `base`, named after `convention` or after a random one."""
    if convention is None:
        convention = str(rng.choice([name for name in CONVENTIONS if name not in HELD_OUT]))
    nodes = _nodes(base)
    nodes = _drop(nodes, rng)
    nodes = _split(nodes, base.skeleton, rng)
    _scale(nodes, rng)
    return _finish(nodes, base, convention)


def same_body(base: BodyFeatures) -> Variant:
    """The body itself, under its own names, as a variant: all that a network sees of it."""
    return _finish(_nodes(base), base)


def scaled_body(base: BodyFeatures, rng: np.random.Generator) -> Variant:
    """The body with other bone lengths: the same joints under the same names."""
    nodes = _nodes(base)
    _scale(nodes, rng)
    return _finish(nodes, base)


def split_body(base: BodyFeatures) -> Variant:
    """The body with `split_joints` split: each moves to the middle of its bone, and a joint that
    does not turn takes its place."""
    nodes = _nodes(base)
    chosen = split_joints(base)
    out: list[_Node] = []
    for node in nodes:
        out.append(node)
        if node.name in chosen:
            node.offset = node.offset / 2
            role = node.role if node.role is Role.SPINE else None
            name = f"{node.name}_split"
            after = _Node(node, node.offset, role, node.first, node.second, name=name)
            for child in nodes:
                child.parent = after if child.parent is node else child.parent
            out.append(after)
    return _finish(out, base)


def split_joints(base: BodyFeatures) -> list[str]:
    """The joints that Aberman et al. (2020) split to get characters of another structure: the
    second joint of the spine and both shoulders."""
    roles = base.rig.roles
    chosen = [*roles.joints(Role.SPINE)[:2][-1:]]
    chosen += [*roles.joints(Role.LEFT_CLAVICLE)[:1], *roles.joints(Role.RIGHT_CLAVICLE)[:1]]
    return [base.rig.skeleton.names[j] for j in chosen]


def most_joints(base: BodyFeatures, joints: Sequence[int]) -> int:
    """How many joints a variant can have in the place of these of `base`: each bone that may be
    split is."""
    return len(joints) + sum(base.parts[k] in (*_SPLIT, "clavicle") for k in joints)


def _nodes(base: BodyFeatures) -> list[_Node]:
    nodes: list[_Node] = []
    for k, j in enumerate(base.joints.tolist()):
        parent = None if k == 0 else nodes[int(base.skeleton.parents[k])]
        role = base.rig.roles.roles[j]
        offset, name = base.skeleton.offsets[k].copy(), base.skeleton.names[k]
        nodes.append(_Node(parent, offset, role, k, k, name=name))
    return nodes


def _drop(nodes: list[_Node], rng: np.random.Generator) -> list[_Node]:
    """Merge joints into their parents; both sides of a pair go together."""
    sparse = bool(rng.random() < _SPARSE)
    chosen_kinds = {
        k: sparse or bool(rng.random() < p) for k, p in _DROP.items() if k not in ("spine", "neck")
    }
    spines = [node for node in nodes if node.role is Role.SPINE]
    dropped: set[int] = set()
    for node in nodes:
        if node.parent is None or node is (spines[-1] if spines else None):
            continue
        probability = max(_DROP[node.kind], sparse) if node.kind in _DROP else 0.0
        if (node.role is None and rng.random() < 0.5) or (
            chosen_kinds[node.kind] if node.kind in chosen_kinds else rng.random() < probability
        ):
            dropped.add(id(node))
            for child in nodes:
                if child.parent is node:
                    child.parent, child.offset = node.parent, child.offset + node.offset
    return [node for node in nodes if id(node) not in dropped]


def _split(nodes: list[_Node], base: Skeleton, rng: np.random.Generator) -> list[_Node]:
    """Put a joint into the middle of bones. In the trunk it bends as the base does there, in a limb
    it follows."""
    chosen_kinds = {kind: bool(rng.random() < p) for kind, p in _SPLIT.items()}
    out: list[_Node] = []
    for node in nodes:
        if node.parent is not None and chosen_kinds.get(node.kind, False):
            trunk = node.kind in ("spine", "neck")
            role = node.role if trunk else None
            above = node.parent.first
            sources = midway(base, above, node.first) if trunk else (above, above, 0.0)
            middle = _Node(node.parent, node.offset / 2, role, *sources)
            node.parent, node.offset = middle, node.offset / 2
            out.append(middle)
        out.append(node)
    return out


def midway(base: Skeleton, above: int, below: int) -> tuple[int, int, float]:
    """Halfway from joint `above` to `below`: the two joints next to it, and how far it is from the
    first to the second."""
    path = base.ancestors(below)
    chain = list(path[path.index(above) :: -1])
    arc = np.cumsum([0.0, *np.linalg.norm(base.offsets[chain[1:]], axis=1)])
    k = min(int(np.searchsorted(arc, arc[-1] / 2, side="right")), len(chain) - 1)
    span = arc[k] - arc[k - 1]
    return chain[k - 1], chain[k], float((arc[-1] / 2 - arc[k - 1]) / span) if span else 0.5


def _scale(nodes: list[_Node], rng: np.random.Generator) -> None:
    """Lengthen and shorten bones, both sides alike."""
    factors = {name: float(np.exp(rng.normal(0, sd))) for name, sd in _LOG_SCALE.items()}
    shares = {kind: float(np.exp(rng.normal(0, 0.06))) for kind in _SEGMENT}
    for node in nodes:
        kind = node.kind or (node.parent.kind if node.parent else "")
        if kind in _SEGMENT:
            node.offset = node.offset * factors[_SEGMENT[kind]] * shares[kind]


def _finish(nodes: list[_Node], base: BodyFeatures, convention: str | None = None) -> Variant:
    """Measure and name: a `Rig` whose T-pose is its rest pose and whose hips are 1 high. Without a
    convention joints keep their names."""
    index = {id(node): k for k, node in enumerate(nodes)}
    parents = np.array([-1 if node.parent is None else index[id(node.parent)] for node in nodes])
    offsets = np.stack([node.offset for node in nodes])
    positions = offsets.copy()
    for k in range(1, len(nodes)):
        positions[k] += positions[parents[k]]
    ankles = [k for k, node in enumerate(nodes) if node.kind == "foot"]
    base_roles = [base.rig.roles.roles[j] for j in base.joints.tolist()]
    base_ankles = [k for k, role in enumerate(base_roles) if role and role.part == "foot"]
    ankle_height = 1 + base.skeleton.rest_positions[base_ankles, 2].mean()
    hips = [k for k, node in enumerate(nodes) if node.kind == "upper_leg"]
    height = positions[hips, 2].mean() - positions[ankles, 2].mean() + ankle_height
    roles = tuple(node.role for node in nodes)
    ones = (1.0,) * len(nodes)
    role_map = RoleMap(roles, ones, ("made",) * len(nodes))
    skeleton = Skeleton(
        tuple(name_joints(roles, convention) if convention else (node.name for node in nodes)),
        parents,
        offsets / height,
        np.arange(len(nodes)) == 0,
    )
    tpose = np.tile([1.0, 0, 0, 0], (len(nodes), 1))
    rig = Rig(skeleton, role_map, groups_of(skeleton, role_map), tpose, 0, 1.0)
    return Variant(
        BodyFeatures(
            rig, np.arange(len(nodes)), skeleton, base.turned[[node.first for node in nodes]]
        ),
        len(base.joints),
        np.array([node.first for node in nodes]),
        np.array([node.second for node in nodes]),
        np.array([node.mix for node in nodes]),
    )

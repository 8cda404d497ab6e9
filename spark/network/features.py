"""What the network reads and writes, made from rigs and canonical motions and turned back.

The network's skeleton is the body alone: the root is the middle of the hips, turned as the pelvis;
fingers, face, hair and cloth are left out, since they follow. Positions are in hip heights. A
window is seen from its own first frame: the hips' ground position and heading there are the origin.
"""

import re
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from spark.kinematics import local_rotations, world_rotations
from spark.network.config import NO_ROTATION, SHAPE_FEATURES, TPOSE_FEATURES, TPOSE_ROTATION
from spark.rig.rig import Rig
from spark.rig.roles import Group, Role
from spark.rotation import quat_from_yaw, quat_mul, quat_relative, quat_rotate, yaw_from_quat
from spark.sixd import quat_from_sixd, sixd_from_quat
from spark.skeleton import Skeleton
from spark.transfer.canonical import CanonicalMotion

# The paper leaves out joints by such words (section 5, "Datasets").
_EXCLUDED_WORDS = re.compile(
    r"finger|thumb|index|middle|ring|pinky|hair|cloth|skirt|cape|eye|jaw|tongue|lip|brow|face|breast"
    r"|metacarp|twist|weapon|sword|shield|prop|ik_|_ik|sleeve|collar|hood|hat$|visor|armou?r|belt"
    r"|pouch|bag|strap|scarf|ribbon|coat|dress|robe|feather|belly|butt|peck|whistle|facial",
    re.IGNORECASE,
)
_FEET = (Role.LEFT_FOOT, Role.LEFT_TOE, Role.RIGHT_FOOT, Role.RIGHT_TOE)
_EFFECTORS = (Role.HEAD, Role.LEFT_HAND, Role.RIGHT_HAND, Role.LEFT_FOOT, Role.RIGHT_FOOT)


@dataclass(frozen=True, eq=False)
class BodyFeatures:
    """A rig as the network sees it, without names' embeddings and without a batch axis.

    `joints[k]` is the rig's joint of network joint k; network joint 0 is the pelvis, placed at the
    middle of the hips. `skeleton` holds parents and offsets in hip heights, canonical axes.
    `tpose_world` are the rotations of the file's joints in the T-pose, by default the rig's: a
    changed copy of a body has those of the body.
    """

    rig: Rig
    joints: Int[np.ndarray, "K"]
    skeleton: Skeleton
    tpose_world: Float[np.ndarray, "K 4"] | None = None

    @cached_property
    def turned(self) -> Float[np.ndarray, "K 4"]:
        """How the file's joints are turned in the T-pose, in world axes."""
        return self.rig.tpose[self.joints] if self.tpose_world is None else self.tpose_world

    @cached_property
    def groups(self) -> tuple[tuple[int, ...], ...]:
        """The network's joints of each of the six groups, from root to leaf."""
        return tuple(
            tuple(k for k, j in enumerate(self.joints.tolist()) if group in self.rig.groups[j])
            for group in Group
        )

    @cached_property
    def arcs(self) -> tuple[Float[np.ndarray, "_"], ...]:
        """Normalised arc length of each group's joints along that group, 0 to 1."""
        lengths = np.linalg.norm(self.skeleton.offsets, axis=-1)
        lengths[0] = 0
        from_root = lengths.copy()
        for level in self.skeleton.levels[1:]:
            from_root[level] += from_root[self.skeleton.parents[level]]
        arcs = []
        for group in self.groups:
            along = from_root[list(group)]
            span = np.ptp(along) if len(along) else 0.0
            arcs.append((along - along.min()) / span if span else np.zeros_like(along))
        return tuple(arcs)

    @cached_property
    def tpose(self) -> Float[np.ndarray, "K 13"]:
        """Position, 6D rotation, velocity and foot contact of each joint in the T-pose.

        The position is relative to the root [hip heights], the rotation is the joint's in its file,
        relative to its parent, and none at the root. A pose stands still: its velocity is 0.
        """
        features = np.zeros((len(self.joints), TPOSE_FEATURES))
        features[:, :3] = self.skeleton.rest_positions
        features[:, TPOSE_ROTATION] = sixd_from_quat(local_rotations(self.skeleton, self.turned))
        features[0, TPOSE_ROTATION] = NO_ROTATION
        features[:, 12] = self.holding(*_FEET)
        return features

    @cached_property
    def shape(self) -> Float[np.ndarray, "K 6"]:
        """Bone offset, depth, leaf flag and degrees of freedom (of three) of each joint."""
        features = np.zeros((len(self.joints), SHAPE_FEATURES))
        features[:, :3] = self.skeleton.offsets
        for depth, level in enumerate(self.skeleton.levels):
            features[level, 3] = depth / 10
        features[:, 4] = [not children for children in self.skeleton.children]
        features[:, 5] = 1
        return features

    @property
    def parts(self) -> tuple[str, ...]:
        """What each joint is, without its side; empty where it has no role."""
        roles = (self.rig.roles.roles[j] for j in self.joints.tolist())
        return tuple(role.part if role else "" for role in roles)

    @cached_property
    def sides(self) -> Float[np.ndarray, "K 2"]:
        """1 at the joints of the left and of the right side."""
        roles = [self.rig.roles.roles[j] for j in self.joints.tolist()]
        sides = [role.side if role else "" for role in roles]
        return np.array([[side == "left", side == "right"] for side in sides], dtype=float)

    @cached_property
    def effectors(self) -> Float[np.ndarray, "K"]:
        """1 at hands, feet and head."""
        return self.holding(*_EFFECTORS)

    @cached_property
    def contacts(self) -> tuple[int, int]:
        """The joints of the left and of the right foot that touch the floor: toe, else ankle."""
        roles = [self.rig.roles.roles[j] for j in self.joints.tolist()]
        left, right = (
            roles.index(toe if toe in roles else foot) for foot, toe in (_FEET[:2], _FEET[2:])
        )
        return left, right

    def holding(self, *roles: Role) -> Float[np.ndarray, "K"]:
        """1 at the joints that hold one of `roles`."""
        return np.array([float(self.rig.roles.roles[j] in roles) for j in self.joints.tolist()])


@dataclass(frozen=True)
class Origin:
    """Where and how a window begins: what was taken out of it, in world axes."""

    position: Float[np.ndarray, "3"]
    yaw: float


def body_features(rig: Rig) -> BodyFeatures:
    """The network's view of a rig: joints with a role, and those without that aren't left out."""
    roles = rig.roles.roles
    pelvis = rig.roles.joint(Role.PELVIS)
    assert pelvis is not None  # every Rig has one: `understand` refuses bodies without
    names = rig.skeleton.names
    kept = [pelvis] + [
        j
        for j in range(len(names))
        if j != pelvis
        and (roles[j] is not None or (rig.groups[j] and not _EXCLUDED_WORDS.search(names[j])))
        and j not in rig.skeleton.ancestors(pelvis)
    ]
    index = {j: k for k, j in enumerate(kept)}
    parents = [-1] + [index.get(rig.skeleton.above(j, index), 0) for j in kept[1:]]
    positions = rig.tpose_positions[kept]
    hips = [index[j] for j in rig.hips]
    positions[0] = positions[hips].mean(0)
    positions = (positions - positions[0]) / rig.hip_height
    offsets = positions - np.where(np.array(parents)[:, None] < 0, positions, positions[parents])
    skeleton = Skeleton(
        tuple(names[j] for j in kept),
        np.array(parents),
        offsets,
        np.arange(len(kept)) == 0,
    )
    return BodyFeatures(rig, np.array(kept), skeleton)


def pose_features(
    canonical: CanonicalMotion, body: BodyFeatures
) -> tuple[Float[np.ndarray, "T K 6"], Float[np.ndarray, "T 3"], Origin]:
    """Local 6D rotations and the root's path [hip heights], seen from the window's first frame."""
    world = canonical.rotations[:, body.joints]
    origin = Origin(
        np.array([*canonical.hips[0, :2], canonical.floor_z]), float(yaw_from_quat(world[0, 0]))
    )
    from_heading = quat_from_yaw(np.array(-origin.yaw))
    local = local_rotations(body.skeleton, world)
    local[:, 0] = quat_mul(from_heading, world[:, 0])
    root = quat_rotate(from_heading, canonical.hips - origin.position) / body.rig.hip_height
    return sixd_from_quat(local), root, origin


def canonical_from_features(
    sixd: Float[np.ndarray, "T K 6"],
    root: Float[np.ndarray, "T 3"],
    origin: Origin,
    body: BodyFeatures,
    start: CanonicalMotion,
) -> CanonicalMotion:
    """The motion that the network wrote, in world axes; joints it does not see keep their local
    rotation of `start`, the analytic transfer. `origin` is that of `start` on this body."""
    to_heading = quat_from_yaw(np.array(origin.yaw))
    local = quat_from_sixd(sixd)
    local[:, 0] = quat_mul(to_heading, local[:, 0])
    world_of_network = world_rotations(body.skeleton, local)
    rotations = start.rotations.copy()
    skeleton, index = body.rig.skeleton, {j: k for k, j in enumerate(body.joints.tolist())}
    pelvis = int(body.joints[0])
    for j in skeleton.ancestors(pelvis)[1:]:
        from_pelvis = quat_relative(start.rotations[:, pelvis], start.rotations[:, j])
        rotations[:, j] = quat_mul(world_of_network[:, 0], from_pelvis)
    for j in range(len(skeleton)):
        if j in index:
            rotations[:, j] = world_of_network[:, index[j]]
        elif j not in skeleton.ancestors(pelvis):
            parent = int(skeleton.parents[j])
            local_j = quat_relative(start.rotations[:, parent], start.rotations[:, j])
            rotations[:, j] = quat_mul(rotations[:, parent], local_j)
    hips = quat_rotate(to_heading, root * body.rig.hip_height) + origin.position
    return CanonicalMotion(body.rig, start.frame_time, rotations, hips, start.floor_z)

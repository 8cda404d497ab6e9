"""The role of every joint of a rig, from its names, its build and its motion."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from spark.errors import SkeletonError, name_list
from spark.motion import Motion
from spark.rig.anatomy import Anatomy, find_anatomy
from spark.rig.facing import LabelledPair
from spark.rig.measurements import MAX_FRAMES, measure
from spark.rig.name_hints import NameHint, read_names
from spark.rig.name_votes import with_votes
from spark.rig.nulls import all_but, motion_of, nulls_of, skeleton_of
from spark.rig.override import Override, check_chains, check_override
from spark.rig.roles import SURE, Role, RoleMap
from spark.skeleton import Skeleton

# How often each kind of evidence alone is right, by judgement.
_NAME_RELIABILITY, _CHAIN_RELIABILITY, _SHAPE_RELIABILITY = 0.85, 0.6, 0.6
_DOUBTED = 0.6  # of the confidence is left where something speaks against a side
_CLEAR_SIDE = 0.15  # of the evidence of `first_is_left`, which is sure at 0.3
# Of both parts of it, for sides that the body shows against its names. Of 580 recordings and rest
# poses that are named rightly none has both below 0; mirrored, their motions have both below -1.
_AGAINST_NAMES = -0.5
# Of the feet's part alone, where knees and elbows are straight: feet that point 120 degrees away.
_TOES_BEHIND = -1.0


def assign_roles(
    skeleton: Skeleton,
    motion: Motion | None = None,
    override: Override | None = None,
    bent: Motion | None = None,
) -> RoleMap:
    """The role of each joint, how sure it is, and why.

    Evidence in this order: names; chains and their symmetry; the poses of `motion` (the rest pose
    without one); `override` stands above all, and suffices where it gives pelvis and legs. Which
    limbs are left, knees and elbows show in the poses of `bent` where it is given.
    SkeletonError with the reason where the body does not walk on two legs.
    """
    override = override or {}
    check_override(skeleton, override)
    hints = read_names(skeleton.names)
    kept = all_but(_said_by_others(skeleton, hints), skeleton)
    found: Found = {}
    sides = _Sides(True)
    try:
        found, sides = _infer(
            skeleton_of(skeleton, kept),
            motion_of(motion.thinned(MAX_FRAMES), kept) if motion else None,
            motion_of(bent, kept) if bent else None,
        )
        found = {int(kept[j]): role for j, role in found.items()}
    except SkeletonError as error:
        missing = [role.value for role in REQUIRED if not override.get(role)]
        if override and missing:
            raise SkeletonError(f"{error}; the one given lacks {', '.join(missing)}") from error
        if missing:
            raise
    roles = _merge(skeleton, hints, found, override)
    if sides.note and Role.LEFT_UPPER_LEG not in override:
        left = skeleton.names[roles.require(Role.LEFT_UPPER_LEG)]
        roles = replace(roles, notes=(f"{sides.note} ({left!r} is taken for the left thigh)",))
    if override:
        check_chains(skeleton, roles)
    if unsure := [skeleton.names[j] for j in roles.held if roles.confidence[j] < SURE]:
        note = f"less than {SURE:.0%} sure what {name_list(unsure)} is; see spark-sim inspect"
        roles = replace(roles, notes=(*roles.notes, note))
    return roles


def _said_by_others(skeleton: Skeleton, hints: Sequence[NameHint]) -> list[int]:
    """The nulls but for those whose names say what that of the joint in their place does not: a
    foot before its toe."""
    return [
        j for j, k in nulls_of(skeleton).items() if hints[j].parts.keys() <= hints[k].parts.keys()
    ]


REQUIRED = (
    Role.PELVIS,
    Role.LEFT_UPPER_LEG,
    Role.LEFT_LOWER_LEG,
    Role.RIGHT_UPPER_LEG,
    Role.RIGHT_LOWER_LEG,
)
"""What a map has to give where nothing can be inferred."""

Found = dict[int, tuple[Role, float, str]]


class _Sides(NamedTuple):
    """Whether the first one of a limb's two chains is the left one, and whether the body shows it
    `clear`ly; what makes it doubtful, for the reasons of their joints, and for the user."""

    first_left: bool
    clear: bool = True
    doubt: str = ""
    note: str = ""


def _infer(skeleton: Skeleton, motion: Motion | None, bent: Motion | None) -> tuple[Found, _Sides]:
    """Joint to role, confidence and reason; and what tells the legs' sides."""
    hints = with_votes(skeleton, read_names(skeleton.names))
    bends = None if bent is None else measure(skeleton, bent)
    anatomy = find_anatomy(measure(skeleton, motion), hints, bends)
    found: Found = {}
    pelvis = hints[anatomy.pelvis].parts.get("pelvis", 0.0) > 0.3
    found[anatomy.pelvis] = (Role.PELVIS, _confidence(pelvis, True, True), "carries the legs")
    for joints, role, part, reason in (
        (anatomy.spine, Role.SPINE, "spine", "between the pelvis and the arms"),
        (anatomy.neck, Role.NECK, "neck", "between the arms and the head"),
        (() if anatomy.head is None else (anatomy.head,), Role.HEAD, "head", "top of the trunk"),
    ):
        for j in joints:
            named = part in hints[j].parts
            why = _by_name(skeleton, hints, j) if named else reason
            found[j] = (role, _confidence(named, True, role is not Role.HEAD), why)
    for limb in (anatomy.legs, anatomy.arms):
        if limb is not None:
            _infer_limb(skeleton, hints, anatomy, limb, found)
    return found, _sides_of(hints, anatomy, anatomy.legs)


def _infer_limb(
    skeleton: Skeleton,
    hints: Sequence[NameHint],
    anatomy: Anatomy,
    limb: LabelledPair,
    found: Found,
) -> None:
    is_leg = limb is anatomy.legs
    sides = _sides_of(hints, anatomy, limb)
    for index, side in enumerate(("left", "right") if sides.first_left else ("right", "left")):
        for part in limb.labels[index].index:
            joint = limb.joint(index, part)
            assert joint is not None
            named = hints[joint].parts.get(part, 0.0) > 0.3
            why = f"chain from the {'pelvis down' if is_leg else 'trunk outwards'}"
            if named:
                why = _by_name(skeleton, hints, joint)
            sure = _confidence(named, joint in anatomy.mirrored, sides.clear)
            sure *= _DOUBTED if sides.doubt else 1.0
            found[joint] = (Role(f"{side}_{part}"), sure, f"{why}{sides.doubt}")


def _sides_of(hints: Sequence[NameHint], anatomy: Anatomy, limb: LabelledPair) -> _Sides:
    """Names tell the sides, unless the body shows the contrary; without names the body does."""
    shown = anatomy.sides.both
    if not limb.pair.sided:
        clear = abs(shown) > _CLEAR_SIDE
        return _Sides(shown >= 0, clear, "" if clear else "; the side is a guess")
    if _against_names(hints, anatomy):
        return _Sides(
            False,
            abs(shown) > _CLEAR_SIDE,
            ", but the body bends and stands as on its other side",
            "names call the body's left its right: knees, elbows and feet tell the sides",
        )
    if shown < -_CLEAR_SIDE:
        return _Sides(
            True,
            False,
            ", though it lies on the other side of the body",
            "names call left what looks like the body's right, and are believed; if it is wrong, "
            "give a map",
        )
    return _Sides(True, shown > _CLEAR_SIDE)


def _against_names(hints: Sequence[NameHint], anatomy: Anatomy) -> bool:
    """Whether the body shows that its names call left what is right: by its bends and its feet, or
    where it stands straight by joints that are toes by name."""
    shown, legs = anatomy.sides, anatomy.legs
    if max(shown) < _AGAINST_NAMES:
        return True
    toes = [legs.joint(side, "toe") for side in (0, 1)]
    named = all(toe is not None and "toe" in hints[toe].parts for toe in toes)
    return named and shown.feet < _TOES_BEHIND and shown.bends < _CLEAR_SIDE


def _by_name(skeleton: Skeleton, hints: Sequence[NameHint], joint: int) -> str:
    """The reason where a name tells the role."""
    by = " as the name encoder reads it" if hints[joint].unread else ""
    return f"name {skeleton.names[joint]!r}{by}"


def _confidence(named: bool, chained: bool, shaped: bool) -> float:
    """Independent pieces of evidence: wrong only where all of them are."""
    wrong = 1.0
    for holds, right in (
        (named, _NAME_RELIABILITY),
        (chained, _CHAIN_RELIABILITY),
        (shaped, _SHAPE_RELIABILITY),
    ):
        wrong *= 1.0 - right if holds else 1.0
    return round(1.0 - wrong, 3)


def _merge(
    skeleton: Skeleton, hints: Sequence[NameHint], found: Found, override: Override
) -> RoleMap:
    given = {j: role for role, joints in override.items() for j in joints}
    roles: list[Role | None] = []
    sure: list[float] = []
    reasons: list[str] = []
    for j in range(len(skeleton)):
        if j in given:
            entry: tuple[Role | None, float, str] = (given[j], 1.0, "given by the map")
        elif j in found and found[j][0] not in override:
            entry = found[j]
        elif hints[j].aside:
            entry = (None, _NAME_RELIABILITY, f"{hints[j].aside}, by its name")
        else:
            entry = (None, _CHAIN_RELIABILITY, "follows its parent")
        roles.append(entry[0])
        sure.append(entry[1])
        reasons.append(entry[2])
    return RoleMap(tuple(roles), tuple(sure), tuple(reasons))

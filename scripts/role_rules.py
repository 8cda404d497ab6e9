"""What each rule gives that tells joints' roles: wrong ones, with one rule left out at a time.

    python -m scripts.role_rules [DATA]

The rigs are those of `scripts.count_roles`: recordings, as they are and without names, and rigs
that are built, as they are and as caricatures. Prints Markdown: rigs with a wrong role, and in
brackets wrong joints.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

from scripts import count_roles
from scripts.count_roles import Rigs, ecosystem, in_tables, mixamo
from spark.errors import SkeletonError
from spark.io.reading import read_motion
from spark.motion import Motion
from spark.rig import anatomy, facing, limb_roles, name_hints, role_assignment, topology, trunk
from spark.rig.roles import RoleMap
from spark.skeleton import Skeleton
from tests.helpers.recordings import DATA

SETS = ("zoo", "animateddrawings", "makehuman", "mesh2motion", "reactidle")
CARICATURES = 4

# What stands in a rule's place.
WITHOUT: dict[str, tuple[ModuleType, object]] = {
    "_NAME_WEIGHT": (limb_roles, 0.0),
    "_strip_common": (name_hints, lambda *_: None),
    "_NOT_THE_FIRST": (limb_roles, 0.0),
    "named_pair": (anatomy, lambda *_: None),
    "find_pelvis": (anatomy, lambda skeleton, hints, legs: legs.root_joint),
    "_between": (trunk, lambda measured, *ends: topology.path_between(measured.skeleton, *ends)),
    "_leg_shape": (limb_roles, lambda *_: 0.0),
    "_arm_shape": (limb_roles, lambda *_: 0.0),
    "_STIFF": (limb_roles, -1.0),
    "_BENT_BONE": (limb_roles, 0.0),
    "_BELOW_A_WRIST": (limb_roles, 0.0),
    "_ends_at_crown": (trunk, lambda *_: False),
    "_align": (anatomy, lambda measured, legs, arms: (legs, arms)),
    "_bend": (facing, lambda *_: 0.0),
    "_foot": (facing, lambda *_: 0.0),
}


def without_names(skeleton: Skeleton, motion: Motion | None = None) -> RoleMap:
    """The roles of a rig whose names say nothing; none where it seems to be no body."""
    names = tuple(f"b{chr(97 + j % 26)}q{j}" for j in range(len(skeleton)))
    bare = replace(skeleton, names=names)
    moved = None if motion is None else replace(motion, skeleton=bare)
    try:
        return role_assignment.assign_roles(bare, moved)
    except SkeletonError:
        return RoleMap((None,) * len(skeleton), (0.0,) * len(skeleton), ("",) * len(skeleton))


def recorded(data: Path) -> Rigs:
    yield from mixamo(data)
    for name in SETS:
        yield from in_tables(f"{name}/*.bvh", data)


def built() -> Rigs:
    yield from ecosystem(0)
    yield from ecosystem(CARICATURES)


def wrong(rigs: Callable[[], Rigs]) -> str:
    """How many rigs have a wrong role, and how many joints."""
    missed: Iterator[int] = (
        sum(a is not b for a, b in zip(right, found, strict=True)) for *_, right, found in rigs()
    )
    counts = [*missed]
    return f"{sum(map(bool, counts))} ({sum(counts)})"


def main(folder: str = str(DATA)) -> None:
    with patch.object(count_roles, "read_motion", cache(read_motion)):
        table(partial(recorded, Path(folder)))


def table(recordings: Callable[[], Rigs]) -> None:
    print("| left out | recordings | rigs that are built | recordings without names |")
    print("|---|---|---|---|")
    for name in ("", *WITHOUT):
        module, nothing = WITHOUT.get(name, (trunk, None))
        with patch.object(module, name, nothing) if name else nullcontext():
            cells = [wrong(recordings), _or_none(built)]
            with patch.object(count_roles, "assign_roles", without_names):
                cells.append(wrong(recordings))
        print(f"| {f'`{name}`' if name else 'nothing'} | {' | '.join(cells)} |", flush=True)


def _or_none(rigs: Callable[[], Rigs]) -> str:
    try:
        return wrong(rigs)
    except SkeletonError:
        return "none is a body"


if __name__ == "__main__":
    main(*sys.argv[1:])

"""Whether the limits of a robot's hinges are in the unit that its file says."""

from typing import Literal

import numpy as np
from jaxtyping import Int

from robots.model.mjcf import Mjcf
from robots.model.urdf import is_urdf
from robots.tree import Tree
from spark.rig.roles import RoleMap

_TURNS = 4 * np.pi  # [rad] no limb's hinge goes farther from its zero; degrees, read as such, do
_LOCKED = 1e-3  # [rad] of a range that is there to hold a hinge
_STIFF = 0.15
"""[rad] Half of a robot's hinges turn by more than this from limit to limit: by 1.2 or more in the
registry's robots. A whole turn is 0.11 where its radians are read as degrees."""
_CHECK = "check their ranges in the file"


def doubtful_units(
    mjcf: Mjcf, tree: Tree, mj_joints: list[int], roles: RoleMap, links: Int[np.ndarray, "J"]
) -> tuple[str, ...]:
    """A note where hinges that carry a part with a role have limits of many turns, or most of them
    may turn by next to nothing: then degrees were likely read as radians, or radians as degrees."""
    above = {j for k in roles.held for j in tree.chain(int(links[k]))}
    limited = [j for j in sorted(above) if np.isfinite(tree.lower[j]) and not tree.balls[j]]
    ranges = {mjcf.joint_name(mj_joints[j]): mjcf.model.jnt_range[mj_joints[j]] for j in limited}
    farthest = {name: float(np.abs(ends).max()) for name, ends in ranges.items()}
    beyond = [name for name in farthest if farthest[name] > _TURNS]
    if beyond:
        worst = max(beyond, key=farthest.__getitem__)
        most = len(beyond) > len(ranges) / 2  # a single one may be meant to have no limits
        return (
            f"by their limits {len(beyond)} of {len(ranges)} hinges go beyond two turns "
            f"({worst!r} the most, to {farthest[worst]:.4g} rad): "
            f"{_advice(mjcf, 'degree') if most else _CHECK}",
        )
    widths = {name: float(np.ptp(ends)) for name, ends in ranges.items()}
    widths = {name: width for name, width in widths.items() if width > _LOCKED}
    stiff = [name for name in widths if widths[name] < _STIFF]
    if len(stiff) <= len(widths) / 2:
        return ()
    widest = max(stiff, key=widths.__getitem__)
    return (
        f"by their limits {len(stiff)} of {len(widths)} hinges hardly turn ({widest!r} the most, "
        f"by {np.degrees(widths[widest]):.2g} degrees): {_advice(mjcf, 'radian')}",
    )


def _advice(mjcf: Mjcf, likely: Literal["degree", "radian"]) -> str:
    if mjcf.spec.compiler.degree == (likely == "degree"):  # the file says so already
        return _CHECK
    if is_urdf(mjcf.path):
        return f"they are likely in {likely}s, and a URDF's are radians; convert them in the file"
    return (
        f'they are likely in {likely}s; set <compiler angle="{likely}"/>, or convert them in the '
        "file"
    )

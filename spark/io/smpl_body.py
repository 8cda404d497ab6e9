"""The SMPL family of bodies: joints, tree, and a mean skeleton of our own.

SMPL has 24 joints, SMPL-H 52 and SMPL-X 55, and what names them is public; their shapes are
licensed. So the skeleton here has the proportions of MakeHuman's base mesh (CC0), in the family's
rest pose: arms out, legs straight, looking along +z, y up. `read_body_model` reads the offsets of
a model file that the user has.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.arrays import Arrays, held, numbers, read_npz
from spark.skeleton import Skeleton

_BODY = """
pelvis -1, left_hip 0, right_hip 0, spine1 0, left_knee 1, right_knee 2, spine2 3, left_ankle 4,
right_ankle 5, spine3 6, left_foot 7, right_foot 8, neck 9, left_collar 9, right_collar 9, head 12,
left_shoulder 13, right_shoulder 14, left_elbow 16, right_elbow 17, left_wrist 18, right_wrist 19
"""
_FINGERS = ("index", "middle", "pinky", "ring", "thumb")
_LEFT_WRIST, _HEAD = 20, 15

# [m] Joints of MakeHuman's base mesh, symmetric, 1.74 m tall; x left, y up, z forward. The knuckles
# are those of SMPL's one joint a hand. Sides are given once, on the left.
_POSITIONS = {
    "pelvis": (0.0, 0.075, 0.0),
    "hip": (0.095, 0.0, 0.0),
    "spine1": (0.0, 0.155, -0.008),
    "spine2": (0.0, 0.275, -0.006),
    "spine3": (0.0, 0.376, -0.017),
    "knee": (0.103, -0.402, 0.002),
    "ankle": (0.107, -0.812, -0.012),
    "foot": (0.115, -0.862, 0.115),
    "neck": (0.0, 0.553, -0.007),
    "collar": (0.06, 0.490, -0.010),
    "head": (0.0, 0.650, 0.010),
    "shoulder": (0.177, 0.493, -0.015),
    "elbow": (0.421, 0.490, -0.020),
    "wrist": (0.659, 0.492, -0.012),
    "hand": (0.745, 0.489, -0.004),
    "jaw": (0.0, 0.640, 0.025),
    "eye": (0.030, 0.700, 0.100),
    "index1": (0.758, 0.491, 0.024),
    "index2": (0.790, 0.489, 0.026),
    "index3": (0.814, 0.487, 0.025),
    "middle1": (0.760, 0.489, -0.001),
    "middle2": (0.793, 0.488, 0.000),
    "middle3": (0.822, 0.485, 0.001),
    "ring1": (0.755, 0.489, -0.022),
    "ring2": (0.785, 0.488, -0.022),
    "ring3": (0.811, 0.486, -0.020),
    "pinky1": (0.747, 0.487, -0.040),
    "pinky2": (0.770, 0.486, -0.040),
    "pinky3": (0.787, 0.486, -0.039),
    "thumb1": (0.690, 0.485, 0.020),
    "thumb2": (0.716, 0.472, 0.040),
    "thumb3": (0.744, 0.465, 0.052),
}
_CROWN, _SOLE, _TOES = 0.855, -0.885, 0.20  # [m] top of the head, floor, tip of the toes (z)
_TIP = 0.025  # [m] from a finger's last joint on

MEAN_HEIGHT = _CROWN - _SOLE

# [m] How far a model's origin, which `trans` moves, lies above its pelvis: SMPL and SMPL-H, SMPL-X.
_ORIGIN_ABOVE, _ORIGIN_ABOVE_X = 0.24, 0.36

_MODEL_NAMES = {24: "SMPL", 52: "SMPL-H", 55: "SMPL-X"}


@dataclass(frozen=True)
class Body:
    """The skeleton of a model in its rest pose and own axes (y up, looking along z), and where its
    pelvis lies [m] from its origin."""

    skeleton: Skeleton
    pelvis: Float[np.ndarray, "3"]


def joints_of(count: int) -> tuple[tuple[str, ...], tuple[int, ...]]:
    """Names and parents of the first `count` joints: 22 are the body, 24, 52 and 55 a model's."""
    pairs = [word.split() for word in _BODY.replace("\n", " ").split(",")]
    names = [name for name, _ in pairs]
    parents = [int(parent) for _, parent in pairs]
    if count == 24:
        names += ["left_hand", "right_hand"]
        parents += [_LEFT_WRIST, _LEFT_WRIST + 1]
    if count == 55:
        names += ["jaw", "left_eye", "right_eye"]
        parents += [_HEAD] * 3
    if count > 24:
        for side, wrist in (("left", _LEFT_WRIST), ("right", _LEFT_WRIST + 1)):
            for finger in _FINGERS:
                parents += [wrist, len(names), len(names) + 1]
                names += [f"{side}_{finger}{k}" for k in (1, 2, 3)]
    return tuple(names), tuple(parents)


def mean_body(count: int, height: float, *, smplx: bool = False) -> Body:
    """The mean skeleton of the first `count` joints, `height` [m] tall; `smplx` is the model whose
    origin lies higher."""
    names, parents = joints_of(count)
    scale = height / MEAN_HEIGHT
    at = np.array([rest_position(name) for name in names]) * scale
    ends = {
        "head": (0.0, _CROWN, 0.0),
        "left_foot": (_POSITIONS["foot"][0], _SOLE, _TOES),
        "right_foot": (-_POSITIONS["foot"][0], _SOLE, _TOES),
    }
    ends |= {
        f"{side}_{finger}3": rest_position(f"{side}_{finger}3") + np.array([sign * _TIP, 0, 0])
        for side, sign in (("left", 1), ("right", -1))
        for finger in _FINGERS
    }
    tips = [
        (names.index(name), np.array(tip) * scale) for name, tip in ends.items() if name in names
    ]
    above = _ORIGIN_ABOVE_X if smplx or count == 55 else _ORIGIN_ABOVE
    return Body(_skeleton(names, parents, at, tips), np.array([0.0, -above * scale, 0.0]))


def read_body_model(
    path: Path, count: int, betas: Float[np.ndarray, "B"] | None
) -> tuple[Body, str]:
    """The skeleton of a model file of the family, for a body of shape `betas`, and what it is.

    The joints are `J_regressor` times the vertices, `v_template + shapedirs betas`, as the family
    defines them. `count` joints are used; a model with fewer lacks the others. Raises
    `FileFormatError` for anything that is no such model.
    """
    if path.suffix.lower() != ".npz":
        raise FileFormatError(
            path,
            None,
            "is no .npz; expected a model file such as SMPLX_NEUTRAL.npz (a .pkl can run any "
            "program, and is not read)",
        )
    arrays = read_npz(path)
    vertices = _array(arrays, "v_template", path, (None, 3))
    regressor = _array(arrays, "J_regressor", path, (None, len(vertices)))
    tree = _array(arrays, "kintree_table", path, (2, len(regressor)))
    found = len(regressor)
    if found not in _MODEL_NAMES:
        raise FileFormatError(
            path, None, f"has {found} joints; expected 24 (SMPL), 52 (SMPL-H) or 55 (SMPL-X)"
        )
    names, parents = joints_of(found)
    if tree[0, 1:].astype(np.int64).tolist() != list(parents[1:]):
        raise FileFormatError(path, None, "has another tree of joints than the SMPL family")
    what = f"{_MODEL_NAMES[found]} of {path.name}"
    if betas is not None and betas.any():
        shapes = _array(arrays, "shapedirs", path, (len(vertices), 3, None))
        # The first SMPL-X files have 10 shapes and 10 expressions, later ones 300 and 100.
        used = min(len(betas), 10 if shapes.shape[-1] == 20 else 300, shapes.shape[-1])
        vertices = vertices + shapes[..., :used] @ betas[:used]
        what += f" with {used} betas"
    at = regressor @ vertices
    wanted, wanted_parents = joints_of(count)
    missing = [name for name in wanted if name not in names]
    if missing:
        what += f"; it lacks {len(missing)} joints of the motion, which take their mean places"
    places = np.array([at[names.index(n)] if n in names else np.full(3, np.nan) for n in wanted])
    mean = mean_body(count, MEAN_HEIGHT).skeleton
    for j, (name, parent) in enumerate(zip(wanted, wanted_parents, strict=True)):
        if name in missing:
            places[j] = places[parent] + mean.offsets[j]
    floor = vertices[:, 1].min()
    left, right = wanted.index("left_foot"), wanted.index("right_foot")
    tips = [(wanted.index("head"), np.array([0.0, vertices[:, 1].max(), places[15, 2]]))]
    for j in (left, right):
        side = vertices[(vertices[:, 0] > 0) == (places[j, 0] > 0)]
        low = side[side[:, 1] < places[j, 1]]
        toe = float(low[:, 2].max()) if len(low) else float(places[j, 2])
        tips.append((j, np.array([places[j, 0], floor, toe])))
    return Body(_skeleton(wanted, wanted_parents, places, tips), places[0]), what


def rest_position(name: str) -> Float[np.ndarray, "3"]:
    """Where a joint of the mean skeleton is [m] in the rest pose: x left, y up, z forward."""
    side, _, part = name.rpartition("_")
    mirrored = np.array([-1.0 if side == "right" else 1.0, 1.0, 1.0])
    return np.array(_POSITIONS[part]) * mirrored


def _skeleton(
    names: tuple[str, ...],
    parents: tuple[int, ...],
    at: Float[np.ndarray, "J 3"],
    tips: list[tuple[int, Float[np.ndarray, "3"]]],
) -> Skeleton:
    offsets = at - at[list(parents)]
    offsets[0] = 0.0
    moves = np.arange(len(names)) == 0
    return Skeleton(
        names,
        np.array(parents),
        offsets,
        moves,
        np.array([j for j, _ in tips]),
        np.array([tip - at[j] for j, tip in tips]),
    )


def _array(
    arrays: Arrays, name: str, path: Path, shape: tuple[int | None, ...]
) -> Float[np.ndarray, "..."]:
    if name not in arrays:
        raise FileFormatError(
            path,
            None,
            f"has no plain array {name!r}; expected a model of the SMPL family as .npz "
            f"(v_template, J_regressor, kintree_table, shapedirs); it holds {held(arrays)}",
        )
    array = numbers(arrays, name, path)
    fits = array.ndim == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = " x ".join("any" if want is None else str(want) for want in shape)
        raise FileFormatError(
            path, None, f"{name!r} is {' x '.join(map(str, array.shape))}; expected {wanted}"
        )
    return array

"""The nodes of an FBX file and how they move, evaluated by ufbx (the package pufbx)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from spark.errors import DependencyError, FileFormatError, name_list
from spark.io.nodes import NodeJoint, chosen_clip, joints_of, line_to, varies
from spark.resample import frames_of_keys, rotations_at, values_at
from spark.rotation import matrix_from_quat

# Frames times nodes: what any file may hold, and how many more for each of its bytes. Mixamo's have
# a hundredth for each; an hour of two keys at its ends is no recording.
_FREE_VALUES, _VALUES_A_BYTE = 1_000_000, 0.2


class FbxScene:
    """An open FBX file; nodes are numbered in the library's order, the scene's own root first.

    Raises `FileFormatError` for anything that is no FBX file, `DependencyError` without pufbx.
    """

    def __init__(self, path: Path) -> None:
        try:
            import pufbx
        except ImportError as error:
            raise DependencyError(
                "reading FBX needs a package that isn't installed: pip install 'spark-sim[fbx]'"
            ) from error
        self.path = path
        self._library = pufbx
        try:
            self._scene: Any = pufbx.load_fbx(str(path))
        except (RuntimeError, ValueError) as error:
            raise FileFormatError(
                path,
                None,
                f"is no FBX file that can be read ({' '.join(str(error).split())}); "
                "expected FBX 6.1 to 7.7",
            ) from error
        self._nodes: list[Any] = list(self._scene.nodes)
        self.parents = [-1 if n.parent is None else n.parent.typed_id or -1 for n in self._nodes]
        """The node above each; -1 for those that hang on the scene alone."""
        self.is_bound = bool(len(self._scene.poses) or len(self._scene.skin_clusters))

    def joints(self) -> tuple[list[NodeJoint], tuple[str, ...]]:
        """Bones, and other nodes that lie between them, depth-first below one root; and notes.

        In a file without bones its empty nodes. Of several skeletons the largest.
        """
        notes: tuple[str, ...] = ()
        bones = [i for i, node in enumerate(self._nodes) if node.bone is not None]
        if not bones:
            bones = [i for i in range(1, len(self._nodes)) if self._is_empty(self._nodes[i])]
            notes += ("no node is a bone: its empty nodes are read as joints",)
        if not bones:
            raise FileFormatError(self.path, None, "holds no skeleton; expected bones")
        names = [node.name for node in self._nodes]
        joints, found = joints_of(bones, self.parents, names, self.path)
        return joints, notes + found

    def animation(
        self, frame_time: float, clip: str | None = None
    ) -> tuple[Any, Float[np.ndarray, "T"], tuple[str, ...]]:
        """The animation to read, the times [s] of its frames, and notes.

        The one called `clip`; of several the one that moves the most nodes, the longest of those:
        exporters leave empty ones beside it, and ones whose keys hold all nodes still. None and one
        frame where nothing moves.
        """
        stacks = list(self._scene.anim_stacks)
        self._check_span(frame_time)
        baked = [
            self._library.bake_anim(
                self._scene, s.anim, resample_rate=1 / frame_time, max_keyframe_segments=100_000
            )
            for s in stacks
        ]
        best = max(
            range(len(stacks)),
            key=lambda i: (*_moved(baked[i]), baked[i].key_time_max),
            default=None,
        )
        if clip is not None:
            best = chosen_clip(clip, [stack.name for stack in stacks], self.path)
        if best is None or not len(baked[best].modified_nodes):
            return (
                None,
                np.zeros(1),
                ("nothing moves in the file: its rest pose is the only frame",),
            )
        notes: tuple[str, ...] = ()
        if len(stacks) > 1:
            others = [stack.name for i, stack in enumerate(stacks) if i != best]
            notes += (f"animation {stacks[best].name!r} is read, not {name_list(others)}",)
        begin, end = baked[best].key_time_min, baked[best].key_time_max
        self._check_count((end - begin) / frame_time, f"from {begin:g} s to {end:g} s")
        count = int((end - begin) / frame_time + 1e-3) + 1
        return baked[best], begin + frame_time * np.arange(count), notes

    def _check_span(self, frame_time: float) -> None:
        """Raise where the keys span more than the file can mean: baking makes every frame."""
        spans = [(c.min_time, c.max_time) for c in self._scene.anim_curves if len(c.keyframes)]
        spans += [(s.time_begin, s.time_end) for s in self._scene.anim_stacks]
        if spans:
            begin, end = min(s[0] for s in spans), max(s[1] for s in spans)
            self._check_count((end - begin) / frame_time, f"from {begin:g} s to {end:g} s")

    def _check_count(self, frames: float, span: str) -> None:
        most = _FREE_VALUES + _VALUES_A_BYTE * self.path.stat().st_size
        if not -1 < frames * len(self._nodes) < most:  # nor NaN
            raise FileFormatError(
                self.path,
                None,
                f"has keys {span}, {frames:,.0f} frames of {len(self._nodes)} nodes; a file of "
                "its size holds no such recording",
            )

    def world(
        self, joints: list[NodeJoint], baked: Any, times: Float[np.ndarray, "T"]
    ) -> tuple[Float[np.ndarray, "T J 3"], Float[np.ndarray, "T J 3 3"]]:
        """Where the joints are and how their axes lie (with scale) at `times`, in file units and
        axes; not finite where the file's numbers are too large. Without `baked` that of the nodes'
        own transforms."""
        moved = {} if baked is None else {node.typed_id: node for node in baked.modified_nodes}
        position: dict[int, Any] = {}
        linear: dict[int, Any] = {}
        turn: dict[int, Any] = {}
        for i in dict.fromkeys(i for joint in joints for i in line_to(joint.node, self.parents)):
            with np.errstate(over="ignore", invalid="ignore"):
                at, rotation, scale = self._local(i, moved.get(i), times)
                own = matrix_from_quat(rotation)
                above = self.parents[i]
                if above >= 0:
                    at = position[above] + np.einsum("tij,tj->ti", linear[above], at)
                    alone = self._nodes[i].inherit_mode.name == "IGNORE_PARENT_SCALE"
                    within = turn[above] if alone else linear[above]
                    turn[i] = turn[above] @ own
                    own = within @ own
                else:
                    turn[i] = own
                position[i], linear[i] = at, own * scale[:, None, :]
        nodes = [joint.node for joint in joints]
        return np.stack([position[i] for i in nodes], 1), np.stack([linear[i] for i in nodes], 1)

    def _local(
        self, i: int, baked: Any, times: Float[np.ndarray, "T"]
    ) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 4"], Float[np.ndarray, "T 3"]]:
        """Translation, rotation and scale of a node in its parent."""
        own = self._nodes[i].local_transform
        at = np.tile(list(own.translation), (len(times), 1))
        quat = np.tile(np.roll(list(own.rotation), 1), (len(times), 1))  # xyzw to wxyz
        scale = np.tile(list(own.scale), (len(times), 1))
        if baked is not None:
            at = _at(times, baked.translation_keys, "xyz", values_at, at)
            scale = _at(times, baked.scale_keys, "xyz", values_at, scale)
            quat = _at(times, baked.rotation_keys, "wxyz", rotations_at, quat)
        # A scale of zero hides things; as a map it would have no inverse.
        return at, quat, np.where(np.abs(scale) < 1e-9, 1.0, scale)

    def paths(self) -> dict[int, tuple[str, ...]]:
        """The names of each node and of those above it, from the top down."""
        nodes = range(1, len(self._nodes))
        return {i: tuple(self._nodes[k].name for k in line_to(i, self.parents)) for i in nodes}

    @staticmethod
    def _is_empty(node: Any) -> bool:
        # By its type: the library can't hand on a light or a camera.
        return node.attrib_type.name not in ("MESH", "LIGHT", "CAMERA")


def _moved(baked: Any) -> tuple[int, int]:
    """How many nodes move, and how many have keys."""
    moving = sum(
        varies(_values(node.translation_keys, "xyz"))
        or varies(_values(node.rotation_keys, "wxyz"))
        or varies(_values(node.scale_keys, "xyz"))
        for node in baked.modified_nodes
    )
    return moving, len(baked.modified_nodes)


def _values(keys: Any, axes: str) -> Float[np.ndarray, "K n"]:
    if not len(keys):
        return np.zeros((0, len(axes)))
    return np.stack([keys["value"][axis] for axis in axes], axis=-1)


def _at(
    times: Float[np.ndarray, "T"],
    keys: Any,
    axes: str,
    blend: Callable[..., Float[np.ndarray, "T n"]],
    otherwise: Float[np.ndarray, "T n"],
) -> Float[np.ndarray, "T n"]:
    """What is keyed, at `times`; the first and last key hold beyond the ends."""
    if not len(keys):
        return otherwise
    return blend(_values(keys, axes), frames_of_keys(keys["time"], times))

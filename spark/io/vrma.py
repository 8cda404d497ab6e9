"""VRM animations (.vrma): a human's motion for any VRM avatar, as players of VRM take it.

VRM Consortium, "VRMC_vrm_animation-1.0": a GLB whose nodes rest in the T-pose, facing +Z, with the
bones of VRM 1.0 by name. Avatars take the rotations since that pose, and the hips' place in
proportion to their own hips' height.
"""

from pathlib import Path

from spark.io.glb import HEAD, animated
from spark.io.glb_file import FileNumbers, container
from spark.motion import Motion

_NAME = "VRMC_vrm_animation"


def write_vrma(motion: Motion, path: Path, *, name: str = "motion") -> None:
    """Write the motion of a skeleton whose joints are bones of VRM 1.0, by name, and whose rest
    pose is the T-pose, its hips as high as it stands. Raises `OutputError` where `path` can't be
    written."""
    file = FileNumbers()
    nodes, acted = animated(motion, file, name)
    bones = {bone: {"node": j} for j, bone in enumerate(motion.skeleton.names)}
    gltf = {
        **HEAD,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "animations": [acted],
        "extensionsUsed": [_NAME],
        "extensions": {_NAME: {"specVersion": "1.0", "humanoid": {"humanBones": bones}}},
        **file.entries(),
    }
    container(gltf, file, path)

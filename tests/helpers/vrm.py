"""VRM avatars made by code: the nodes of a motion, and which of them are a human's bones."""

from dataclasses import replace

from spark.motion import Motion
from spark.rig.rig import understand
from spark.rig.vrm_bones import bones_of_rig
from tests.helpers.gltf import Gltf, animated

META = {
    "name": "made by code",
    "authors": ["nobody"],
    "licenseUrl": "https://vrm.dev/licenses/1.0/",
}


def avatar(motion: Motion, *, version: int = 1, names: tuple[str, ...] | None = None) -> Gltf:
    """An avatar that rests in the rest pose of `motion`, of VRM 0 or 1, with nodes of these names.

    Its nodes' axes are turned at random, below an armature that is turned: VRM 1 allows that.
    """
    rig = understand(motion)
    # It stands on the floor at rest, as avatars do.
    offsets = motion.skeleton.offsets.copy()
    pelvis, hips = rig.tpose_positions[rig.pelvis], rig.tpose_positions[rig.hips].mean(axis=0)
    offsets[0] = [0, 0, rig.hip_height + pelvis[2] - hips[2]]
    standing = replace(motion, skeleton=replace(motion.skeleton, offsets=offsets))
    gltf = animated(standing, names=names)
    gltf.json["animations"] = []
    node_of = {node["name"]: i for i, node in enumerate(gltf.json["nodes"])}
    bones = {
        bone: node_of[(names or motion.skeleton.names)[j]] for bone, j in bones_of_rig(rig).items()
    }
    if version == 1:
        entry = {bone: {"node": node} for bone, node in bones.items()}
        vrm = {"specVersion": "1.0", "meta": META, "humanoid": {"humanBones": entry}}
        gltf.json["extensions"] = {"VRMC_vrm": vrm}
        gltf.json["extensionsUsed"] = ["VRMC_vrm"]
    else:
        rows = [{"bone": bone, "node": node} for bone, node in bones.items()]
        gltf.json["extensions"] = {"VRM": {"humanoid": {"humanBones": rows}, "specVersion": "0.0"}}
        gltf.json["extensionsUsed"] = ["VRM"]
    return gltf

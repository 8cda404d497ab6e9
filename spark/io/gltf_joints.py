"""Which nodes of a glTF file are joints: those of a skin, those that a VRM names, and what an
animation moves below them; in a file without any, the nodes that an animation turns."""

from pathlib import Path

from spark.io.gltf_file import GltfFile
from spark.io.joint_names import unique_names
from spark.io.nodes import joints_of, line_to
from spark.skeleton import Skeleton


def joint_nodes(file: GltfFile) -> list[int]:
    """The nodes that are joints: of the largest skin and those that share joints with it, of a
    humanoid's description (VRM), and what an animation moves below these; without any, the nodes
    that an animation turns."""
    skins = [set(skin["joints"]) for skin in file.json.get("skins", [])]
    bones = set(humanoid_bones(file).values())
    if skins:
        bones = bones.union(sorted(skins, key=len)[-1])
        for _ in skins:
            bones = bones.union(*(skin for skin in skins if skin & bones))
    if not all(type(i) is int and 0 <= i < len(file.nodes) for i in bones):
        raise file.error(f"has a skin on joints that are none of its {len(file.nodes)} nodes")
    turned = _targets(file, "rotation")
    if bones:
        parents = file.parents()
        moved = turned | _targets(file, "translation")
        bones |= {i for i in moved if bones.intersection(line_to(i, parents))}
    bones = bones or turned
    if not bones:
        raise file.error("holds no skeleton; expected a skin, or nodes that an animation turns")
    return sorted(bones)


def _targets(file: GltfFile, what: str) -> set[int]:
    """The nodes whose rotation (or translation) some animation of the file moves."""
    targets = [
        channel["target"]
        for animation in file.json.get("animations", [])
        for channel in animation["channels"]
    ]
    return {t["node"] for t in targets if t["path"] == what and t.get("node") is not None}


def humanoid_bones(file: GltfFile) -> dict[str, int]:
    """The nodes that VRM 1.0, VRM animations or VRM 0 call a human's bones, by VRM's names."""
    found = file.json.get("extensions", {})
    for name in ("VRMC_vrm", "VRMC_vrm_animation", "VRM"):
        bones = found.get(name, {}).get("humanoid", {}).get("humanBones", {})
        if isinstance(bones, dict):
            bones = [{"bone": bone, **where} for bone, where in bones.items()]
        if bones:
            return {str(where["bone"]): where["node"] for where in bones}
    return {}


def humanoid_joints(path: Path, skeleton: Skeleton) -> dict[str, int]:
    """The joints of a recording of the file that it calls a human's bones (VRM), by VRM's names;
    none in other files."""
    file = GltfFile(path)
    with file.checked():
        bones = humanoid_bones(file)
        joints = {node: name for name, node in skeleton_nodes(file)} if bones else {}
        return {
            bone: skeleton.names.index(joints[node])
            for bone, node in bones.items()
            if node in joints and joints[node] in skeleton.names
        }


def skeleton_nodes(file: GltfFile) -> list[tuple[str, int]]:
    """The joints' names as a recording has them, and their nodes, in the order of its skeleton."""
    parents = file.parents()
    names = [file.name_of(i) for i in range(len(file.nodes))]
    joints, _ = joints_of(joint_nodes(file), parents, names, file.path)
    unique, _ = unique_names([joint.name for joint in joints])
    return list(zip(unique, (joint.node for joint in joints), strict=True))

"""How the nodes of an FBX file rest: as their own transforms have it, or as the skin was bound, of
which a bind pose and the clusters tell.
"""

from collections import defaultdict

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.bound_pose import Map, bound_pose
from spark.io.fbx_document import Element, plain_name, read_document
from spark.io.fbx_materials import Links
from spark.io.fbx_scene import FbxScene
from spark.io.nodes import NodeJoint
from spark.io.scanner import LARGEST

_ROOT = 0  # the id of the scene itself


def rest_maps(scene: FbxScene, links: Links) -> dict[int, Map]:
    """The place and linear map in the world at rest of all of the scene's nodes."""
    return bound_maps(scene, links) or _own_maps(scene)


def bound_maps(scene: FbxScene, links: Links | None = None) -> dict[int, Map] | None:
    """Where all of the scene's nodes are in the pose in which the skin was bound; None where that
    pose isn't told, or no straighter than the nodes' own transforms are."""
    if not scene.is_bound:
        return None
    if links is None:
        try:
            links = Links.of(read_document(scene.path))
        except FileFormatError:  # FBX 6, of which the library reads the nodes alone
            return None
    own = _own_maps(scene)
    joints = [joint.node for joint in scene.joints()[0]]
    placed = {node: map for node, map in _placed(scene, links).items() if node in joints}
    if not all((np.abs(map) < LARGEST).all() for maps in own.values() for map in maps):
        return None
    return bound_pose(own, placed, joints, scene.parents)


def _own_maps(scene: FbxScene) -> dict[int, Map]:
    """As the nodes' own transforms have them."""
    nodes = range(1, len(scene.parents))
    at, axes = scene.world([NodeJoint(i, "", -1) for i in nodes], None, np.zeros(1))
    return {i: (at[0, k], axes[0, k]) for k, i in enumerate(nodes)}


def scene_nodes(scene: FbxScene, links: Links) -> dict[int, int]:
    """The scene's node of each model: that of the same names from the top down."""
    by_path = defaultdict(list)
    for node, line in scene.paths().items():
        by_path[line].append(node)
    nodes: dict[int, int] = {}
    for id, model in links.objects.items():
        if model.name == "Model" and (same := by_path[_path(links, id)]):
            nodes[id] = same.pop(0)
    return nodes


def _path(links: Links, id: int) -> tuple[str, ...]:
    line: list[str] = []
    seen = set()
    while id != _ROOT and id not in seen:
        seen.add(id)
        line.append(plain_name(links.objects[id].values[1]))
        above = links.above(id, "Model")
        id = above[0] if above else _ROOT
    return tuple(reversed(line))


def _placed(scene: FbxScene, links: Links) -> dict[int, Float[np.ndarray, "4 4"]]:
    """Where nodes were when the skin was bound."""
    nodes = scene_nodes(scene, links)
    told: list[tuple[object, Element, str]] = []
    for id, element in links.objects.items():
        match element.name, element.values[2]:
            case "Pose", "BindPose":
                told += [(each.value("Node"), each, "Matrix") for each in element.all("PoseNode")]
            case "Deformer", "Cluster":
                told += [(bone, element, "TransformLink") for bone, _ in links.below(id, "Model")]
    placed: dict[int, Float[np.ndarray, "4 4"]] = {}
    for model, element, name in told:
        numbers = element.numbers(name)
        if type(model) is not int or model not in nodes or len(numbers) != 16:
            continue
        matrix = numbers.reshape(4, 4).T
        if (np.abs(matrix) < LARGEST).all() and abs(np.linalg.det(matrix[:3, :3])) > 0:
            placed.setdefault(nodes[model], matrix)
    return placed

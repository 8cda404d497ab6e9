"""Skinned characters made by code: a tube along each bone, in two materials, one with a picture."""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from spark.motion import Motion
from tests.helpers.gltf import Gltf, animated

RADIUS, RING, ROWS = 0.05, 10, 6  # [m], vertices around, rows along a bone


def checked_picture() -> Image.Image:
    """Red above, blue below, with white dots."""
    pixels = np.zeros((64, 64, 3), np.uint8)
    pixels[:32], pixels[32:] = (220, 40, 40), (40, 60, 220)
    pixels[::8, ::8] = 255
    return Image.fromarray(pixels)


def tube(tip: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Vertices along a bone from the origin to `tip`, faces, and where each lies along (0 to 1) and
    around it."""
    along = tip / np.linalg.norm(tip)
    side = np.cross(along, [1.0, 0, 0] if abs(along[0]) < 0.8 else [0, 1.0, 0])
    side /= np.linalg.norm(side)
    other = np.cross(along, side)
    v, u = np.meshgrid(np.linspace(0, 1, ROWS), np.linspace(0, 1, RING + 1), indexing="ij")
    around = 2 * np.pi * u[..., None]
    points = v[..., None] * tip + radius * (np.cos(around) * side + np.sin(around) * other)
    a = (np.arange(ROWS - 1)[:, None] * (RING + 1) + np.arange(RING)).ravel()
    faces = np.concatenate(
        [
            np.stack([a, a + 1, a + RING + 1], 1),
            np.stack([a + 1, a + RING + 2, a + RING + 1], 1),
        ]
    )
    return points.reshape(-1, 3), faces, v.ravel(), u.ravel()


def character(motion: Motion, *, radius: float = RADIUS, picture: bool = True, **how: Any) -> Gltf:
    """The motion on a skin of tubes. Near its start, a tube hangs on the joint above as well. Bones
    of the left half are plain green, the others have a picture."""
    gltf = animated(motion, **how)
    skeleton = motion.skeleton
    count = len(skeleton)
    halves: list[list[tuple[np.ndarray, ...]]] = [[], []]
    tips = [(int(p), skeleton.offsets[j]) for j, p in enumerate(skeleton.parents) if j]
    tips += list(zip(skeleton.end_parents.tolist(), skeleton.end_offsets, strict=True))
    for joint, tip in tips:
        if np.linalg.norm(tip) < 1e-3:
            continue
        points, faces, v, u = tube(np.asarray(tip), radius)
        parent = max(int(skeleton.parents[joint]), 0)
        above = np.clip(0.5 - 1.5 * v, 0.0, 1.0)
        # The nodes come last first, and so do the joints of the skin: `node_of` is in our order.
        joints = np.tile([joint, parent, 0, 0], (len(points), 1))
        weights = np.stack([1 - above, above, 0 * v, 0 * v], axis=1)
        place = skeleton.rest_positions[joint]
        left = "left" in skeleton.names[joint].lower() or skeleton.names[joint].startswith("L")
        halves[int(left)].append((points + place, faces, joints, weights, np.stack([u, v], axis=1)))
    primitives = []
    for material, parts in enumerate(halves):
        if not parts:
            continue
        starts = np.cumsum([0, *(len(points) for points, *_ in parts)])
        points = np.concatenate([p[0] for p in parts])[:, [0, 1, 2]]
        faces = np.concatenate([p[1] + s for p, s in zip(parts, starts, strict=False)])
        attributes = {"POSITION": gltf.accessor(points)}
        joints = np.concatenate([p[2] for p in parts]).astype("<u2")
        attributes["JOINTS_0"] = _raw(gltf, joints, 5123, "VEC4")
        attributes["WEIGHTS_0"] = gltf.accessor(np.concatenate([p[3] for p in parts]))
        attributes["TEXCOORD_0"] = gltf.accessor(np.concatenate([p[4] for p in parts]))
        indices = _raw(gltf, faces.astype("<u4").reshape(-1, 1), 5125, "SCALAR")
        primitives.append({"attributes": attributes, "indices": indices, "material": material})
    look: dict[str, Any] = {"baseColorFactor": [1, 1, 1, 1]}
    if picture:
        buffer = BytesIO()
        checked_picture().save(buffer, format="PNG")
        gltf.json["images"] = [
            {"bufferView": gltf.view(buffer.getvalue()), "mimeType": "image/png"}
        ]
        gltf.json["textures"] = [{"source": 0}]
        look["baseColorTexture"] = {"index": 0}
    green = {"baseColorFactor": [0.05, 0.6, 0.1, 1]}
    gltf.json["materials"] = [{"pbrMetallicRoughness": look}, {"pbrMetallicRoughness": green}]
    gltf.json["meshes"] = [{"primitives": primitives}]
    gltf.json["nodes"].append({"name": "surface", "mesh": 0, "skin": 0})
    gltf.json["scenes"][0]["nodes"].append(count + 1)
    return gltf


def write_character(motion: Motion, path: Path, **how: Any) -> Path:
    """`character` as a GLB."""
    return character(motion, **how).write(path)


def _raw(gltf: Gltf, values: np.ndarray, kind: int, shape: str) -> int:
    gltf.json["accessors"].append(
        {
            "bufferView": gltf.view(values.tobytes()),
            "componentType": kind,
            "type": shape,
            "count": len(values),
        }
    )
    return len(gltf.json["accessors"]) - 1

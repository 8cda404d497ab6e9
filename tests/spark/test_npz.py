"""Npz files read without trust: what numpy reads, and no more memory than the file can mean."""

import io
import random
import tracemalloc
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn

from spark.errors import FileFormatError
from spark.npz import Npz

ARRAYS = stn.arrays(
    st.one_of(
        stn.floating_dtypes(sizes=(16, 32, 64)),
        stn.integer_dtypes(),
        stn.boolean_dtypes(),
        stn.unicode_string_dtypes(min_len=1),
        stn.byte_string_dtypes(min_len=1),
    ),
    stn.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4),
    elements={
        "alphabet": st.characters(exclude_categories=["Cs"])
    },  # halves of letters are refused
)


@settings(deadline=None)
@given(array=ARRAYS, columns=st.booleans(), compressed=st.booleans())
def test_arrays_are_those_of_numpy(
    array: np.ndarray, columns: bool, compressed: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "a.npz"
    ordered = np.asfortranarray(array) if columns else array
    (np.savez_compressed if compressed else np.savez)(path, a=ordered)
    with np.load(path) as theirs:
        ours = Npz(path, expected="arrays")
        assert list(ours) == theirs.files
        np.testing.assert_array_equal(ours["a"], theirs["a"])
        assert ours["a"].dtype == theirs["a"].dtype


def test_halves_of_letters_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", a=np.array(["\ud800"]))
    with pytest.raises(FileFormatError, match="no letter"):
        Npz(tmp_path / "a.npz", expected="arrays")["a"]


def npz(folder: Path, *, method: int = zipfile.ZIP_STORED, **members: bytes) -> Path:
    with zipfile.ZipFile(folder / "a.npz", "w", method) as file:
        for name, data in members.items():
            file.writestr(f"{name}.npy", data)
    return folder / "a.npz"


def npy(header: str, data: bytes = b"") -> bytes:
    text = header.encode("latin-1")
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def stored(array: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


EIGHT = b"\0" * 8
HOSTILE = {
    "brackets": npy("(" * 9000, EIGHT),
    "a call": npy("{'descr': __import__('os'), 'fortran_order': False, 'shape': ()}", EIGHT),
    "a shape of floats": npy("{'descr': '<f8', 'fortran_order': False, 'shape': (1.5,)}", EIGHT),
    "a huge shape": npy("{'descr': '<f8', 'fortran_order': False, 'shape': (10**9,)}", EIGHT),
    "a long shape": npy(
        "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "1" * 5000 + ",)}", EIGHT
    ),
    "a shape of commas": npy(
        "{'descr': '<f8', 'fortran_order': False, 'shape': (" + "1," * 4000 + "x)}", EIGHT
    ),
    "objects": npy("{'descr': '|O', 'fortran_order': False, 'shape': (1,)}", EIGHT),
    "records": npy("{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (1,)}", EIGHT),
    "more than its bytes": npy("{'descr': '<f8', 'fortran_order': False, 'shape': (2,)}", EIGHT),
    "text of no length": npy("{'descr': '<U0', 'fortran_order': False, 'shape': (9,)}"),
    "no magic": b"hello, world, here I am",
    "nothing": b"",
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_hostile_headers_are_refused(data: bytes, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"a\.npz: 'x' can't be read .*expected a motion"):
        Npz(npz(tmp_path, x=data), expected="a motion")["x"]


def test_a_bomb_takes_no_memory(tmp_path: Path) -> None:
    """200 MB of zeros in 1 MB: nothing is read, and what stands beside it still is."""
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        file.writestr("bomb.npy", stored(np.zeros(25 << 20)))
        file.writestr("small.npy", stored(np.arange(3)))
    tracemalloc.start()
    arrays = Npz(tmp_path / "a.npz", expected="a motion")
    np.testing.assert_array_equal(arrays["small"], [0, 1, 2])
    with pytest.raises(FileFormatError, match="'bomb' takes 200 MB, far more"):
        arrays["bomb"]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 << 20


def test_many_members_share_one_allowance(tmp_path: Path) -> None:
    content = stored(np.zeros(3 << 20))
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for k in range(8):
            file.writestr(f"{k}.npy", content)
    arrays = Npz(tmp_path / "a.npz", expected="a motion")
    for _ in range(7):
        assert arrays["0"].size == 3 << 20  # the same one again costs nothing more
    with pytest.raises(FileFormatError, match="far more than such a file holds"):
        [arrays[name] for name in arrays]


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_methods_that_numpy_never_uses(method: int, tmp_path: Path) -> None:
    path = npz(tmp_path, method=method, x=stored(np.arange(3)))
    with pytest.raises(FileFormatError, match="compressed in a way"):
        Npz(path, expected="a motion")["x"]


def test_encrypted_members(tmp_path: Path) -> None:
    path = npz(tmp_path, x=stored(np.arange(3)))
    data = bytearray(path.read_bytes())
    for signature, at in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(signature) + at] |= 1
    path.write_bytes(data)
    with pytest.raises(FileFormatError, match="'x' is encrypted"):
        Npz(path, expected="a motion")["x"]


def test_other_members_are_no_arrays(tmp_path: Path) -> None:
    path = npz(tmp_path, x=stored(np.arange(3)))
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("readme.txt", "hello")
    assert list(Npz(path, expected="a motion")) == ["x"]


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_mutated_files_end_in_arrays_or_an_error(
    seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    chance = random.Random(seed)
    path = tmp_path_factory.getbasetemp() / "m.npz"
    np.savez_compressed(path, a=np.arange(12.0).reshape(3, 4), names=np.array(["x", "yy"]))
    data = bytearray(path.read_bytes())
    for _ in range(chance.randint(1, 8)):
        at = chance.randrange(len(data))
        data[at : at + chance.choice((0, 1, 1, 4))] = chance.randbytes(chance.choice((0, 1, 4)))
    path.write_bytes(data)
    with suppress(FileFormatError):
        arrays = Npz(path, expected="a motion")
        for name in arrays:
            assert arrays[name].size <= 2000

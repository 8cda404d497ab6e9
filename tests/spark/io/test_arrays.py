"""npy and npz: as numpy reads them, without pickles, in no more memory than there are bytes."""

import struct
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from spark.errors import FileFormatError
from spark.io.arrays import npz_names, rate_in, read_npy, read_npz
from spark.npz import array_in
from tests.helpers.hostile import Bomb, damaged, edits

PLAIN = st.sampled_from(["<f4", ">f8", "<i8", "|u1", "?", "<U5", "|S3", "<f2", "<c8"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("arrays")


@given(
    array=PLAIN.flatmap(lambda d: arrays_of.arrays(d, arrays_of.array_shapes(min_dims=0))),
    columns=st.booleans(),
)
@settings(deadline=None, max_examples=60)
def test_reads_what_numpy_writes(folder: Path, array: np.ndarray, columns: bool) -> None:
    array = np.asfortranarray(array) if columns else array
    np.save(folder / "a.npy", array)
    np.savez_compressed(folder / "a.npz", it=array)
    for read in (read_npy(folder / "a.npy"), read_npz(folder / "a.npz")["it"]):
        assert read.dtype == array.dtype
        np.testing.assert_array_equal(read, array)


def test_pickles_are_left_alone(tmp_path: Path) -> None:
    bomb = np.array([Bomb(tmp_path / "ran")], dtype=object)
    np.savez(tmp_path / "a.npz", poses=np.zeros((2, 3)), labels=bomb)
    arrays = read_npz(tmp_path / "a.npz")
    assert list(arrays) == ["poses"]
    assert arrays.pickled == ("labels",)
    np.save(tmp_path / "a.npy", bomb)
    with pytest.raises(FileFormatError, match=r"a\.npy: holds Python objects"):
        read_npy(tmp_path / "a.npy")
    assert not (tmp_path / "ran").exists()
    np.load(tmp_path / "a.npy", allow_pickle=True)
    assert (tmp_path / "ran").exists()  # what would have happened


def test_memory_goes_with_the_file(tmp_path: Path) -> None:
    """A header that claims much, and a zip of zeros."""
    np.save(tmp_path / "a.npy", np.zeros(4))
    data = (tmp_path / "a.npy").read_bytes()
    (tmp_path / "a.npy").write_bytes(data.replace(b"(4,)", b"(99999999999,)".ljust(4)))
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("a.npy", data[:128] + bytes(300_000_000))
    tracemalloc.start()
    for read, name in ((read_npy, "a.npy"), (read_npz, "a.npz")):
        with pytest.raises(FileFormatError, match=name):
            read(tmp_path / name)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2e6


@pytest.mark.parametrize("data", [b"", b"PK", b"\x93NUMPY", b"\x93NUMPY\x01\x00\xff\xff{", b"{}"])
def test_what_is_no_array(tmp_path: Path, data: bytes) -> None:
    for name, read in (("a.npy", read_npy), ("a.npz", read_npz)):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(FileFormatError, match=name):
            read(tmp_path / name)
        with pytest.raises(FileFormatError, match="no such file"):
            read(tmp_path / "nowhere")
    assert npz_names(tmp_path / "a.npz") == frozenset()


@given(changes=edits, packed=st.booleans(), several=st.booleans())
@settings(deadline=None, max_examples=150)
def test_damaged_files_give_arrays_or_an_error_of_ours(
    folder: Path, changes: list[tuple[str, int, int]], packed: bool, several: bool
) -> None:
    save = np.savez_compressed if packed else np.savez
    save(folder / "whole.npz", poses=np.arange(12.0).reshape(2, 6), gender="male", fps=30)
    np.save(folder / "whole.npy", np.arange(12.0).reshape(2, 6))
    name, read = ("c.npz", read_npz) if several else ("c.npy", read_npy)
    (folder / name).write_bytes(damaged((folder / f"whole{name[1:]}").read_bytes(), changes))
    try:
        found = read(folder / name)
    except FileFormatError:
        return
    assert all(a.dtype != object for a in (found.values() if isinstance(found, dict) else [found]))


@pytest.mark.parametrize("code", [0x110000, 0xFFFFFFFF, 0xD800])
def test_text_of_no_letters_is_refused(code: int, tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array(["hips"]))
    whole = (tmp_path / "a.npy").read_bytes()
    assert array_in(whole).tolist() == ["hips"]
    spoilt = whole.replace(struct.pack("<I", ord("h")), struct.pack("<I", code))
    with pytest.raises(ValueError, match="no letter"):
        array_in(spoilt)


@pytest.mark.parametrize("value", [120.0, 60, "male", b"female", np.float64(59.94), np.int32(30)])
@pytest.mark.parametrize("shape", [(), (1,)])
def test_one_value_saved_as_an_object_is_plain(
    value: object, shape: tuple[int, ...], tmp_path: Path
) -> None:
    """AMASS has its rate and gender so, in some of its sets."""
    held = np.empty(shape, dtype=object)
    held[...] = value
    np.savez(tmp_path / "a.npz", it=held)
    arrays = read_npz(tmp_path / "a.npz")
    assert arrays.pickled == ()
    assert arrays["it"].ravel()[0] == value


@pytest.mark.parametrize("value", [None, [1, 2], {"a": 1}, np.zeros(3), "x" * 5000])
def test_other_objects_are_left_out_and_named(value: object, tmp_path: Path) -> None:
    held = np.empty((), dtype=object)
    held[()] = value
    np.savez(tmp_path / "a.npz", it=held)
    arrays = read_npz(tmp_path / "a.npz")
    assert (arrays.pickled, dict(arrays)) == (("it",), {})


@pytest.mark.parametrize(
    ("rates", "fps", "said"),
    [
        ({}, None, ""),
        ({"mocap_framerate": [120.0]}, 120, ""),
        ({"fps": 30, "mocap_framerate": 30.0}, 30, ""),
        ({"mocap_framerate": 120.0, "fps": 30}, 30, "'fps' is 30, 'mocap_framerate' is 120"),
    ],
)
def test_of_two_rates_the_file_s_own_counts(
    rates: dict[str, object], fps: float | None, said: str
) -> None:
    """Who resamples AMASS's recordings and keeps their other arrays leaves theirs beside it."""
    notes: list[str] = []
    arrays = {name: np.array(rate) for name, rate in rates.items()}
    assert rate_in(arrays, Path("a.npz"), notes) == fps
    assert [said in note for note in notes] == [True] * bool(said)

"""Pickles walked by hand: the values that pickle itself gives, and nothing run."""

import pickle
import pickletools
import random
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn

from spark.errors import FileFormatError
from spark.plain_pickle import read_plain_pickle

ARRAYS = stn.arrays(
    st.one_of(stn.floating_dtypes(), stn.integer_dtypes(), stn.boolean_dtypes()),
    stn.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.tuples(inner, inner),
    max_leaves=12,
)


def read(data: bytes, folder: Path) -> Any:
    path = folder / "a.pkl"
    path.write_bytes(data)
    return read_plain_pickle(path, expected="a motion")


@settings(deadline=None)
@given(
    entries=st.dictionaries(st.text(), PLAIN, max_size=4),
    protocol=st.integers(0, pickle.HIGHEST_PROTOCOL),
)
def test_plain_values_are_those_of_pickle(
    entries: dict[str, Any], protocol: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.getbasetemp()
    assert read(pickle.dumps(entries, protocol=protocol), folder) == entries


@settings(deadline=None)
@given(array=ARRAYS, columns=st.booleans(), protocol=st.integers(0, pickle.HIGHEST_PROTOCOL))
def test_arrays_are_those_of_pickle(
    array: np.ndarray, columns: bool, protocol: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    ordered = np.asfortranarray(array) if columns else array
    back = read(pickle.dumps({"a": ordered}, protocol=protocol), tmp_path_factory.getbasetemp())[
        "a"
    ]
    assert back.dtype == array.dtype
    np.testing.assert_array_equal(back, array)


def test_scalars_and_older_names(tmp_path: Path) -> None:
    data = pickle.dumps({"fps": np.float64(29.97), "n": np.int32(3)}, protocol=4)
    older = data.replace(b"numpy._core", b"numpy.core")  # shorter by one: protocol 2 has no lengths
    assert read(data, tmp_path) == {"fps": 29.97, "n": 3}
    assert older != data
    by_line = pickle.dumps({"fps": np.float64(29.97)}, protocol=0)
    assert read(by_line.replace(b"numpy._core", b"numpy.core"), tmp_path) == {"fps": 29.97}


def array_of(dtype: bytes, state: bytes) -> bytes:
    """An array with a state of its own, in protocol 2."""
    made = b"cnumpy._core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85C\x01b\x87R"
    return b"\x80\x04" + made + b"(K\x01" + state.replace(b"DTYPE", dtype) + b"tb."


MINUS_ONE = b"J\xff\xff\xff\xff"
FLOATS = b"cnumpy\ndtype\n\x8c\x02f8\x89\x88\x87R(K\x03\x8c\x01<NNN" + 2 * MINUS_ONE + b"K\x00tb"
OTHER_ORDER = FLOATS.replace(b"\x8c\x01<", b"\x8c\x01|")
HOSTILE = {
    # numpy takes these bytes for pointers to objects
    "objects": array_of(FLOATS.replace(b"f8", b"O8"), b"K\x01\x85DTYPE\x89C\x08AAAAAAAA"),
    "a dtype's state": array_of(
        FLOATS.replace(b"\x8c\x01<", b"\x8c\x01|"), b"K\x01\x85DTYPE\x89C\x01A"
    ),
    "a huge shape": array_of(FLOATS, b"J\xff\xff\xff\x7f\x85DTYPE\x89C\x08AAAAAAAA"),
    "no bytes": array_of(FLOATS, b"K\x04\x85DTYPE\x89C\x08AAAAAAAA"),
    "a negative shape": array_of(FLOATS, MINUS_ONE + b"\x85DTYPE\x89C\x08AAAAAAAA"),
    "a memo of 2^32": b"Nr\xff\xff\xff\xff0.",
    "a long of 2 GB": b"\x8b\xff\xff\xff\x7f.",
    "bytes of 2^60": b"\x8e" + struct.pack("<Q", 1 << 60) + b".",
    "a mark that is not there": b"\x80\x04t.",
    "an instance": b"(i__builtin__\nobject\n.",
    "a persistent thing": b"Pthing\n.",
    "a value that isn't there": b"h\x05.",
    "keys that can't be": b"}](a]NsN.",
    "nothing": b"",
    "no end": b"\x80\x04N",
}


@pytest.mark.parametrize("data", HOSTILE.values(), ids=HOSTILE)
def test_hostile_pickles_are_refused(data: bytes, tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"a\.pkl: .*expected a motion"):
        read(data, tmp_path)


def test_the_template_of_hostile_arrays_is_an_array(tmp_path: Path) -> None:
    """The cases above fail for their own sake."""
    fine = array_of(FLOATS, b"K\x01\x85DTYPE\x89C\x08" + struct.pack("<d", 2.5))
    np.testing.assert_array_equal(read(fine, tmp_path), [2.5])
    np.testing.assert_array_equal(pickle.loads(fine), [2.5])


def test_many_values_are_refused_in_time(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="more than 300,000 values"):
        read(b"]" + b"Na" * 200_000 + b".", tmp_path)


SEEDS = [
    pickle.dumps(
        {"fps": 30, "root_pos": np.zeros((2, 3)), "names": ["a", "b"], "x": np.float32(1)},
        protocol=protocol,
    )
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1)
]
CODES = [code.code.encode("latin-1") for code in pickletools.opcodes]


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_mutated_pickles_end_in_a_value_or_an_error(
    seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    chance = random.Random(seed)
    data = bytearray(chance.choice(SEEDS))
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(len(data))
        data[at : at + chance.choice((0, 1, 1, 4))] = chance.choice(
            (chance.choice(CODES), chance.randbytes(4), b"\xff" * 4, b"")
        )
    with suppress(FileFormatError):
        read(bytes(data), tmp_path_factory.getbasetemp())

"""A little of `make fuzz`: spoilt files give a result or an error of ours, within bounds."""

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz import case
from tests.fuzz.case import OverBoundError, judge
from tests.fuzz.spoil import changes, numbers, spoilt
from tests.fuzz.target import Target, finite
from tests.fuzz.targets import FORMATS

Edits = list[tuple[str, int, int]]


@pytest.mark.filterwarnings("ignore::RuntimeWarning", "ignore::UserWarning")
@pytest.mark.parametrize("name", FORMATS)
def test_spoilt_files(name: str) -> None:
    if name == "fbx":
        pytest.importorskip("pufbx", reason="pufbx is not installed (the extra fbx)")
    target = FORMATS[name]
    with TemporaryDirectory() as scratch:
        seeds = target.seeds(Path(scratch))
        path = Path(scratch) / f"case{target.ending}"

        @settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
        @given(st.sampled_from(seeds), numbers, changes)
        def use(
            data: bytes, values: list[tuple[int, str]], edits: list[tuple[str, int, int]]
        ) -> None:
            path.write_bytes(spoilt(data, values, edits))
            judge(target, path)

        use()


@pytest.mark.parametrize("fault", ["untyped", "nonsense", "slow", "large"])
def test_faults_are_found(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def use(path: Path) -> None:
        if fault == "untyped":
            raise ValueError
        if fault == "nonsense":
            finite(value=float("nan"))
        while fault == "slow":
            pass
        if fault == "large":
            bytearray(b"x") * 50_000_000

    monkeypatch.setattr(case, "SECONDS", 0.2)
    monkeypatch.setattr(case, "MEMORY", 10e6)
    path = tmp_path / "file"
    path.write_bytes(b"x")
    with pytest.raises((ValueError, AssertionError)) as found:
        judge(Target("", lambda folder: [], use), path)
    assert isinstance(found.value, OverBoundError) == (fault in ("slow", "large"))

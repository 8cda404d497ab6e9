"""What `--keep` understands, and what it refuses."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.report import assess
from sim.report.names import UNITS
from sim.trajectory import Subject
from spark.errors import ConventionError
from spark_sim.shelf.headline import MEASURES, headline, key
from spark_sim.shelf.keep import parse
from tests.helpers.stick import standing, stick_rig

TRUTHS = {
    "implausible < 5%": "i < .05",
    "implausible < 5% and root_wrench < 2%": "i < .05 and w < .02",
    "implausible<5% or root_wrench>=2% and skating <= 1 %": "i < .05 or w >= .02 and s <= .01",
    "(implausible < 5% or root_wrench >= 2%) and skating <= 1%": (
        "(i < .05 or w >= .02) and s <= .01"
    ),
    "not implausible < 5% and not (root_wrench > 2% or skating > 1%)": (
        "not i < .05 and not (w > .02 or s > .01)"
    ),
    "NOT NOT implausible > 5.0%": "i > .05",
    "joint_speed < 15 and joint_speed < 15 rad/s or root_drift <= 0.3m": "v < 15 or d <= .3",
    "root-drift <= 30cm": "d <= .3",
    "pose < 0.1 rad or pose > 6°": "p < .1 or p > math.radians(6)",
    "not pose < 6 deg": "not p < math.radians(6)",
}


@pytest.mark.parametrize("text", TRUTHS)
def test_a_condition_means_what_python_means_by_it(text: str) -> None:
    keep = parse(text)
    for i, w, s, v, d, p in itertools.product(
        (0.01, 0.05, 0.5), (0.0, 0.02, 0.3), (0.0, 0.02), (3, 15), (0.2, 0.3), (0.09, 0.102, 0.3)
    ):
        values = {
            "implausible": i,
            "root_wrench": w,
            "skating": s,
            "joint_speed": v,
            "root_drift": d,
            "pose": p,
        }
        measures = {key(name): value for name, value in values.items()}
        known = {"i": i, "w": w, "s": s, "v": v, "d": d, "p": p, "math": math}
        assert keep(measures) is eval(TRUTHS[text], known)


def test_tremble_is_given_in_millimetres() -> None:
    """1000 of them are a metre, in which measures are kept."""
    for text in ("tremble <= 3mm", "tremble <= 0.3 cm", "tremble <= 0.003 m"):
        assert [parse(text)({key("tremble"): value}) for value in (0.0029, 0.0031)] == [True, False]


def test_what_is_not_measured_is_no_reason_to_leave_out() -> None:
    measures = {key(name): None for name in MEASURES} | {key("implausible"): 0.5}
    assert parse("balance < 5%")(measures)
    assert parse("not balance < 5%")(measures)
    assert parse("balance < 5% or implausible < 1%")(measures)
    assert not parse("balance < 5% and implausible < 1%")(measures)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "at the end: expected a measure"),
        ("implausable < 5%", "did you mean implausible?"),
        ("implausible < 5", "such as 5%"),
        ("root_drift < 30", "such as 30cm"),
        ("implausible 5%", "expected one of < <= > >="),
        ("implausible == 5%", "not understood"),
        ("implausible < 5% and", "at the end"),
        ("implausible < 5% skating < 1%", "expected `and`, `or`"),
        ("(implausible < 5%", "expected `)`"),
        ("(" * 2000 + "implausible < 5%" + ")" * 2000, "nested deeper"),
        ("not " * 2000 + "implausible < 5%", "nested deeper"),
        ("__import__('os').system('true')", "no measure is called"),
        ("implausible < open('x')", "is compared with a number"),
    ],
)
def test_what_is_no_condition_is_refused_with_its_place(text: str, says: str) -> None:
    with pytest.raises(ConventionError) as error:
        parse(text)
    assert says in str(error.value)


WORDS = st.sampled_from(
    ["and", "or", "not", "(", ")", "<", ">=", "5%", "3", "implausible", "x", "%"]
)


@given(st.one_of(st.text(), st.lists(WORDS).map(" ".join)))
def test_any_text_is_a_condition_or_refused(text: str) -> None:
    try:
        keep = parse(text)
    except ConventionError:
        return
    assert keep({}) in (True, False)


def test_the_headline_is_the_report_in_si_units() -> None:
    """Every measure of the report that needs no ground truth, under its key, in its unit."""
    rig = stick_rig()
    subject = Subject(standing(rig, 30), rig)
    report = assess(subject, source=subject)
    rows = {row["measure"]: row for row in report.rows()}
    assert tuple(name for name in rows if not name.startswith("ground_truth")) == MEASURES
    assert all(parse(f"{name} < 1{unit}") for name, unit in UNITS.items() if name in MEASURES)
    record, short = report.json(), headline(report)
    assert short["implausible_share"] == pytest.approx(record["implausible_share"])
    assert short["skating_share"] == pytest.approx(record["clip"]["flags"]["skating"]["share"])
    assert short["root_drift_m"] == pytest.approx(record["root_drift"]["largest_m"])
    assert short["joint_speed_rad_s"] == pytest.approx(record["clip"]["largest_joint_speed_rad_s"])

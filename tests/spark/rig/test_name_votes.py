"""Where no rule reads a name, the name encoder has a vote."""

from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import load_file

from scripts.count_roles import letter_missing, misspelt
from spark.inference.names import NameNetwork
from spark.inference.weights import KINDS, SHIPPED, read_weights
from spark.rig import name_votes, role_assignment
from spark.rig.name_conventions import HELD_OUT, name_joints
from spark.rig.name_hints import read_names
from spark.rig.name_votes import with_votes
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role
from tests.helpers.rigs import RIGS, build


def wrong_rigs() -> int:
    return sum(right != found for _, _, right, found in misspelt(letter_missing, 1))


def test_votes_find_misspelt_roles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each rig of the ecosystem and its caricature, with a letter missing in each word."""
    with_them = wrong_rigs()
    monkeypatch.setattr(role_assignment, "with_votes", lambda _, hints: hints)
    assert with_them < 0.75 * wrong_rigs()


def test_the_kinds_that_ship_are_near_their_names() -> None:
    """In the conventions that the encoder has not learned."""
    kinds = load_file(KINDS)
    encoder = NameNetwork(read_weights(SHIPPED))
    for convention in HELD_OUT:
        vectors = encoder.encode(name_joints(Role, convention))
        nearest = np.argmax(vectors @ np.stack(list(kinds.values())).T, axis=-1)
        found = [list(kinds)[k] for k in nearest]
        assert sum(role.part == kind for role, kind in zip(Role, found, strict=True)) >= 20


def test_a_reason_says_that_the_encoder_read_a_name() -> None:
    skeleton, right = build(RIGS["mixamo"])
    odd = {"LeftHand": "LeftHnad", "LeftFoot": "LeftFwoot", "LeftShoulder": "LeftShldier"}
    names = [name.replace("mixamorig:", "") for name in skeleton.names]
    spelt = replace(skeleton, names=tuple(odd.get(name, name) for name in names))
    found = assign_roles(spelt)
    assert found.roles == right
    reason = found.reasons[spelt.names.index("LeftShldier")]
    assert reason == "name 'LeftShldier' as the name encoder reads it"


def test_a_rig_of_unknown_words_is_left_to_its_bones(monkeypatch: pytest.MonkeyPatch) -> None:
    """And one whose names are all read never asks the encoder."""
    monkeypatch.setattr(name_votes, "_encoder", lambda: pytest.fail("asked"))
    skeleton, _ = build(RIGS["mixamo"])
    strange = replace(skeleton, names=tuple(f"zorb{j}qua" for j in range(len(skeleton))))
    many = replace(skeleton, names=tuple(f"joint{j}" for j in range(len(skeleton))))
    for rig in (skeleton, strange, many):
        hints = read_names(rig.names)
        assert with_votes(rig, hints) is hints


def test_below_a_hand_is_no_second_one() -> None:
    skeleton, _ = build(RIGS["mixamo"])
    names = [name.replace("mixamorig:", "") for name in skeleton.names]
    at = names.index("LeftHandThumb1")
    for above, parts in (("LeftHnd", set()), ("LeftForeArm", {"hand"})):
        names[at], names[skeleton.parents[at]] = "LeftHnadBase", above
        rig = replace(skeleton, names=tuple(names))
        assert set(with_votes(rig, read_names(rig.names))[at].parts) == parts


def test_both_sides_have_one_vote(monkeypatch: pytest.MonkeyPatch) -> None:
    """An encoder that takes the one for a hand, the other for a foot: together for neither."""

    class Odd:
        def encode(self, names: tuple[str, ...]) -> np.ndarray:
            return np.array([[n.startswith("Right"), n.startswith("Left")] for n in names], float)

    kinds = {"hand": np.array([1.0, 0.0]), "foot": np.array([0.0, 1.0])}
    monkeypatch.setattr(name_votes, "_encoder", lambda: (Odd(), kinds))
    skeleton, _ = build(RIGS["mixamo"])
    names = [name.replace("mixamorig:", "") for name in skeleton.names]
    pair = [names.index(f"{side}HandThumb1") for side in ("Left", "Right")]
    for alone in (True, False):
        for joint, side, word in zip(pair, ("Left", "Right"), ("Zorb", "Qua"), strict=True):
            names[joint] = f"{side}{word if alone else 'Zorb'}"
        rig = replace(skeleton, names=tuple(names))
        left, right = (with_votes(rig, read_names(rig.names))[joint].parts for joint in pair)
        assert left.keys() == ({"foot"} if alone else right.keys())
        assert alone or left == right

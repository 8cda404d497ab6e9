"""How well the name encoder finds roles on rigs whose conventions it has not learned, fold by fold.

Usage: python -m scripts.name_folds [STEPS] [FOLDS] [SHARE]

The rigs are those of tests/helpers/rigs.py. Each fold holds out some of them, and with them every
learned convention that names SHARE or more of the joints of one of them by the same word.
"""

import sys
from collections.abc import Sequence

import numpy as np
import torch

from spark.inference.name_words import rig_words
from spark.inference.weights import OTHER
from spark.motion import Motion
from spark.network.features import body_features
from spark.rig.name_conventions import CONVENTIONS
from spark.rig.rig import understand
from spark.rig.roles import Role
from spark.training.name_rigs import Named, rig_of
from spark.training.train_names import score_rigs, train_names
from tests.helpers.rigs import RIGS, build


def named_rig(chains: str) -> list[Named]:
    """The joints that the network sees of a rig, with the sides and kinds of the hand's table."""
    skeleton, right = build(chains)
    still = np.tile([1.0, 0, 0, 0], (1, len(skeleton), 1))
    body = body_features(understand(Motion(skeleton, 1 / 30, skeleton.offsets[:1], still)))
    roles = [right[j] for j in body.joints.tolist()]
    return [
        (name, *((role.side, role.part) if role else ("", OTHER)))
        for name, role in zip(body.skeleton.names, roles, strict=True)
    ]


def words_of(rig: Sequence[Named]) -> dict[str, set[str]]:
    """What a rig calls each kind of joint, without sides and numbers."""
    found: dict[str, set[str]] = {}
    sides: dict[tuple[str, str], str] = {}
    for (_, side, kind), words in zip(rig, rig_words([name for name, _, _ in rig]), strict=True):
        if kind != OTHER and side:
            sides[kind, side] = words
        elif kind != OTHER:
            found.setdefault(kind, set()).add(_plain(words.split()))
    for kind, _ in sides:
        pairs = zip(sides[kind, "left"].split(), sides[kind, "right"].split(), strict=True)
        found[kind] = {_plain([a if a == b else a[1:] * (a[1:] == b[1:]) for a, b in pairs])}
    return found


def _plain(words: Sequence[str]) -> str:
    return "".join(word for word in words if not word.isdigit())


def shared(rig: Sequence[Named], convention: str) -> float:
    """The share of a rig's kinds of joints that `convention` calls by the same word."""
    own, other = words_of(rig), words_of(rig_of(convention, list(Role)))
    return float(np.mean([bool(own[kind] & other[kind]) for kind in own]))


def main(steps: int = 300, folds: int = 4, share: float = 0.9) -> None:
    torch.set_num_threads(1)
    rigs = {name: named_rig(chains) for name, chains in RIGS.items()}
    order = sorted(rigs, key=lambda name: max(CONVENTIONS, key=lambda c: shared(rigs[name], c)))
    total = right = confused = 0
    for fold in np.array_split(np.array(order), folds):
        learned = [c for c in CONVENTIONS if all(shared(rigs[n], c) < share for n in fold.tolist())]
        encoder = train_names(steps, conventions=learned)
        print(f"\nnot learned: {', '.join(c for c in CONVENTIONS if c not in learned)}")
        for name in fold.tolist():
            score = score_rigs(encoder, [rigs[name]], learned)
            wrong = ", ".join(f"{f.name}: {f.role}, not {f.found}" for f in score.failures)
            print(f"| {name} | {score.right} of {score.total} | {wrong} |", flush=True)
            total, right = total + score.total, right + score.right
            confused += score.sides_confused
    print(f"\n{right} of {total} = {right / total:.1%}; {confused} sides confused")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:3]), *(float(a) for a in sys.argv[3:4]))

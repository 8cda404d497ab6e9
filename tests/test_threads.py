"""What multiplies small matrices takes one thread, and leaves the caller's as they were."""

from collections.abc import Callable
from typing import Any

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from robots.model.known import known
from robots.solver import solve
from robots.stream.frame_targets import Frame, ground_of
from robots.stream.stream import Stream
from spark.demo.sample import sample_motion, sample_rig
from spark.inference.names import NameNetwork
from spark.inference.weights import SHIPPED, read_weights
from spark.transfer.canonical import to_canonical


def threads() -> set[int]:
    """Of the libraries of linear algebra that are loaded."""
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def encode_names() -> None:
    NameNetwork(read_weights(SHIPPED)).encode(["Hips", "Spine", "LeftArm"])


def solve_clip() -> None:
    rig = sample_rig("walker")
    clip = to_canonical(sample_motion("walk", rig, 30.0).frames(0, 4), rig)
    solve.retarget(clip, known("robot"))


def step_stream() -> None:
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 30.0).frames(0, 1)
    robot = known("robot")
    ground = ground_of(to_canonical(motion, rig), robot)
    Stream(rig, robot, motion.frame_time, ground).step(
        Frame(motion.root_pos[0], motion.rotations[0])
    )


@pytest.mark.parametrize(
    ("work", "owner", "inner"),
    [
        (encode_names, NameNetwork, "_name"),
        (solve_clip, solve, "solve_block"),
        (step_stream, Stream, "_first"),
    ],
)
def test_small_matrices_take_one_thread(
    work: Callable[[], None], owner: object, inner: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain, within = getattr(owner, inner), set()

    def watched(*args: Any, **options: Any) -> Any:
        within.update(threads())
        return plain(*args, **options)

    monkeypatch.setattr(owner, inner, watched)
    with threadpool_limits(2, user_api="blas"):
        before = threads()
        work()
        assert threads() == before
    assert before != {1}
    assert within == {1}

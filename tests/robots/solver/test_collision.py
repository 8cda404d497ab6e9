"""Which parts of a robot can collide."""

from pathlib import Path

from robots.solver.collision import collisions_of
from tests.helpers.ember import changed_ember


def test_parts_in_each_other_around_one_joint_are_neighbours(tmp_path: Path) -> None:
    """A ball around the ankle is in the shin, whatever its two hinges do, one at the toes is not;
    in a file that excludes nothing."""

    def foot_and_shin(ball: str) -> int:
        folder = tmp_path / str(len(ball))
        folder.mkdir()
        foot = '<geom class="foot" mass="0.6"'
        pattern = f"({foot})|<exclude [^>]*/>"
        robot = changed_ember(folder, pattern, lambda found: ball + foot if found[1] else "")
        model = robot.mjcf.model
        ends = [
            {model.body(shape.body).name for shape in (pair.small, pair.large)}
            for pair in collisions_of(robot).pairs
        ]
        return ends.count({"left_foot", "left_shin"})

    plain = foot_and_shin("")
    assert plain > 0
    ball = '<geom class="collision" mass="0.1" type="sphere" size="0.06" {}/>'
    assert foot_and_shin(ball.format("")) == plain
    assert foot_and_shin(ball.format('pos="0.2 0 0"')) == plain + 1

"""The report's thresholds, in one table. Any change of a value is a new version."""

from dataclasses import dataclass, replace

HUMAN_HIP_HEIGHT = 0.9  # [m] of an adult: the size that the thresholds are given for


@dataclass(frozen=True)
class Thresholds:
    """What counts as implausible, for a body whose hips stand 0.9 m high.

    Those of skating were chosen on clean recordings of people, which must show little of it; the
    others were set beforehand. `scripts/report_bench.py` measures on spoilt recordings what they
    tell apart: docs/report.md has its table.
    """

    version: str = "plausibility v5"

    # Penetration: the lowest point lies deeper than this under the floor [m].
    penetration: float = 0.01

    # Floating: the lowest point is higher than this [m], and the centre of mass is not in free
    # fall: its vertical acceleration differs from gravity's by more than this [m/s²] all over the
    # window.
    floating: float = 0.04
    free_fall: float = 4.0

    # Skating: a sole's corner lower than this [m] moves along the floor faster than this [m/s], and
    # its foot lies flat (all corners within `contact_height`), or the points at rest leave more
    # than this of the body's weight to it [body weights, body weights x 1 m]. Without the last
    # condition a toe that swings by low counts: a quarter of the frames of a clean walk.
    skate_height: float = 0.025
    skate_speed: float = 0.2
    skate_load: float = 0.1

    # A point lower than this [m] may touch the floor. It is as high as `floating`: what does not
    # float may be held up.
    contact_height: float = 0.04

    # Root wrench: the force [body weights] or torque [body weights x 1 m] that the floor can't give
    # with friction cones of this coefficient: a generous one, so that what counts no floor gives.
    wrench_force: float = 0.15
    wrench_torque: float = 0.15
    friction: float = 1.0

    # Self-penetration: a part of the body is deeper in another, no neighbour, than this [m] beyond
    # what it is in the source. Flesh gives; the shapes of a model are hard.
    self_penetration: float = 0.02
    shape_penetration: float = 0.01

    # Foot contacts: a corner of the sole is lower than this [m] over the floor and slower than
    # `skate_speed`. Higher than `contact_height`: recorded feet that stand hover by some
    # centimetres, and what is asked is whether the foot stands at the same time.
    stand_height: float = 0.06

    # Swing clearance, measured where the middle of a sole of the source is faster than this [m/s]
    # and all of it higher than this [m], over at least this time [s].
    swing_speed: float = 0.5
    swing_height: float = 0.02
    swing_time: float = 0.5

    # Limb acceleration: the end of a limb is thrown where it is accelerated more than this many
    # times as hard as the source's, which counts as this [m/s²] at least. People who stand and talk
    # move their elbows by 3 m/s² (the median of eight recordings).
    limb_throw: float = 2.0
    limb_least: float = 3.0

    # Torque: a joint needs more than this share of what its motor gives.
    torque: float = 1.0

    # At its limit: a joint is within this [rad] of its limit, or within this share of its range, or
    # beyond: 2 degrees. Solvers keep clear of limits by half a degree or so.
    limit_margin: float = 0.0349
    limit_margin_share: float = 0.05

    # Balance, where the centre of mass is slower than this [m/s] and accelerates less than this
    # [m/s²] for this time [s] before and after: it lies further outside the points near the floor
    # than this [m].
    static_speed: float = 0.1
    static_acceleration: float = 0.5
    static_time: float = 0.2
    balance: float = 0.03

    # Time [s] before and after a frame over which velocities and accelerations are taken, whatever
    # the frame rate: 3 frames at 60 fps.
    window: float = 0.05

    def __repr__(self) -> str:
        return f"Thresholds({self.version!r}, penetration {self.penetration:.3g} m, ...)"

    def scaled(self, hip_height: float) -> "Thresholds":
        """The same table for a body of another size: lengths and speeds grow with the hip height.

        Accelerations of the whole body and times do not: gravity is the same for a doll.
        """
        scale = hip_height / HUMAN_HIP_HEIGHT
        return replace(
            self,
            penetration=self.penetration * scale,
            floating=self.floating * scale,
            skate_height=self.skate_height * scale,
            skate_speed=self.skate_speed * scale,
            wrench_torque=self.wrench_torque * scale,
            contact_height=self.contact_height * scale,
            stand_height=self.stand_height * scale,
            swing_speed=self.swing_speed * scale,
            swing_height=self.swing_height * scale,
            limb_least=self.limb_least * scale,
            self_penetration=self.self_penetration * scale,
            shape_penetration=self.shape_penetration * scale,
            static_speed=self.static_speed * scale,
            balance=self.balance * scale,
        )

    def of_adult(self, length: float) -> float:
        """A length of an adult [m], on the body that the table was `scaled` for [m]."""
        return length * self.floating / PLAUSIBILITY.floating


PLAUSIBILITY = Thresholds()

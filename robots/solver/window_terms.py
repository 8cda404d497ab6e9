"""The objective of a few frames, in a few tenths of a millisecond.

The terms are those of `robots.solver.objective`, with the same weights, and so is the order: arms
and head hang on base, trunk and legs, and don't move them. There every term walks its own chain,
over thousands of frames; here MuJoCo gives the bodies' poses and the dofs' twists, and the Jacobian
of all terms is one product of their wrenches with these. Its columns are MuJoCo's dofs, in the
order of `robots.tree`: the base rotates about its own axes, and so do balls.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.floor import Solid, carried_solids, solids_over_floor
from robots.solver.hinges import Hinges, Posture
from robots.solver.near_spheres import NearSpheres
from robots.solver.weights import per_metre
from robots.solver.window_collision import WindowCollisions
from robots.solver.window_dofs import WindowDofs
from robots.solver.window_floor import Lifted, Low, WindowFloor
from robots.solver.window_points import WindowPoints
from robots.solver.window_poses import Kinematics, WindowPoses
from robots.solver.window_rotations import WindowRotations
from robots.solver.window_rows import stacked
from robots.solver.window_targets import Asked, PointTargets, PoseTargets
from spark.rig.roles import Role


class Terms:
    """The residuals of a robot's poses, as normal equations. `bones` are the limbs' segments whose
    directions the source gives, `hands` says whether it gives the offset between both, and `parts`
    are points, in the rest pose [m], of links that may be held. With `only` some joints of
    the later block, all others are given: nothing that they alone move is looked at. With
    `firm_hands`, hands are followed as by the last steps of whole clips. `mj_dofs` are MuJoCo's
    numbers of the dofs."""

    def __init__(
        self,
        robot: Morphology,
        bones: Sequence[Role],
        hands: bool,
        parts: Sequence[tuple[int, Float[np.ndarray, "3"]]] = (),
        *,
        only: Sequence[int] | None = None,
        firm_hands: bool = False,
    ) -> None:
        self.robot = robot
        self._dofs = WindowDofs(robot, only=only)
        self.mj_dofs = self._dofs.mj
        self._kinematics = Kinematics(robot.mjcf, self.mj_dofs)
        rest = self._kinematics.rest
        self.hinges = Hinges(robot, self._dofs.numbers)
        self._points = WindowPoints(robot, self._dofs, rest, bones, hands, parts)
        self._rotations = WindowRotations(robot, self._dofs, firm_hands=firm_hands)
        self._collisions = WindowCollisions(robot, self._dofs, rest)
        self._floor = self._whole_floor()

    @property
    def sole_count(self) -> int:
        """How many points the soles have."""
        soles = self._points.soles
        return soles.stop - soles.start

    def poses(self, q: Float[np.ndarray, "T nq"], *, with_mass: bool = False) -> WindowPoses:
        """The poses of all bodies; how the mass is moved is asked for by `with_mass`."""
        return self._kinematics.poses(q, with_mass=with_mass)

    def com(self, q: Float[np.ndarray, "nq"]) -> Float[np.ndarray, "3"]:
        """The place of the centre of mass [m]."""
        return self._kinematics.com(q)

    def sole_points(self, poses: WindowPoses) -> Float[np.ndarray, "T P 3"]:
        """The points of the soles [m, world]."""
        return self._points.places(poses, self._points.soles)

    def part_points(self, poses: WindowPoses) -> Float[np.ndarray, "T K 3"]:
        """The points of the parts that may be held [m, world]."""
        return self._points.places(poses, self._points.parts)

    def bones(self, poses: WindowPoses) -> Float[np.ndarray, "T B 3"]:
        """The unit directions of the bones [world]."""
        return self._points.bones_and_soles(poses)[0]

    def bones_and_soles(
        self, poses: WindowPoses
    ) -> tuple[Float[np.ndarray, "T B 3"], Float[np.ndarray, "T P 3"]]:
        """Both in a little more than the time of one."""
        return self._points.bones_and_soles(poses)

    def under(self, solids: Sequence[Solid]) -> WindowFloor:
        """The floor under some shapes."""
        links = [solid.link for solid in solids]
        lifted = Lifted(tuple(solids), self._dofs.bodies(links), self._dofs.moving(links))
        return WindowFloor(lifted, self._kinematics.rest, per_metre(self.robot))

    def low(self, poses: WindowPoses, ground: Float[np.ndarray, "T P"] | None = None) -> Low:
        """What is near the floor, or above the `ground` [m] under the points of the soles."""
        return self._floor.low(poses, ground)

    def candidates(self, poses: WindowPoses) -> NearSpheres:
        """The collision candidates, in these poses and others that are not far away."""
        return self._collisions.candidates(poses)

    def asked(
        self, targets: PoseTargets, feet: PointTargets, resting: PointTargets | None = None
    ) -> Asked:
        """What these targets ask for; `resting` says where parts are held."""
        turns = self._rotations.asked(targets.world, targets.chest)
        return Asked(turns, *self._points.asked(targets, feet, resting))

    def linearize(
        self,
        q: Float[np.ndarray, "T nq"],
        poses: WindowPoses,
        asked: Asked,
        posture: Posture,
        candidates: NearSpheres,
        floor_scale: Float[np.ndarray, "T"] | None = None,
        low: Low | None = None,
    ) -> tuple[Float[np.ndarray, "T D D"], Float[np.ndarray, "T D"]]:
        """H and g of the normal equations `H step = -g`, each frame for itself. `poses` are those
        of `q`, `candidates` those of poses near these; `floor_scale` multiplies the weight of
        the floor, and `low` is what is near it, where that is known."""
        scale = np.ones(len(q)) if floor_scale is None else floor_scale
        rows = [
            self._points.rows(poses, asked),
            self._floor.rows(poses, low or self._floor.low(poses), scale),
            self._collisions.rows(poses, candidates),
        ]
        J, residuals = stacked([part for part in rows if part is not None], poses.twists)
        self._points.join_hands(J, residuals)
        H, g = self._rotations.normal_equations(poses, asked.turns)
        # A copy: numpy takes twice as long over what it sees is a matrix times itself.
        across = J.transpose(0, 2, 1).copy()
        H += across @ J
        g += (across @ residuals[..., None])[..., 0]
        self.hinges.add_to(q, posture, H, g)
        return H, g

    def _whole_floor(self) -> WindowFloor:
        """Under the soles' points, which are felt however high they are, under all solid shapes,
        and once more under what of arms and head the trunk lifts."""
        robot, dofs = self.robot, self._dofs
        solids, carried = solids_over_floor(robot), carried_solids(robot)
        soles = [robot.sole_points(sole) for sole in robot.soles]
        points = tuple(
            Solid(int(link), place[None], np.zeros(1))
            for links, places in soles
            for link, place in zip(links, places, strict=True)
        )
        if dofs.later_only:
            own = np.flatnonzero(dofs.moving([solid.link for solid in solids]).any(axis=1))
            solids = tuple(solids[k] for k in own.tolist())
            carried = points = ()
        links = [solid.link for solid in (*points, *solids, *carried)]
        first = dofs.in_first_block(links)
        first[len(links) - len(carried) :] = True
        lifted = Lifted((*points, *solids, *carried), dofs.bodies(links), dofs.moving(links, first))
        rest = self._kinematics.rest
        return WindowFloor(lifted, rest, per_metre(robot), always=len(points))

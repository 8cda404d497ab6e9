"""Residuals of a block's links, summed up from the ends of its chains to the base.

A dof's twist times a residual's wrench is the residual's derivative by it. So all residuals of a
link, however many, are in each frame a matrix (the wrenches' squares) and a vector (their products
with the residuals), and a joint feels the sums of all links beyond it: as in the composite rigid
body algorithm (Featherstone, "Rigid Body Dynamics Algorithms", ch. 6). No Jacobian is written down.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import LinkPoses, cross
from robots.least_squares import NormalEquations, runs
from robots.solver.block import Block
from robots.tree import ROOT


@dataclass(eq=False)
class Load:
    """What links ask of the joints that carry it, about the base's place: moments alone (R = 3) or
    whole wrenches (R = 6: moments, then forces). The `joints` carry nothing else."""

    squares: Float[np.ndarray, "R R T"]
    sums: Float[np.ndarray, "R T"]
    joints: list[int] = field(default_factory=list)

    def add(self, other: "Load") -> None:
        """What other links ask, too."""
        if len(self.sums) < len(other.sums):
            squares, sums = self.squares, self.sums
            self.squares, self.sums = other.squares.copy(), other.sums.copy()
        else:
            squares, sums = other.squares, other.sums
        rows = len(sums)
        self.squares[:rows, :rows] += squares
        self.sums[:rows] += sums


class LinkTerms:
    """Residuals of the links that a block's chains lead to. Where the normal equations have no
    Jacobian, they are given the cost alone."""

    def __init__(self, poses: LinkPoses, block: Block, normal: NormalEquations) -> None:
        self.poses, self.block, self.normal = poses, block, normal
        self.about = poses.positions[ROOT]
        self._loads: dict[int, Load] = {}
        self._joints = frozenset(block.joints)

    def add_rotation(
        self,
        link: int,
        wanted: Float[np.ndarray, "3 3 T"],
        weight: float | Float[np.ndarray, "T"],
    ) -> None:
        """A link's rotation R should be R*: as `robots.residuals.rotation_residual`."""
        squared = np.square(weight)
        turn = np.einsum("ikt,jkt->ijt", self.poses.rotations[link], wanted)
        self.normal.cost += squared * ((3.0 - turn[0, 0] - turn[1, 1] - turn[2, 2]) / 2)
        if self.normal.with_jacobian:
            load = self._load(link, 3)
            half = squared / 2
            for k, (i, j) in enumerate(((2, 1), (0, 2), (1, 0))):
                load.squares[k, k] += squared
                load.sums[k] += half * (turn[i, j] - turn[j, i])

    def add_direction(
        self,
        link: int,
        direction: Float[np.ndarray, "3 T"],
        wanted: Float[np.ndarray, "3 T"],
        weight: float,
    ) -> None:
        """A link's unit vector d should be d*: as `robots.residuals.direction_residual`."""
        self.normal.cost += 0.5 * weight**2 * np.square(direction - wanted).sum(axis=0)
        if self.normal.with_jacobian:
            load = self._load(link, 3)
            for k in range(3):
                load.squares[k, k] += weight**2
            scaled, crossed = weight * direction, np.empty_like(direction)
            load.squares[:3, :3] -= scaled[:, None] * scaled
            cross(weight * wanted, scaled, crossed)
            load.sums[:3] += crossed

    def add_point(
        self,
        link: int,
        point: Float[np.ndarray, "3 T"],
        target: Float[np.ndarray, "3 T"],
        weight: Float[np.ndarray, "3 T"],
    ) -> None:
        """A link's point p [m] should be at p*: r = w (p - p*), the weight [1/m] by axis."""
        residual = (point - target) * weight
        self.normal.cost += 0.5 * np.square(residual).sum(axis=0)
        if self.normal.with_jacobian:
            wrenches = np.zeros((6, 3, point.shape[1]))
            wrenches[[3, 4, 5], [0, 1, 2]] = weight
            for k in range(3):
                cross(point - self.about, wrenches[3:, k], wrenches[:3, k])
            self._add(link, wrenches, residual)

    def add_heights(
        self,
        link: int,
        places: Float[np.ndarray, "2 M S"],
        residuals: Float[np.ndarray, "M S"],
        slopes: Float[np.ndarray, "M S"],
        frames: slice | Int[np.ndarray, "S"] = slice(None),
    ) -> None:
        """Residuals of how high some of a link's points are, in some frames: over which places of
        the floor [m], and their derivatives by the heights [1/m]."""
        self.normal.cost[frames] += 0.5 * np.square(residuals).sum(axis=0)
        if self.normal.with_jacobian:
            x, y = places - self.about[:2, frames][:, None]
            wrenches = np.stack([y * slopes, -x * slopes, slopes])
            load, rows = self._load(link, 6), (0, 1, 5)
            for i, wrench in zip(rows, wrenches, strict=True):
                load.sums[i, frames] += np.einsum("mt,mt->t", wrench, residuals)
                products = np.einsum("mt,jmt->jt", wrench, wrenches)
                for j, product in zip(rows, products, strict=True):
                    load.squares[i, j, frames] += product

    def add_distances(
        self,
        link: int,
        points: Float[np.ndarray, "3 M S"],
        out: Float[np.ndarray, "3 M S"],
        residuals: Float[np.ndarray, "M S"],
        slopes: Float[np.ndarray, "M S"],
        frames: Int[np.ndarray, "S"],
    ) -> None:
        """Residuals of how far some of a link's points [m] are from something, in some frames: the
        unit vectors away from that, and their derivatives by the distances [1/m]."""
        self.normal.cost[frames] += 0.5 * np.square(residuals).sum(axis=0)
        if self.normal.with_jacobian:
            arms, wrenches = points - self.about[:, None, frames], np.zeros((6, *slopes.shape))
            np.multiply(out, slopes, out=wrenches[3:])
            cross(arms, wrenches[3:], wrenches[:3])
            load = self._load(link, 6)
            load.squares[:, :, frames] += np.einsum("imt,jmt->ijt", wrenches, wrenches)
            load.sums[:, frames] += np.einsum("imt,mt->it", wrenches, residuals)

    def add_to_normal(self) -> None:
        """What all links ask of the block's dofs, from the last link to the base."""
        loads, parents = self._loads, self.poses.tree.parents.tolist()
        rows = max((len(load.sums) for load in loads.values()), default=3)
        sums = ProductSums(self.poses, self.block, rows)
        for link in reversed(range(len(parents))):
            if (load := loads.pop(link, None)) is None:
                continue
            if link in self._joints:
                load.joints.insert(0, link)
            above = loads.setdefault(parents[link], load)
            if above is not load:
                sums.add_joints(load)
                sums.add_joints(above)
                above.joints.clear()
                above.add(load)
        if ROOT in loads:
            sums.add_joints(loads[ROOT])
            sums.add_base(loads[ROOT])
        self.normal.add_products(sums.products, sums.gradient)

    def _load(self, link: int, rows: int) -> Load:
        """That of a link's own residuals, of so many rows or more."""
        load = self._loads.get(link)
        if load is None or len(load.sums) < rows:
            frames = self.about.shape[1]
            more = Load(np.zeros((rows, rows, frames)), np.zeros((rows, frames)))
            if load is not None:
                more.add(load)
            self._loads[link] = load = more
        return load

    def _add(
        self, link: int, wrenches: Float[np.ndarray, "6 M T"], residuals: Float[np.ndarray, "M T"]
    ) -> None:
        load = self._load(link, 6)
        load.squares += np.einsum("imt,jmt->ijt", wrenches, wrenches)
        load.sums += np.einsum("imt,mt->it", wrenches, residuals)


class ProductSums:
    """The normal equations of loads, time last: the dofs' twists times what they feel.

    Twists are about the base's place: turns, and with R = 6 rows then shifts.
    """

    def __init__(self, poses: LinkPoses, block: Block, rows: int) -> None:
        frames = poses.positions.shape[2]
        self.block = block
        self.products = np.zeros((len(block.dofs), len(block.dofs), frames))
        self.gradient = np.zeros((len(block.dofs), frames))
        self.twists = np.empty((len(block.dofs), rows, frames))  # the base's are not looked at
        for j in block.joints:
            for k, dof in enumerate(block.local_joint_dofs((j,))):
                twist = self.twists[dof]
                twist[:3] = poses.axis(j, k)
                if rows > 3:
                    cross(twist[:3], poses.positions[ROOT] - poses.positions[j], twist[3:])

    def add_joints(self, load: Load) -> None:
        """What a load asks of its joints, and of these together with what carries them."""
        if not load.joints:
            return
        rows, carrying = len(load.sums), self.block.free_joints(load.joints[-1])
        chain = self.block.local_joint_dofs(carrying)
        for dof in self.block.local_joint_dofs(tuple(load.joints)):
            felt = np.einsum("rst,st->rt", load.squares, self.twists[dof, :rows])
            np.einsum("rt,rt->t", self.twists[dof, :rows], load.sums, out=self.gradient[dof])
            for _, there in runs(chain[: chain.index(dof) + 1]):
                twists, products = self.twists[there, :rows], self.products[there, dof]
                np.einsum("mrt,rt->mt", twists, felt, out=products)
            if self.block.base:
                self.products[3:6, dof] = felt[:3]
                self.products[: rows - 3, dof] = felt[3:]

    def add_base(self, load: Load) -> None:
        """What a load asks of the base's dofs."""
        if not self.block.base:
            return
        turns, shifts = slice(3, 6), slice(0, len(load.sums) - 3)
        self.gradient[turns], self.gradient[shifts] = load.sums[:3], load.sums[3:]
        self.products[turns, turns] = load.squares[:3, :3]
        self.products[shifts, turns] = load.squares[3:, :3]
        self.products[shifts, shifts] = load.squares[3:, 3:]

"""How near the linkages of a robot are to configurations at which something is lost: dead points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wbc.robot.loops import Linkage, rank
from wbc.robot.shortest_steps import DEPENDENT
from wbc.validation import Array

#: Step of the slopes of singular values [rad, or characteristic lengths]
SLOPE = 1e-4
#: Singular values of a linkage that no motion changes by more than this are not on the way to 0
LEVEL = 1e-9


@dataclass(frozen=True)
class DeadPoint:
    """A linkage near a configuration at which its motors do not say how all of it moves, or its loops leave two ways.

    Attributes:
        linkage: names of its loops.
        joint: the degree of freedom that moves most in what is not said there.
        distance: of motions that the loops allow, the shortest that leads there where the singular value that is lost
            falls as it does here [rad, or characteristic lengths].
        branches: the loops leave two ways there, and the linkage may change its assembly; False: the motors say less.
    """

    linkage: str
    joint: str
    distance: float
    branches: bool

    def __str__(self) -> str:
        lost = f"its loops leave {self.joint} two ways" if self.branches else f"its motors do not move {self.joint}"
        where = f"is {self.distance:.2g} rad from" if self.distance > 0.0 else "is at"
        return f"The linkage of {self.linkage} {where} its dead point, where {lost}"


class DeadPointSearch:
    """Distances to dead points by the least singular value that the rows of a linkage have elsewhere.

    Args:
        rows: q -> Jacobian of the loops, per radian and characteristic length [rows, nv]. moved: (q, v) -> q (+) v.
        linkages: of the robot. passive: degrees of freedom without motors. names: of all degrees of freedom. looks:
            closed configurations like any other.
    """

    def __init__(
        self,
        rows: Callable[[Array], Array],
        moved: Callable[[Array, Array], Array],
        linkages: Sequence[Linkage],
        passive: Sequence[int],
        names: Sequence[str],
        looks: Sequence[Array],
    ) -> None:
        self._rows, self._moved, self._names = rows, moved, names
        seen = [rows(q) for q in looks]
        self._parts: list[tuple[Linkage, list[int], bool, int]] = []
        for linkage in linkages:
            undriven = [dof for dof in linkage.dofs if dof in passive]
            for dofs, branches in ((list(linkage.dofs), True), (undriven, False)):
                if dofs:
                    most = max(rank(jacobian[np.ix_(linkage.rows, dofs)]) for jacobian in seen)
                    self._parts.append((linkage, dofs, branches, most))

    def near(self, q: Array, within: float) -> tuple[DeadPoint, ...]:
        """Those that are no further away, of each linkage the nearest, one at which it branches before others."""
        out: dict[str, DeadPoint] = {}
        for linkage, dofs, branches, most in self._parts:
            if linkage.name in out or most == 0:
                continue
            least, motion = self._least(q, linkage, dofs, most)
            slopes = [
                (self._least(self._moved(q, SLOPE * way), linkage, dofs, most)[0] - least)
                - (self._least(self._moved(q, -SLOPE * way), linkage, dofs, most)[0] - least)
                for way in self._ways(q, linkage)
            ]
            steepest = float(np.linalg.norm(slopes)) / (2.0 * SLOPE)
            distance = 0.0 if least <= DEPENDENT else least / steepest if steepest > LEVEL else np.inf
            if distance <= within:
                joint = self._names[dofs[int(np.abs(motion).argmax())]]
                out[linkage.name] = DeadPoint(linkage.name, joint, float(distance), branches)
        return tuple(out.values())

    def _least(self, q: Array, linkage: Linkage, dofs: list[int], most: int) -> tuple[float, Array]:
        """(the singular value that is lost, the motion of these joints that it is of)."""
        _, sizes, motions = np.linalg.svd(self._rows(q)[np.ix_(linkage.rows, dofs)])
        return float(sizes[most - 1]), motions[most - 1]

    def _ways(self, q: Array, linkage: Linkage) -> Array:
        """Motions of the linkage that its loops allow, orthonormal [motions, nv]."""
        jacobian = self._rows(q)
        _, sizes, motions = np.linalg.svd(jacobian[np.ix_(linkage.rows, linkage.dofs)])
        count = int((sizes > DEPENDENT).sum())
        out = np.zeros((len(motions) - count, jacobian.shape[1]))
        out[:, list(linkage.dofs)] = motions[count:]
        return out

"""What of a pair loses its rank near a configuration: both together, its task, or what it holds."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import Any, TypeAlias

import numpy as np

from wbc import validation
from wbc.coordinates.chains import Braked, braked
from wbc.coordinates.control.conditioning import Conditioning
from wbc.coordinates.pair import CoordinatePair
from wbc.coordinates.rows import Coordinate
from wbc.coordinates.samples import ROUNDING
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array

#: A rank counts as lost where it is lost within this distance in the space of joints [rad, part of the arm's length].
#: Unlike a threshold on a singular value it does not depend on units, on the scale of rows or on how large the arm is.
NEAR = 0.02
#: Of a pair and its task, the one whose locus is this much nearer than the other's is to blame
NEARER = 0.5
#: Singular values above this are no rounding, whatever the size of the matrix, which takes a look at all of it
SMALL = 1e-3
#: Newton steps to a locus at most
STEPS = 15


class Condition(StrEnum):
    """What is wrong with a pair at a configuration: what loses its rank within :data:`NEAR` of it."""

    REGULAR = "regular"
    #: Task and constraint have full rank each, but not together: another pair may do
    ALGORITHMIC = "algorithmic"
    #: The task itself loses rank: no constraint helps
    TASK = "task"
    #: The constraint rows depend on each other
    CONSTRAINT = "constraint"


#: Coordinates, and joints that are locked
_Group: TypeAlias = tuple[tuple[Coordinate, ...], tuple[str, ...]]


def _groups(some: Braked) -> tuple[_Group, _Group, _Group]:
    """Of a pair, of its task alone, of its constraint; the task's for a constraint of brakes."""
    task = some.task, ()
    return (some.task + some.held, some.joints), task, (some.held, some.joints) if some.held else task


class RankLoss:
    """Distances from a configuration to where pairs lose a rank, see :class:`wbc.coordinates.Adviser`.

    Attributes:
        conditioning: singular values of all groups of coordinates. numbers: of each pair, those of the groups of the
            pair, of its task and of its constraint. braked: of each pair. near: see :data:`NEAR`.
    """

    def __init__(
        self,
        robot: Robot,
        pairs: Sequence[CoordinatePair],
        *,
        length: float | None = None,
        near: float = NEAR,
        backend: str = "auto",
    ) -> None:
        self.near = validation.scalar("near", near, low=0.0, unit="rad")
        self._robot = robot
        self._places = {pair.name: k for k, pair in enumerate(pairs)}
        groups: dict[_Group, int] = {}
        self.braked = [braked(robot, pair) for pair in pairs]
        self.numbers = np.array([[groups.setdefault(g, len(groups)) for g in _groups(some)] for some in self.braked])
        self.conditioning = Conditioning(
            robot, [g[0] for g in groups], brakes=[g[1] for g in groups], length=length, backend=backend
        )

    def condition(self, q: Any, name: str) -> Condition:
        """Of one pair.

        Raises:
            UnknownNameError: no such pair. ShapeError, NotFiniteError, RotationError: no configuration.
        """
        place = self._places[validation.one_of("pair", name, self._places)]
        whole, task, constraint = self.numbers[place].tolist()
        pair = self.distance(q, whole)
        if pair >= self.near:
            return Condition.REGULAR
        held = self.distance(q, constraint) if self.braked[place].held else np.inf
        return self.blamed(pair, self.distance(q, task), held)

    def blamed(self, pair: float, task: float, constraint: float) -> Condition:
        """What loses its rank near here, by the distances to the loci of the pair, its task and its constraint."""
        if pair >= self.near:
            return Condition.REGULAR
        # On a locus of the pair the task's own may be near, too, and yet another pair does there
        if task < self.near and NEARER * task <= pair:
            return Condition.TASK
        own = constraint < self.near and NEARER * constraint <= pair
        return Condition.CONSTRAINT if own else Condition.ALGORITHMIC

    def distance(self, q: Array, group: int) -> float:
        """How far it is to a configuration where a group has lost a rank, by Newton's method; inf beyond ``near``."""
        scale = self.conditioning.dof_scale
        here, gone = q, np.zeros(self._robot.nv)
        for _ in range(STEPS):
            sigmas, slopes, _ = self.conditioning.slopes(here, group)
            sigma, slope = float(sigmas[group]), slopes[group]
            if sigma < SMALL and sigma <= ROUNDING * self.conditioning.size(here, group):
                return float(np.linalg.norm(gone))
            # In coordinates in which a sliding joint counts by the arm's length
            along = slope * scale
            steep = float(along @ along)
            if steep == 0.0 or sigma > 2.0 * self.near * np.sqrt(steep):
                return np.inf
            gone = gone - sigma / steep * along
            if np.linalg.norm(gone) > self.near:
                return np.inf
            here = pin.integrate(self._robot.model, q, scale * gone)
        return np.inf

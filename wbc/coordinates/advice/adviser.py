"""Which pair of coordinates is well conditioned here, how far the next locus is, and when to change."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from wbc import validation
from wbc.analysis.rows import JointRows
from wbc.coordinates.advice.determinant_places import ClosedForm, closed_form
from wbc.coordinates.control.conditioning import checked_configuration
from wbc.coordinates.control.rank_loss import NEAR, Condition, RankLoss
from wbc.coordinates.pair import CoordinatePair, pairs_of
from wbc.errors import DuplicateNameError
from wbc.robot import Robot
from wbc.validation import Array

#: A change is recommended where another pair is better by this factor
FACTOR = 1.5


class Basis(StrEnum):
    """Where a distance comes from."""

    #: sigma / |d sigma / dq|: what it would be if sigma fell as it does here
    FIRST_ORDER = "first-order estimate"
    #: one joint at one angle, from the factors of the determinant
    EXACT = "exact"


@dataclass(frozen=True, eq=False)
class Advice:
    """One pair at one configuration.

    Attributes:
        pair: its name. sigma: least singular value of the scaled rows of task and constraint; task, constraint: of
            either alone. condition: see :class:`Condition`.
        distance: to the nearest locus, in the space of joints [rad, part of the arm's length for sliding ones]; basis:
            what it is. direction: direction * distance leads there [nv]. locus: the exact one as text, or empty.
    """

    pair: str
    sigma: float
    task: float
    constraint: float
    condition: Condition
    distance: float
    basis: Basis
    direction: Array
    locus: str

    @property
    def ratio(self) -> float:
        """sigma over the task's own: how much the constraint costs."""
        return self.sigma / self.task if self.task > 0.0 else 0.0


class Adviser:
    """Advice on some pairs of a robot.

        adviser = Adviser(robot, mode_pairs("ssrms", "M1"))
        for advice in adviser.advise(q): ...
        name = adviser.recommend(q, current="xi | alpha")

    Singular values are those of D_r [J_T; J_C] D_c, see :class:`Conditioning`, without the rows and columns of joints
    that the constraint locks on other arms than the task's, see :func:`braked`: the rank that is lost is the same. For
    over-determined pairs the matrix is tall.

    A pair that locks joints of the arm which it commands means less to an operator than one that holds a pitch plane,
    an elbow or another body: in comparisons its singular value counts by 1 / factor.

    Args:
        length: characteristic length [m]; default: the robot's. near: see :data:`NEAR`.
        factor: how much better another pair must be for a change, > 1: the hysteresis.
        exact: factor the determinants of square pairs, which takes some seconds when it is first needed.
        backend: ``native``, ``vm`` (numpy), or ``auto``.

    Raises:
        ShapeError, DuplicateNameError, RangeError, UnknownNameError: bad pairs, numbers, names.
    """

    def __init__(
        self,
        robot: Robot,
        pairs: Iterable[CoordinatePair],
        *,
        length: float | None = None,
        near: float = NEAR,
        factor: float = FACTOR,
        exact: bool = True,
        backend: str = "auto",
    ) -> None:
        given = pairs_of(pairs)
        self.pairs: dict[str, CoordinatePair] = {}
        for pair in given:
            pair.counts(robot)
            if pair.name in self.pairs:
                raise DuplicateNameError("pairs", pair.name, "two pairs of one name")
            self.pairs[pair.name] = pair
        self.robot = robot
        self.factor = validation.scalar("factor", factor, low=1.0)
        self._exact = validation.flag("exact", exact)
        self._loss = RankLoss(robot, given, length=length, near=near, backend=backend)
        self.near, self.conditioning = self._loss.near, self._loss.conditioning
        self._names = list(self.pairs)
        #: Of each pair: what its singular value counts by where pairs are compared
        self._worth = np.array(
            [
                1.0 / self.factor if any(isinstance(one, JointRows) for one in some.held) else 1.0
                for some in self._loss.braked
            ]
        )
        self._wholes = self.conditioning.chosen(self._loss.numbers[:, 0].tolist())
        self._wholes_and_tasks = self.conditioning.chosen(self._loss.numbers[:, :2].ravel().tolist())
        alike = [[k for k, other in enumerate(given) if other.task == pair.task] for pair in given]
        #: Of each pair: those with its task, itself among them, and singular values of all these and of the task
        self._siblings = {
            pair.name: (
                some,
                self.conditioning.chosen([*self._loss.numbers[some, 0].tolist(), int(self._loss.numbers[k, 1])]),
            )
            for k, (pair, some) in enumerate(zip(given, alike, strict=True))
        }

    def sigmas(self, q: Any) -> Array:
        """The least singular value of each pair, in their order: what a control loop asks for.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        return self._wholes(checked_configuration(self.robot, q))

    def singular_values(self, q: Any) -> tuple[Array, Array]:
        """(the least singular value of each pair, that of its task alone), in their order.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        both = self._wholes_and_tasks(checked_configuration(self.robot, q)).reshape(-1, 2)
        return both[:, 0], both[:, 1]

    def advise(self, q: Any) -> tuple[Advice, ...]:
        """All about every pair, in their order.

        Raises:
            ShapeError, NotFiniteError, RotationError: no configuration.
        """
        q = self.robot.configuration("q", q)
        sigmas, slopes, _ = self.conditioning.slopes(q)
        lost: dict[int, float] = {}
        out = []
        for (whole, task, constraint), name, some in zip(
            self._loss.numbers, self._names, self._loss.braked, strict=True
        ):
            known = closed_form(self.robot, self.pairs[name]) if self._exact else None
            distance, basis, direction, locus = self._nearest(q, float(sigmas[whole]), slopes[whole], known)
            for group in (whole, task, constraint):
                if group not in lost:
                    lost[group] = self._loss.distance(q, int(group))
            pair = min(lost[whole], distance) if basis is Basis.EXACT else lost[whole]
            # Brakes by themselves do not depend on each other
            held = lost[constraint] if some.held else np.inf
            condition = self._loss.blamed(pair, lost[task], held)
            alone, by_itself = float(sigmas[task]), float(sigmas[constraint]) if some.held else 1.0
            sigma = float(sigmas[whole])
            out.append(Advice(name, sigma, alone, by_itself, condition, distance, basis, direction, locus))
        return tuple(out)

    def recommend(self, q: Any, current: str | None = None) -> str:
        """The name of the pair to use: the best one, or the current one where none is better by the factor.

        The best conditioned one is the best, but for locks of joints, see the class. Only pairs that command the same
        can be compared: with ``current`` those with its task.

        Raises:
            UnknownNameError: no such pair. ShapeError, NotFiniteError, RotationError: no configuration.
        """
        if current is None:
            return self._names[int(np.argmax(self._worth * self.sigmas(q)))]
        return self.look(q, current)[2]

    def look(self, q: Any, current: str) -> tuple[float, float, str]:
        """(sigma of a pair, that of its task alone, the pair to use), what driving asks for in every tick.

        Raises:
            UnknownNameError: no such pair. ShapeError, NotFiniteError, RotationError: no configuration.
        """
        validation.one_of("current", current, self.pairs)
        alike, asked = self._siblings[current]
        found = asked(checked_configuration(self.robot, q))
        sigmas, task = found[:-1], float(found[-1])
        worth = self._worth[alike] * sigmas
        best, own = int(np.argmax(worth)), alike.index(self._names.index(current))
        stay = worth[best] < self.factor * worth[own] or best == own
        return float(sigmas[own]), task, current if stay else self._names[alike[best]]

    def _nearest(
        self, q: Array, sigma: float, slope: Array, known: ClosedForm | None
    ) -> tuple[float, Basis, Array, str]:
        """(distance, basis, direction, text) of the locus that is nearest."""
        scale = self.conditioning.dof_scale
        along = slope * scale
        steep = float(np.linalg.norm(along))
        guess = sigma / steep if steep > 0.0 else (0.0 if sigma == 0.0 else np.inf)
        found = known.nearest(q) if known is not None else None
        if found is not None:
            place, distance = found
            away = abs(distance) / float(scale[place.dof])
            if away <= guess:
                direction = np.zeros(self.robot.nv)
                direction[place.dof] = np.sign(distance) * scale[place.dof]
                return away, Basis.EXACT, direction, str(place)
        direction = -along / steep * scale if steep > 0.0 else np.zeros(self.robot.nv)
        return guess, Basis.FIRST_ORDER, direction, ""

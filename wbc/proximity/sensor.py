"""The sensor of the closest pairs: what sensed rows of a constraint are fed with before every tick."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wbc.errors import RangeError
from wbc.proximity.body import OBSTACLE, Body, checked_pairs
from wbc.proximity.native import Sensing
from wbc.proximity.rows import PairRows
from wbc.proximity.scene import PairScene
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.robot import Robot


class PairSensor:
    """Writes the ``count`` closest of some pairs into the inputs of sensed rows.

    See :meth:`wbc.tasks.base.Constraint.sensed_rows` for what ``distance``, ``drift``, ``line`` and ``side`` mean. The
    first ``count`` rows are for the nearest points; then come ``corners`` rows a pair, see
    :mod:`wbc.proximity.corners`.

    Args:
        robot: the robot that carries the bodies.
        pairs: bodies A and B each; normals point from A to B.
        count: how many pairs have rows.
        numbers: views that are written (``distance``, ``drift``, ``line``, ``side``) and read (``pose``, and
            ``velocity`` where given, of what moves from outside; ``margin`` [m] and ``rate`` [1/s] where given).
        moving: one more name, besides ``"obstacle"``, for the frame that moves with ``numbers["pose"]``.
        corners: how many more rows a pair has.
        most: of the margin that each pair keeps [m]; default: all of it.

    Raises:
        ShapeError, RangeError, UnknownNameError, DuplicateNameError: no pairs, too many, or bad ones.
        UnsupportedJointError: a pair that a mimic joint and its leader move in different ways.
    """

    def __init__(
        self,
        robot: Robot,
        pairs: Sequence[tuple[Body, Body]],
        count: int,
        numbers: Mapping[str, Array],
        *,
        moving: str | None = None,
        corners: int = 0,
        most: Array | None = None,
    ) -> None:
        outside = frozenset({OBSTACLE} if moving is None else {OBSTACLE, moving})
        checked = checked_pairs("pairs", robot, pairs, outside)
        if not checked:
            raise RangeError("pairs", 0, "expected a pair at least")
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise RangeError("count", count, "expected an integer >= 1")
        if isinstance(corners, bool) or not isinstance(corners, int) or corners < 0:
            raise RangeError("corners", corners, "expected an integer >= 0")
        scene = PairScene(robot, checked, outside)
        self._names = [(a.name, b.name) for a, b in checked]
        self._rows = PairRows.of(scene, count, corners, numbers, most)
        self._sensing = Sensing(scene, self._rows)
        self.count, self._robot, self._shape = count, robot, (robot.nq,)
        self.reset()

    @property
    def doubtful(self) -> NDArray[np.bool_]:
        """Rows whose normal is a declared one because shapes lie inside each other, see docs/proximity.md."""
        pairs = self._sensing.pairs
        return np.where(pairs >= 0, self._sensing.doubtful[pairs], False)

    @property
    def measured(self) -> int:
        """How many pairs the last :meth:`sense` measured; the others were too far to have rows."""
        return self._sensing.measured

    def reset(self) -> None:
        """Forget which pairs had which rows; until the next :meth:`sense` no row has a pair."""
        self._sensing.reset()
        self._rows.clear()

    def sense(self, q: Array) -> None:
        """Measure at a configuration [nq] and write the rows.

        Raises:
            ShapeError, NotFiniteError: no configuration; nothing is written. An array [nq] is taken as it is.
        """
        if type(q) is not np.ndarray or q.shape != self._shape:
            q = self._robot.configuration("q", q)
        self._sensing.sense(q)

    @property
    def addresses(self) -> tuple[int, ...]:
        """Of ``wbc_sense`` and ``wbc_missing`` in C, which do what :meth:`sense` and :meth:`missing` do, and of what
        they work on.
        """
        return self._sensing.addresses

    def missing(self, screws: Array, v: Array, dt: float, braking: Array) -> int:
        """The most that a pair without a row uses of what its row would allow, where the last :meth:`sense` was, at the
        command v [nv]: :data:`wbc.proximity.missing.LITTLE` to ``INWARD``. From ``TOO_MUCH`` on the next :meth:`sense`
        has rows for such pairs, and the command is to be found again.

        Args:
            screws: there, the twist (linear; angular) at the world's origin of each degree of freedom [nv, 6].
            dt: until the next command [s]. braking: deceleration of each degree of freedom that is counted on in front
                of a margin [nv]; infinite where any will do.
        """
        return self._sensing.missing(screws, v, dt, braking)

    def pairs(self) -> tuple[tuple[str, str, float], ...]:
        """(name of A, name of B, distance [m]) of the rows that have a pair, in the last call."""
        distances = self._sensing.distances
        return tuple((*self._names[k], float(distances[k])) for k in self._sensing.pairs.tolist() if k >= 0)

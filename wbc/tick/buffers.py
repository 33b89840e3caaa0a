"""What ticks have in common: flat buffers that the controller writes, the report that it reads, flags, tolerances."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc.errors import SolverError
from wbc.qp.problem import QP
from wbc.tasks.base import Command
from wbc.validation import Array

#: Flags of a tick
SOLVED, RELAXED, BRAKED, CAPPED = 0, 1, 2, 3
#: In the report in place of these: the first of the links of a chain that may have given the answer; braked at its end;
#: braked because the policy wants it; moved out of a singular configuration because it wants that
RECOVERED, CHAIN_BRAKED, POLICY_BRAKED, ESCAPED = 4, 8, 9, 10
#: Added to what a tick returns, not to what it reports: the certificate fails, or a solver has found no answer
UNSOUND = 4
#: Refusals: nothing was changed
BAD_Q, BAD_UNIT, BAD_V = -1, -2, -3

#: Stand-in for infinity in bounds and in the error bound of a tick without a certificate
INFINITE = 1e30

#: Violations up to this, in row units, are rounding; squared lengths of quaternions may be off by the other
#: (both as in ``native/settings.h``)
TOLERANCE, UNIT_TOLERANCE = 1e-9, 2.00001e-6

#: A certificate fails where a violation is above the first, or where both the bound on the error of v is above the
#: second (a length of the characteristic one counts as 1 rad) and the optimality conditions are off by more than the
#: third, or a row that never gives way is violated by more than the last; as in ``native/settings.h``
SOUND, KNOWN, OPTIMAL, FIRMLY = 1e-6, 1e-3, 1e-9, 1e-8

#: What equality rows may lose [rad, or characteristic lengths, per second], from where on joints that bounds stop are
#: not counted on, how often rows are corrected, how often the step gets shorter and by how much, and from which rate on
#: a joint turns round; as in ``native/bend.h``
BENDS, STRETCHED, BENDINGS, SHORTER, STEEPER, TURNING = 1e-3, 2e-2, 8, 3, 100.0, 1.0
#: How fast a robot whose base floats loses its velocity where a tick has no answer [1/s]; as in ``native/settings.h``
REST_RATE = 20.0

#: Paths to another answer, the quickest first, of which ``Policy`` tries some by default; braking is always the last
CHAIN = ("cold", "daqp", "osqp", "elastic")

#: Buffers that are 0 when a tick begins, and that the tick itself writes
OWN = ("bend", "curving", "stopped", "shortened")


class Buffers:
    """Flat float64 arrays, written in place.

    Attributes:
        q: configuration. v_in, use_v: a measured velocity, taken where ``use_v`` is not 0.
        cap: iterations of the native solver a tick at most, 0 for no cap.
        v_last: the velocity that accelerations are counted from.
        p: run-time inputs, see :class:`wbc.stack.layout.Layout`. dt: one number.
        weight: of each task row, scale included. enabled: 1 or 0 for each general row.
        bound_enabled: the same for each entry of each bound block.
        bend: added to both sides of equality rows that bend, see ``native/bend.h``; curving: not 0 where H has their
            curvature without calm motion, too; stopped: 1 for joints that bounds stop; shortened: on
            the diagonal of H besides. All 0 when a tick begins.
        report: see :class:`wbc.stack.memory.Memory`.
        state: all of these in one piece of memory that begins with the report. ``v_in`` in it is, after a tick, the
            velocity that the tick counted accelerations from.
    """

    q: Array
    v_in: Array
    use_v: Array
    cap: Array
    v_last: Array
    p: Array
    dt: Array
    weight: Array
    enabled: Array
    bound_enabled: Array
    bend: Array
    curving: Array
    stopped: Array
    shortened: Array
    report: Array
    state: Array
    #: of accelerations, the torques of the last command and the wrenches that a tick without an answer keeps
    #: [variables]; empty for velocities
    kept: Array = np.zeros(0)

    def share(self, other: Buffers) -> None:
        """Use the arrays of ``other``."""
        for name in Buffers.__annotations__:
            setattr(self, name, getattr(other, name))
        self.kept = other.kept


@dataclass(frozen=True, eq=False)
class TaskRows:
    """Rows of all tasks in the last QP: J [rows, nv], desired rates and fading factors [rows]."""

    J: Array
    desired: Array
    factor: Array


class Assembly(Buffers, ABC):
    """Buffers and the QP at their values; ``plain``: not 0 for the linear model as it is, without curvature."""

    plain: Array
    _command: Command
    _dofs: int
    #: place of the torques in the report
    _torque: slice
    #: places in ``p`` of torques that may change only so fast, and their degrees of freedom
    _slewed: tuple[list[int], list[int]]
    #: limits of motion give way, see :class:`wbc.stack.layout.Layout`
    _elastic: bool

    @abstractmethod
    def check(self) -> int:
        """Take q and a measured velocity over, or put the last good q back; negative for refused inputs."""

    @property
    @abstractmethod
    def usable(self) -> bool:
        """Numbers of the last QP are finite and every simple bound leaves an interval."""

    @abstractmethod
    def qp(self) -> QP:
        """The QP at the buffers' values, before any relaxation: of the first level, where there are several."""

    def quadratic(self) -> tuple[Array, Array]:
        """(H, g) of :meth:`qp` until the next call; only the upper triangle of H counts."""
        qp = self.qp()
        return qp.H, qp.g

    @abstractmethod
    def task_rows(self) -> TaskRows:
        """Rows of all levels in the last QP.

        Raises:
            SolverError: a native tick of one level, whose code does not keep them.
        """

    @abstractmethod
    def curvature(self) -> Array | None:
        """Curvature in H of the last QP [nv, nv], before anything made H positive definite; None for none.

        Raises:
            SolverError: a native tick of one level, whose code does not keep it.
        """

    @abstractmethod
    def row_bounds(self) -> tuple[Array, Array]:
        """Bounds of the general rows in the last QP, those that are minimised at a level included."""

    @abstractmethod
    def look_ahead(self) -> None:
        """Margins after the step, into the report."""

    @abstractmethod
    def find_lost(self, everything: bool) -> float:
        """What equality rows lose at the reported command, into the report; the largest as a rate, in row units.

        Args:
            everything: what they miss of moved sides, too, which is not what the order of sacrifice has taken.
        """

    #: whether :meth:`taker` is there
    takes = False

    def taker(self, staged: Array, plan: np.ndarray) -> Callable[[], int]:
        """What checks values that wait in ``staged`` and writes them to ``p``, in native code; 0, and nothing written,
        where one is refused.

        Args:
            plan: of each value what it is, where it goes in ``p``, how many numbers it has [count, 3].

        Raises:
            SolverError: not where :attr:`takes` is false.
        """
        raise SolverError("taker", type(self).__name__, "values are checked in Python here")

    def commanded(self, v: Array, sound: bool) -> None:
        """What follows from a command in the report: torques, and the velocity that the next tick counts from.

        Args:
            sound: it is a certified answer, whose wrenches the next tick keeps if it has none.
        """
        if self._command == "velocity":
            self.v_last[:] = v
            return
        nv = self._dofs
        self._find_torques()
        if self._command == "torque":
            self.kept[:nv] = self.report[self._torque]
        self.v_last[:nv] += float(self.dt[0]) * v[:nv]
        if sound:
            self.kept[nv:] = v[nv:]

    def forget(self) -> None:
        """No wrenches are kept, and the last torques are not known."""
        self.kept[:] = 0.0
        self.kept[: self._dofs] = INFINITE

    def rewind(self) -> None:
        """Before the tick is done again: accelerations and torques count from where they did."""
        self.v_last[:] = self.v_in
        self.unbend()
        self.kept[self._slewed[1]] = self.p[self._slewed[0]]

    def unbend(self) -> None:
        """The rows as they are at q."""
        for name in OWN:
            getattr(self, name)[:] = 0.0

    def rest(self, lower: Array, upper: Array, coasting: Array) -> Array:
        """The command within simple bounds that is nearest to rest: of velocities ``coasting``; else at once or, on a
        floating base, by damping.
        """
        nearest = coasting.copy()
        if self._command != "velocity":
            nv = self._dofs
            rate = REST_RATE if self._elastic else 1.0 / float(self.dt[0])
            nearest[:nv], nearest[nv:] = -rate * self.v_last[:nv], self.kept[nv:]
        return np.minimum(np.maximum(nearest, lower), upper)

    @abstractmethod
    def _find_torques(self) -> None:
        """Torques of the command into the report, where torques are commanded."""

    @abstractmethod
    def twin(self) -> Assembly:
        """Another one of the same code, with memory of its own."""

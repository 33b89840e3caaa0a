"""What must be true of every step, whatever was asked."""

from __future__ import annotations

import numpy as np

from tests.judges.quadprog_qp import SAME, distance
from wbc.api import Controller
from wbc.controller import Status, Step, core_of
from wbc.explain.past import past_of
from wbc.robot import Robot
from wbc.validation import Array

#: A certificate holds up to here: violations and bounds on the error, in rad/s and rows per characteristic length;
#: where the bound is larger, up to the second, or if the optimality conditions hold to the third: docs/controller.md
SOUND, KNOWN, OPTIMAL = 1e-6, 1e-3, 1e-9


class Judge:
    """Checks the steps of one controller; each check returns what is wrong, or an empty text.

    Attributes:
        loose: certificates whose bound on the error of v is above 1e-6. compared: those of them that were compared with
            the referee: answers of one level for which all rows hold.
    """

    def __init__(self, controller: Controller) -> None:
        robot = controller.stack.robot
        self.limits = robot.limits
        self.room = 1e-11 * np.maximum(1.0, np.where(np.isfinite(robot.limits.velocity), robot.limits.velocity, 1.0))
        scales = [1.0, controller.stack.length]
        self.longest = max(scales)
        self.loose = self.compared = 0
        blocks = core_of(controller).layout.of_form("margins", "rows")
        self.kinds = np.array([type(b.entry.item).__name__ for b in blocks for _ in b.rows])

    def gave_way(self, step: Step) -> set[str]:
        """Kinds of constraints with a row that gave way."""
        return set(self.kinds[np.flatnonzero(step._part("slack"))].tolist())

    def step(self, step: Step, before: Array, dt: float) -> str:
        """Numbers, actuator limits about the velocity before, and the certificate."""
        v, limits = step.v, self.limits
        if not np.isfinite(v).all() or np.isnan(np.frombuffer(step._data, count=step._context.memory.report)).any():
            return "NaN"
        reach = limits.acceleration * dt
        high = np.maximum(limits.velocity, before - reach) + self.room
        low = np.minimum(-limits.velocity, before + reach) - self.room
        if (v > high).any() or (v < low).any():
            return "beyond a velocity limit"
        if (np.abs(v - before) > reach + self.room).any():
            return "beyond an acceleration limit"
        if step.status in (Status.BRAKED, Status.CAPPED):
            return ""
        return self._certificate(step)

    def _certificate(self, step: Step) -> str:
        found = step.certificate
        optimal = max(found.stationarity, found.complementarity) <= OPTIMAL
        bound = found.error_bound / self.longest
        if not (found.violation <= SOUND * self.longest and (optimal or bound <= KNOWN)):
            return "a certificate that fails is not reported"
        if bound <= SOUND:
            return ""
        self.loose += 1
        if step.status == Status.SOLVED and not step.levels:
            off = distance(past_of(step._data, step._context).qp.with_slacks(), step.v)
            self.compared += off is not None
            if off is not None and off > SAME * self.longest:
                return "another optimum than the referee's"
        return ""


class Outside:
    """Joints that are outside a limit brake, return, and do not go further out there again.

    Lower and upper limits are watched apart: a joint that enters faster than its acceleration can take away on the way
    across leaves on the other side, whatever is commanded.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.at = np.flatnonzero(robot.position_index >= 0)
        self.q_at = robot.position_index[self.at]
        self.turned = np.zeros((2, self.at.size), dtype=bool)
        self.last = np.zeros((2, self.at.size))

    def begin(self, q: Array) -> None:
        """Another episode."""
        self.turned[:] = False
        self.last[:] = self._beyond(q)

    def _beyond(self, q: Array) -> Array:
        """How far below the lower and above the upper limits."""
        limits, x = self.robot.limits, q[self.q_at]
        out = (limits.position_lower[self.at] - x, x - limits.position_upper[self.at])
        return np.asarray(np.maximum(0.0, np.stack(out)))

    def look(self, q: Array) -> str:
        """After a step."""
        beyond = self._beyond(q)
        worse = beyond > self.last + 1e-9
        bad = worse & self.turned
        # too fast too near to a limit a joint may pass it; from the tick on in which it turns it may not
        self.turned |= ~worse & (self.last > 1e-9)
        self.last[:] = beyond
        return "a violated position limit is violated more" if bad.any() else ""

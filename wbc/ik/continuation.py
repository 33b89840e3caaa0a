"""Along a path of targets: configurations of one branch, each found from the one before in steps without a jump."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from wbc.controller.step import Step
from wbc.errors import ContinuityError, InfeasibleError
from wbc.ik.engine import SearchEngine
from wbc.ik.search import FOUND
from wbc.multibody import pin
from wbc.validation import Array

#: Neighbouring configurations farther apart than this [rad, or characteristic lengths] have a jump between them if
#: halving does not help
JUMP = 0.02

#: How often a step is halved to tell a jump, or the end of what is reached, from a steep place
HALVINGS = 24

#: Steps that targets given by functions are looked at in at least, from the first coordinate to the last
LOOKS = 100


@dataclass(frozen=True, eq=False)
class PathBranch:
    """Answer of :meth:`wbc.InverseKinematics.along`.

    Attributes:
        s: path coordinates that were asked for [count].
        q: the configurations there, within the position limits [count, nq].
        steps: the tick at each of them: residuals, margins and binding rows.
        samples: configurations that were found, those between the coordinates included.
        moved: what a joint moved from one of these to the next at most [rad, or characteristic lengths].
    """

    s: Array
    q: Array
    steps: tuple[Step, ...]
    samples: int
    moved: float


def branch(
    engine: SearchEngine, aim: Callable[[float], None], s: Array, first: Array, tolerance: float, smooth: bool
) -> PathBranch:
    """The branch at coordinates, from a configuration at which the search of the first one begins; ``smooth``: targets
    go straight from one coordinate to the next, and no step is too long.
    """
    tracker = Tracker(engine, aim, tolerance, math.inf if smooth else (s[-1] - s[0]) / LOOKS)
    q = [tracker.at(float(s[0]), first)]
    steps = [tracker.look(q[0])]
    for before, here in itertools.pairwise(s.tolist()):
        q.append(tracker.go(before, here, q[-1]))
        steps.append(tracker.look(q[-1]))
    return PathBranch(s, np.array(q), tuple(steps), tracker.samples, tracker.moved)


class Tracker:
    """Goals that are met at one path coordinate after the other.

    Args:
        aim: sets the targets of a coordinate. longest: of the steps.
    """

    def __init__(
        self, engine: SearchEngine, aim: Callable[[float], None], tolerance: float, longest: float = math.inf
    ) -> None:
        self._engine, self._aim, self._longest = engine, aim, longest
        self._query = engine.query(engine.goals, tolerance, 0, 0)
        #: where the last step ended, and dq/ds there
        self._slope = math.nan, np.zeros(engine.stack.robot.nv)
        self.samples, self.moved = 0, 0.0

    def at(self, s: float, start: Array) -> Array:
        """Where a search from a configuration nearby ends.

        Raises:
            InfeasibleError: the goals are not met there.
        """
        q = self._near(s, start)
        if q is None:
            raise self._unmet(s, s)
        self.samples += 1
        return q

    def go(self, before: float, here: float, q: Array) -> Array:
        """From the configuration at one coordinate to that at the next.

        Raises:
            InfeasibleError: from some coordinate on the goals are not met. ContinuityError: configurations jump.
        """
        engine, place, halved = self._engine, before, 0
        model, step = engine.stack.robot.model, min(here - before, self._longest)
        slope = self._slope[1] if self._slope[0] == before else np.zeros(engine.stack.robot.nv)
        while place < here:
            ahead = min(place + step, here) if here - place > 1.5 * step else here
            found = self._near(ahead, np.asarray(pin.integrate(model, q, (ahead - place) * slope)))
            way = np.full(len(slope), np.inf) if found is None else np.asarray(pin.difference(model, q, found))
            moved = float(np.abs(way / engine.dof_scales).max())
            if found is None or moved > JUMP:
                if halved >= HALVINGS:
                    beyond = min(here, place + (here - before) * 2.0 ** (-HALVINGS // 3))
                    raise self._unmet(ahead, beyond) if found is None else self._torn(ahead, q, way, beyond)
                # What was predicted may be what leads astray
                step, halved, slope = 0.5 * (ahead - place), halved + 1, 0.0 * slope
                continue
            self.samples, self.moved = self.samples + 1, max(self.moved, moved)
            if halved and moved < 0.25 * JUMP:
                step, halved = 2.0 * step, halved - 1
            place, q, slope = ahead, found, way / (ahead - place)
        self._slope = here, slope
        return q

    def look(self, q: Array) -> Step:
        """The tick at q, with the targets that were set last."""
        return self._engine.look(q, self._query.settling)

    def _near(self, s: float, start: Array) -> Array | None:
        """The answer of a search without restarts, None where there is none."""
        engine = self._engine
        self._aim(s)
        found = engine.run(engine.within_limits(start), self._query, math.inf)
        return engine.within_limits(engine.tick.q) if found.ending == FOUND else None

    def _unmet(self, s: float, beyond: float) -> InfeasibleError:
        """Of the configuration that the last search ended with."""
        engine = self._engine
        q = engine.within_limits(engine.tick.q)
        step = self.look(q)
        far = "; ".join(f"{name} off by {step.residuals[name]}" for name in engine.goals)
        return InfeasibleError("s", float(s), f"not reached: {far}; {self._blocking(q, beyond)}")

    def _torn(self, s: float, q: Array, way: Array, beyond: float) -> ContinuityError:
        robot = self._engine.stack.robot
        worst = int(np.abs(way / self._engine.dof_scales).argmax())
        size = f"{abs(way[worst]):.3g} {robot.dof_units[worst]}"
        reason = f"{robot.dof_names[worst]} jumps by {size} here; before it, {self._blocking(q, beyond)}"
        return ContinuityError("s", float(s), reason)

    def _blocking(self, q: Array, beyond: float) -> str:
        """What keeps a configuration from the targets of a coordinate some way on."""
        self._aim(beyond)
        binding = self.look(q).binding
        return "binding: " + ", ".join(str(b) for b in binding) if binding else "no row binds"

"""Inverse kinematics: the tasks and constraints of a stack, converged to a configuration."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from wbc import validation
from wbc.controller.compiled_stack import core_of
from wbc.controller.handles import Handles
from wbc.errors import RangeError, ShapeError
from wbc.ik.branches import Branches, branches
from wbc.ik.continuation import PathBranch, branch
from wbc.ik.engine import SearchEngine, ending
from wbc.ik.moving_targets import MovingTargets
from wbc.ik.reach import beyond_reach
from wbc.ik.search import EXHAUSTED, FOUND, NativeSearch, search_many
from wbc.ik.solution import BatchSolution, Ending, Solution
from wbc.ik.timeless import TICK
from wbc.stack.declaration import Declaration
from wbc.tick.native import NativeTick
from wbc.validation import Array

#: Share of the time that is kept for the question which goals contradict each other
ASKING = 0.2

#: Most random configurations; they are made before a search
RESTARTS = 10**6
#: Most threads
THREADS = 1024


class InverseKinematics(Handles):
    """Inverse kinematics of a stack, compiled once. Made by :meth:`wbc.Stack.inverse_kinematics`.

        kinematics = stack.inverse_kinematics()
        kinematics["hand"].target = pose             # targets that nobody sets are taken from q0
        solution = kinematics.solve(q0)
        solution = kinematics.solve(q0, {"hand": pose})     # of this search alone

    A search makes Newton steps on the rows of the controller, with gains of one step, no limits of speed, and a damping
    that falls with the error, from q0 and then from random configurations, until the goals are met and the constraints
    hold. Then the secondary tasks (all others) are followed as far as they cost the goals nothing. docs/ik.md

    Attributes:
        stack: the same items without time.
        goals: names of the tasks to be met.
        backend: ``native`` (the loop in C) or ``vm``.

    What it cannot do: prove that a target is out of reach; that there is no answer is what the descents say for which
    there was time. :meth:`solve` returns the first answer of several. Limits of speed and acceleration do not count.
    """

    def __init__(self, stack: Declaration, goals: Iterable[str] | None = None, backend: str = "auto") -> None:
        self._engine = SearchEngine(stack, goals, backend)
        self.stack, self.goals = self._engine.stack, self._engine.goals
        self.backend = self._engine.controller.backend
        super().__init__(self._engine.core.handles, stack)

    def solve(
        self,
        q0: Any,
        targets: Mapping[str, Any] | None = None,
        *,
        seed: int = 0,
        budget: float | None = None,
        restarts: int = 100,
        tolerance: float = 1e-5,
    ) -> Solution:
        """The configuration at which the goals are met, or the nearest one that was found, and why.

        Args:
            q0: where the search begins [nq]; what lies outside the position limits is moved to them.
            targets: name of a task -> its ``target`` in this search; others are what is set, or taken from q0.
            seed: of the random configurations. The answer is a function of q0, the run-time values, the seed and the
                number of restarts, unless a budget ends the search.
            budget: time for the search [s], overrun by one iteration and the report of the answer at most; None: no
                limit, the search ends with its restarts.
            restarts: random configurations to start from after q0 at most, 10^6 or fewer.
            tolerance: of every row of a goal, in metres and radians.

        Raises:
            UnknownNameError, ShapeError, NotFiniteError, RotationError, RangeError: bad input.
        """
        engine = self._engine
        seconds, near, starts, number = _options(budget, tolerance, restarts, seed)
        given = {} if targets is None else validation.mapping("targets", targets, "tasks to targets")
        wanted = [self._target(name, (target,)) for name, target in given.items()]
        first = engine.begin(q0)
        before = engine.tick.p.copy()
        try:
            for span, (numbers,) in wanted:
                engine.tick.p[span] = numbers
            return self._solved(first, seconds, near, starts, number)
        finally:
            engine.tick.p[:] = before

    def _target(self, name: str, values: Sequence[Any]) -> tuple[slice, list[Array]]:
        """Where the target of a task is among the run-time values, and its numbers for each of several values."""
        handle = self._engine.controller[name]
        return handle.slot("target").span, [handle.checked("target", value) for value in values]

    def _solved(self, first: Array, seconds: float, near: float, starts: int, number: int) -> Solution:
        """The search of :meth:`solve` with the run-time values as they are."""
        engine, goals = self._engine, self.goals
        query = engine.query(goals, near, starts, number)
        found = engine.run(first, query, seconds * (1.0 - ASKING if len(goals) > 1 else 1.0))
        # Rounding of the last tick may pass a limit by its last digit
        answer, spent, ticks = engine.within_limits(engine.tick.q), found.seconds, found.ticks
        status = ending(found)
        if status == Ending.UNREACHABLE and len(goals) > 1:
            alone = []
            for left, name in zip(range(len(goals), 0, -1), goals, strict=True):
                # What one search takes too long, the next ones have less
                share = (seconds - spent) / left
                alone.append(engine.run(first, engine.query((name,), near, starts, number), share))
                spent, ticks = spent + alone[-1].seconds, ticks + alone[-1].ticks
            if all(a.ending == FOUND for a in alone):
                status = Ending.CONTRADICTORY
        step = engine.look(answer, query.settling if status == Ending.SOLVED else query.seeking)
        return Solution(answer, status, goals, ticks, found.descents + (found.ending > EXHAUSTED), spent, step)

    def solve_batch(
        self,
        q0: Any,
        targets: Mapping[str, Sequence[Any]],
        *,
        seed: int = 0,
        budget: float | None = None,
        restarts: int = 100,
        tolerance: float = 1e-5,
        workers: int | None = None,
        nearest: bool = True,
    ) -> BatchSolution:
        """:meth:`solve` for many targets, in threads that run at the same time.

        Args:
            q0: where every search begins [nq].
            targets: name of a task -> its ``target`` in each search; all of one length.
            budget: time for each search [s]; None: no limit.
            workers: threads; default: as many as cores. Without a compiler, or where rows are measured, there is one.
            nearest: also look for the nearest configuration where a target is proven out of reach, see
                :func:`wbc.ik.reach.beyond_reach`; False: such a search is left out, its q is q0 and its descents are 0.
                Statuses and all other answers are the same.

        Raises:
            WbcError: as for :meth:`solve`; ShapeError: no targets, or of different lengths.
        """
        engine, controller = self._engine, self._engine.controller
        given = validation.mapping("targets", targets, "tasks to targets")
        wanted = {name: validation.items(f"targets[{name}]", values, "targets") for name, values in given.items()}
        lengths = {name: len(values) for name, values in wanted.items()}
        if len(set(lengths.values())) != 1:
            raise ShapeError("targets", lengths, "expected targets of one length")
        threads = os.cpu_count() or 1 if workers is None else validation.integer("workers", workers, 1, THREADS)
        total = next(iter(lengths.values()))
        seconds, near, starts, number = _options(budget, tolerance, restarts, seed)
        proofs = not validation.flag("nearest", nearest)
        checked = [self._target(name, values) for name, values in wanted.items()]
        # Nothing else is refused: from here on targets that wait are taken from q0
        first = engine.begin(q0)
        parameters = np.tile(engine.tick.p, (total, 1))
        for span, numbers in checked:
            for k, value in enumerate(numbers):
                parameters[k, span] = value
        query, before = engine.query(self.goals, near, starts, number), engine.tick.p.copy()
        hopeless = np.zeros(total, bool)
        if proofs:
            for entry in self.stack.entries:
                # Rows that are switched off need not be met
                all_count = engine.tick.weight[engine.core.layout.blocks[entry.name].span].all()
                if not all_count or entry.name not in self.goals:
                    continue
                if (beyond := beyond_reach(self.stack.robot, entry, near)) is not None:
                    hopeless |= beyond(parameters[:, controller[entry.name].slot("target").span])
        sought = np.flatnonzero(~hopeless)
        answers = np.tile(first, (total, 1))
        if isinstance(engine.search, NativeSearch):
            clones = [core_of(controller.clone()).tick for _ in range(min(threads, max(1, len(sought))))]
            ticks = [tick for tick in clones if isinstance(tick, NativeTick)]
            for tick in ticks:
                tick.dt[0] = TICK
            answers[sought], found = search_many(ticks, query, seconds, answers[sought], parameters[sought])
        else:
            found = []
            for k in sought.tolist():
                engine.tick.p[:] = parameters[k]
                found.append(engine.run(first, query, seconds))
                answers[k] = engine.tick.q
            engine.tick.p[:] = before
        statuses = [Ending.UNREACHABLE] * total
        descents, spent = np.zeros(total), np.zeros(total)
        for k, f in zip(sought.tolist(), found, strict=True):
            statuses[k], descents[k], spent[k] = ending(f), float(f.descents + (f.ending > EXHAUSTED)), f.seconds
        return BatchSolution(engine.within_limits(answers), tuple(statuses), descents, spent)

    def along(
        self,
        targets: Mapping[str, Callable[[float], Any] | Sequence[Any]],
        s: Any,
        q0: Any,
        *,
        tolerance: float = 1e-8,
    ) -> PathBranch:
        """The branch of configurations over targets that change with a path coordinate.

            q(s_0) = where a descent from q0 ends,    q(s + ds) = where one from q(s) + (dq/ds) ds ends,

        and the secondary tasks are at rest. ds goes to the next s, but no farther than a hundredth of the whole where a
        target is a function. It is halved where the descent fails or a joint moves by more than 0.02 (rad, or
        characteristic lengths), and doubled again where all move by less than a quarter of that. What is still so after
        24 halvings is a jump, or the end of what can be reached.

        Args:
            targets: name of a task -> function of s that returns its ``target``, or a sequence with one for each entry
                of s (between two of them: a screw motion of poses, the shortest turn of rotations, else straight).
                Targets that are not named stay as they are.
            s: where configurations are asked for, increasing [count].
            q0: where the first one is searched [nq].
            tolerance: of every row of a goal, in metres and radians.

        Raises:
            InfeasibleError: from some s on the goals cannot be met; ``value`` is that s, and the message says how far
                they are off and what binds. ContinuityError: the branch ends or folds; ``value`` is the s where q
                jumps, and the message names the joint and what binds there. WbcError: bad input.

        Cannot do: change the branch, or pass a limit by a detour; jumps below 0.02 are not seen.
        """
        engine = self._engine
        places = validation.real_array("s", s)
        if places.ndim != 1 or not len(places):
            raise ShapeError("s", s, "expected at least one number, in one row")
        if (np.diff(places) <= 0.0).any():
            raise RangeError("s", s, "path coordinates must increase strictly")
        near = validation.scalar("tolerance", tolerance, low=0.0, open_low=True)
        moving = MovingTargets(engine.controller, targets, places)
        before = engine.tick.p.copy()
        try:
            return branch(engine, moving.aim, places, engine.begin(q0), near, moving.smooth)
        finally:
            engine.tick.p[:] = before

    def branches(
        self,
        q0: Any,
        *,
        most: int | None = None,
        seed: int = 0,
        budget: float | None = None,
        restarts: int = 500,
        tolerance: float = 1e-5,
    ) -> Branches:
        """The distinct configurations that meet the goals, as one descent from each of many configurations finds them.

        Two are distinct where a joint differs by more than 0.01 (rad, or characteristic lengths), full turns not
        counted; of those that differ by full turns the one nearest to q0 within the limits is given. With secondary
        tasks, a branch is a configuration where they are at rest: the best one of its neighbourhood.

        Answers are points only where tasks, holds and couplings leave no direction free. A redundant arm with a pose
        alone has curves of answers, of which any list would be arbitrary: such a stack is refused. With a secondary
        task that decides, as a Posture of small weight, the points are those of the curves where it is at rest.

        Args:
            q0: where the first descent begins [nq], and what distances are counted from.
            most: branches that are enough; None: go on until the restarts or the time are used up.
            seed: of the random configurations. The answer is a function of q0, the run-time values, the seed and the
                number of restarts, unless a budget ends the search.
            budget: time for the search [s], overrun by one iteration and the report of the answers at most; None: no
                limit.
            restarts: random configurations to start from after q0.
            tolerance: of every row of a goal, in metres and radians.

        Raises:
            RangeError: a direction is free. InfeasibleError: no descent met the goals; ``value`` is the largest error
                at the nearest configuration, and the message names what binds there. WbcError: bad input.

        What it cannot do: prove that these are all; :attr:`Branches.unseen` estimates what was missed.
        """
        engine = self._engine
        seconds, near, starts, number = _options(budget, tolerance, restarts, seed)
        wanted = sys.maxsize if most is None else validation.integer("most", most, 1)
        return branches(
            engine, engine.begin(q0), most=wanted, seed=number, seconds=seconds, restarts=starts, tolerance=near
        )


def _options(budget: Any, tolerance: Any, restarts: Any, seed: Any) -> tuple[float, float, int, int]:
    """Checked: seconds, tolerance, restarts, seed."""
    seconds = math.inf if budget is None else validation.scalar("budget", budget, low=0.0, open_low=True, unit="s")
    near = validation.scalar("tolerance", tolerance, low=0.0, open_low=True)
    starts = validation.integer("restarts", restarts, 0, RESTARTS)
    return seconds, near, starts, validation.integer("seed", seed, 0, 2**63 - 1)

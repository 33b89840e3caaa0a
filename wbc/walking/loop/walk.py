"""Carrying out a plan: the loop of controller, hands and simulated robot."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from math import dist
from typing import Any

import numpy as np

from wbc.robots import Walker
from wbc.walking.body_path import BodyPath, standing_path, straight_path
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.moving_body import MovingBody
from wbc.walking.loop.stack import DT, WalkStack
from wbc.walking.loop.state import Event, Hand, State, Tick
from wbc.walking.planner.plan import HoldLost, NoPlanError, Plan
from wbc.walking.planner.replanning import PlanSlices, plan_from_here, plan_from_stance, plan_rest

__all__ = ["Event", "Hand", "Tick", "Walk"]

#: The walk is over when the body is this near to the end of the path [m]
ARRIVED = 0.002
#: A walk that takes this many times its path's duration and SLACK seconds more is given up
PATIENCE, SLACK = 4.0, 20.0
#: Speed on the way to another path [m/s]
JOINING = 0.05
#: Slices of planning between two ticks
SLICES = 3


class Walk(MovingBody):
    """A simulated walk. The simulator's only inputs are the joint rates that the controller returns; where the body is
    follows from the holds of its closed hands.

    Args:
        walker, structure: what walks where.
        plan: whole, or in slices (:func:`wbc.walking.planner.replanning.plan_from_stance`): then the walk begins with
            the first plan that is there, and plans on between its ticks.
        collisions, backend: see :class:`WalkStack`. stack: a compiled one, of the same walker.
        grasps: (arm, hold) -> whether the hand's latch closes; default: always.
        state: where it begins; default: on the holds of the plan, all hands closed.

    Attributes:
        plan: the one that is carried out now; path times count from its beginning.
        events: what happened so far.

    Raises:
        ShapeError: a plan that was read from a file, without its grips. NoPlanError: slices that find no beginning.
    """

    def __init__(
        self,
        walker: Walker,
        structure: Structure,
        plan: Plan | PlanSlices,
        *,
        dt: float = DT,
        collisions: bool = False,
        backend: str = "auto",
        stack: WalkStack | None = None,
        grasps: Callable[[str, str], bool] | None = None,
        state: State | None = None,
    ) -> None:
        self._planning: PlanSlices | None = None
        if not isinstance(plan, Plan):
            self._planning, plan = plan, next(first for first in plan if first is not None)
        stack = stack or WalkStack(walker, structure, dt, collisions=collisions, backend=backend)
        super().__init__(walker, structure, plan, stack, grasps, state)
        self._wanted: BodyPath | None = None
        self._quick = True

    @property
    def done(self) -> bool:
        """The body is at the end of the path, and no hand is on its way."""
        ended = self.path_time >= self.plan.path.duration - 1e-9 and self.swinging is None and not self._changing
        if not ended or self.next < len(self.plan.regrasps):
            return False
        return dist(self.q[:3], self.plan.path.poses[-1][:3, 3]) < ARRIVED

    def run(self, on_tick: Callable[[Tick], Any] | None = None) -> str:
        """Ticks until the walk is done or given up.

        Returns:
            "arrived", or "late" when it takes more than four times as long as the path.

        Raises:
            HoldLost, NoPlanError: as of :meth:`tick`.
        """
        longest = self.time + PATIENCE * self.plan.path.duration + SLACK
        while not self.done:
            if self.time > longest:
                return "late"
            tick = self.tick()
            if on_tick is not None:
                on_tick(tick)
        return "arrived"

    def vanish(self, ids: Iterable[str]) -> None:
        """Take holds away: free, targeted or held. What of the plan does not need them is kept; a hand that held one is
        open at once, and the body stops until there is a plan.

        Raises:
            UnknownNameError: no such hold; nothing is changed.
        """
        gone = {self.structure.index(hold) for hold in ids}
        names = [self.structure.ids[k] for k in sorted(gone)]
        rest = self.structure.without(names)
        for name in names:
            self._say("vanished", "", name)
        open_now = [arm for arm, hold in self.held.items() if hold in gone]
        for arm in open_now:
            self._open(arm)
        if self.swinging is not None and self.swinging.hold in gone:
            self._stay(self.swinging.arm)
            self.swinging = None
            open_now.append(-1)
        self._renumber(rest)
        done = self.next + int(self.swinging is not None and self.swinging.counted)
        lost = [k for k, step in enumerate(self.plan.regrasps) if k >= done and step.target in names]
        if open_now or self._planning is not None or (self.swinging is not None and not self.swinging.counted):
            self._stop()
        elif lost and not self._changing:
            self._planning = plan_rest(self.walker, rest, self.plan, lost[0], self.path_time)

    def go(self, path: BodyPath) -> None:
        """Follow another path: the body stops, goes straight to where the path begins, and on."""
        self._wanted, self._quick = path, True
        self._stop()

    @property
    def busy(self) -> bool:
        """It is planning by itself, or brings a hand to where a plan begins."""
        return self._changing or self._planning is not None or (self.swinging is not None and self.swinging.waits)

    def set_down(self) -> None:
        """The body stops where it is, and a hand in the air goes to a hold that it can keep there."""
        pose = self.plan.path.at(self.path_time)[0]
        if self.swinging is not None:
            self._stay(self.swinging.arm)
            self.swinging = None
        self._wanted, self._quick = standing_path(pose), False
        self._stop()

    def tick(self) -> Tick:
        """One control period: hands, body, controller, robot.

        Raises:
            HoldLost: fewer hands hold than the robot needs; all rates are zero, and the robot stays as it is.
            NoPlanError: the walk has to be planned anew, and there is no plan.
        """
        if len(self.held) < self.walker.min_holds and not self.fixed:
            self.v, self.pace = np.zeros(len(self.v)), 0.0
            raise HoldLost("hands", len(self.held), f"at least {self.walker.min_holds} must hold")
        if self.told is None and not self.aborted:
            self._think()
            self._lift()
        command = self._advance()
        if self.swinging is not None:
            self._aim(self.swinging)
        begin = time.perf_counter()
        step = self.stack.controller.step(self.q, self.v)
        cost = time.perf_counter() - begin
        self.v = step.v.copy()
        slip, fixed = self._move(), self.fixed
        self.time += self.dt
        if self.swinging is not None:
            self._land(self.swinging)
        error = dist(self.q[:3], command[:3])
        state = self._hands(), self._holds(), command, error, slip, step.status, cost, fixed
        return Tick(self.time, self.path_time, self.q, self.v, *state)

    def open_hand(self, arm: int) -> None:
        """A hand lets go, to do what it is told (arm mode); the body stands, and the rest is planned anew later."""
        self._say("lift", self.walker.arms[arm].name, self.structure.ids[self.held[arm]])
        self._open(arm)
        self._quick = True
        self._stop()

    def close_hand(self, arm: int, hold: int, roll: int) -> bool:
        """A hand that was told to go to a hold (its row) holds it at one of its rolls.

        Returns:
            Whether its latch closes.
        """
        names, self.told = (self.walker.arms[arm].name, self.structure.ids[hold]), None
        if not self.grasps(*names):
            self._say("failed", *names)
            return False
        self.held[arm] = hold
        self.stack.hold(arm, hold, roll)
        self._stop()
        self._say("land", *names)
        return True

    def _think(self) -> None:
        """Some slices of planning, if there is anything to plan; a plan that is found is taken."""
        if self._changing and self._planning is None and self.pace == 0.0:
            self._give_up()
            if self.swinging is None:
                self._planning = self._replan()
        if self._planning is None:
            return
        try:
            for _ in range(SLICES):
                found = next(self._planning)
                if found is not None:
                    self.take(found)
                    return
        except StopIteration as end:
            self._planning = None
            self.take(end.value)
            self._say("replanned", "", "")
        except NoPlanError:
            if not self._changing:
                # What was begun leads nowhere: from where the body stands there may be another way
                self._stop()
                self._quick = False
            else:
                self._planning = None
                self._say("refused", "", "")
                raise

    def take(self, plan: Plan) -> None:
        """Go on with a plan, or begin one of another path."""
        if plan.path is self.plan.path:
            self._go_on(plan)
        else:
            self._follow(plan)
        self._wanted, self._changing = None, False

    def _replan(self) -> PlanSlices:
        """Plan the rest of the way from where the body stands; a free hand goes to where the plan has it."""
        path, u = self.plan.path, self.path_time
        pose, place = path.at(u)[0], int(u / path.spacing)
        if self._wanted is None:
            rest = path.poses[place + 1 :]
        else:
            between = straight_path([pose, self._wanted.poses[0]], JOINING).poses
            rest = np.concatenate([between, self._wanted.poses])
        way = BodyPath(np.concatenate([pose.homogeneous[None], rest]), path.spacing)
        if self._quick and len(self.held) == len(self.walker.arms):
            names = [arm.name for arm in self.walker.arms]
            start = {names[arm]: self.structure.ids[hold] for arm, hold in self.held.items()}
            postures = {arm.name: self.q[arm.q] for arm in self.walker.arms}
            return plan_from_stance(self.walker, self.structure, way, start, postures=postures)
        return plan_from_here(self.walker, self.structure, way, self.held, self.q, self.chain, self._behind())

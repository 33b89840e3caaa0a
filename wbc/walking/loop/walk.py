"""Carrying out a plan: the loop of controller, hands and robot."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from math import dist
from typing import Any

import numpy as np

from wbc.clearance import Nearest
from wbc.controller import Step
from wbc.robots import Walker
from wbc.simulation import Plant
from wbc.validation import Array
from wbc.walking.body_path import BodyPath
from wbc.walking.holds.structure import Structure
from wbc.walking.loop.body_command import BodyMotion
from wbc.walking.loop.caution import Caution, Course
from wbc.walking.loop.coasting import Coasting
from wbc.walking.loop.foresight import Foresight
from wbc.walking.loop.hands import LATE, ArmLeader, Hands
from wbc.walking.loop.machine import Machine
from wbc.walking.loop.progress import PlanProgress
from wbc.walking.loop.replanner import BodyReplanner
from wbc.walking.loop.stack import DT, WalkStack
from wbc.walking.loop.state import Event, Hand, State, Swinging, Tick, What
from wbc.walking.planner.plan import HoldLost, NoPlanError, Plan, Regrasp
from wbc.walking.planner.replanning import PlanSlices, way_to
from wbc.walking.planner.swings.swings import SETTLE

__all__ = ["Event", "Hand", "Tick", "Walk"]

#: The walk is over when the body is this near to the end of the path [m]
ARRIVED = 0.002
#: A walk that takes this many times its path's duration and SLACK seconds more is given up
PATIENCE, SLACK = 4.0, 20.0
#: Slices of planning between two ticks
SLICES = 3
#: A swing is looked at so long before its hand is lifted [s]
EARLY = 0.3
#: So often a swing is stopped on its way because it is not where it was foreseen
PAUSES = 3
#: So often in a row what was planned may turn out to be too near to something, before the walk is given up
REFUSALS = 3


class Walk:
    """A walk: machine, hands and body follow a plan on one stack; where it does not lead on it is planned anew.

    Args:
        walker, structure: what walks where.
        plan: whole, or in slices (:func:`wbc.walking.planner.replanning.plan_from_stance`): then the walk begins with
            the first plan that is there, and plans on between its ticks.
        collisions, backend: see :class:`WalkStack`. stack: a compiled one, of the same walker.
        grasps: (arm, hold) -> whether the hand's latch closes; default: always.
        state: where it begins; default: on the holds of the plan, all hands closed.
        plant: the robot that moves; default: a :class:`wbc.simulation.KinematicPlant`. Its inputs are the joint rates
            of the controller, see :class:`wbc.walking.loop.machine.Machine`.
        foresees: prove everything clear before it is begun (:class:`Caution`).

    Attributes:
        machine, progress, body, hands, replanner, leader, stack: its parts, each one with a job of its own.
        events: what happened so far.
        halted: the body stands, and no hand is lifted. aborted: no hand moves either.
        opens: row of an arm that was opening at the beginning, and of its hold; None: none was.
        approve: asked before every lift; the body waits at the lift until it says yes. None: nobody is asked.
        limit: path time that the body does not pass, and how many re-grasps of the plan may be lifted; None: all of it.
        step: of the last tick.

    Raises:
        ShapeError: a plan that was read from a file, without its grips, or of another machine; no plant, or one of
            another robot. RangeError: a plant with another period. NoPlanError: slices that find no beginning.
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
        plant: Plant | None = None,
        foresees: bool = True,
    ) -> None:
        self._planning: PlanSlices | None = None
        if not isinstance(plan, Plan):
            self._planning, plan = plan, next(first for first in plan if first is not None)
        self.stack = stack or WalkStack(walker, structure, dt, collisions=collisions, backend=backend)
        self.stack.structure = structure
        self.walker, self.dt = walker, self.stack.dt
        self.machine = machine = Machine(walker, structure, self.dt, plant)
        self.progress = PlanProgress(walker, plan)
        self.leader = ArmLeader(machine, self.progress, self.stack)
        self.replanner = BodyReplanner(machine, self.progress)
        self.body = BodyMotion(self.dt, self.leader.stops)
        self.hands = Hands(machine, self.stack, grasps or (lambda _arm, _hold: True))
        self.events: list[Event] = []
        self.halted = self.aborted = self._changing = False
        self.approve: Callable[[Regrasp], bool] | None = None
        self.limit: tuple[float, int] | None = None
        self.step: Step | None = None
        self.opens = None if state is None else state.opening
        grips, mine = self.progress.grips, self.progress.grip
        if state is None:
            machine.begin(self.leader.first(), {arm: int(grips.hold[grip]) for arm, grip in enumerate(mine)})
        else:
            machine.begin(state.q, state.held, state.time, state.v)
        self.stack.begin(machine.q)
        self.hands.begin([int(grips.roll[grip]) for grip in mine])
        self._caution: Caution | None = None
        self._refusals, self._refused = 0, ""
        self._looked: Regrasp | None = None
        if foresees:
            sight = Foresight(walker, structure)
            self.replanner.sight, sight.left = sight, machine.left
            self._caution = Caution(sight, machine, self.progress, self.leader.stops)
        self._coasting = None
        if state is not None:
            known = None if self._caution is None else self._caution.sight
            self._coasting = Coasting.of(walker, structure, state, self.leader.stops.brake, self.dt, known)
            self.hands.over = {} if self._coasting is None else self._coasting.over

    @property
    def q(self) -> Array:
        """Configuration, the body's pose in the structure."""
        return self.machine.q

    @property
    def v(self) -> Array:
        """The last command [m/s, rad/s]."""
        return self.machine.v

    @property
    def time(self) -> float:
        """[s]."""
        return self.machine.time

    @property
    def structure(self) -> Structure:
        """The holds that are there."""
        return self.machine.structure

    @property
    def held(self) -> dict[int, int]:
        """Row of the arm -> row of the hold."""
        return self.machine.held

    @property
    def swinging(self) -> Swinging | None:
        """The swinging hand."""
        return self.hands.swinging

    @property
    def plan(self) -> Plan:
        """The one that is carried out now; path times count from its beginning."""
        return self.progress.plan

    @property
    def path_time(self) -> float:
        """Of the body on the plan's path [s]."""
        return self.progress.path_time

    @property
    def pace(self) -> float:
        """Of the body, 1 the path's own."""
        return self.body.pace

    @property
    def still(self) -> bool:
        """Neither the body nor a hand is commanded to move."""
        swinging = self.swinging
        if self._coasting is not None and not self._coasting.done:
            return False
        return self.pace == 0.0 and (swinging is None or (swinging.state == "open" and swinging.pace == 0.0))

    @property
    def busy(self) -> bool:
        """It is planning by itself, or brings a hand to where a plan begins."""
        return self._changing or self._planning is not None or (self.swinging is not None and self.swinging.waits)

    @property
    def done(self) -> bool:
        """The body is at the end of the path, and no hand is swinging."""
        ended = self.path_time >= self.plan.path.duration - 1e-9 and self.swinging is None and not self._changing
        if not ended or self.progress.step is not None:
            return False
        return dist(self.q[:3].tolist(), self.plan.path.poses[-1][:3, 3].tolist()) < ARRIVED

    def run(self, on_tick: Callable[[Tick], Any] | None = None) -> str:
        """Ticks until the walk is done or given up.

        Returns:
            "arrived", or "late" when it takes more than four times as long as the path.

        Raises:
            HoldLost, NoPlanError, PlantError: as of :meth:`tick`.
        """
        longest = self.time + PATIENCE * self.plan.path.duration + SLACK
        while not self.done:
            if self.time > longest:
                return "late"
            tick = self.tick()
            if on_tick is not None:
                on_tick(tick)
        return "arrived"

    def tick(self) -> Tick:
        """One control period: hands, body, controller, robot.

        Raises:
            HoldLost: fewer hands hold than the robot needs; all rates are zero, and the robot stays as it is.
            NoPlanError: the walk has to be planned anew, and there is no plan. PlantError: the plant has no valid
                reading.
        """
        machine, hands = self.machine, self.hands
        broken = machine.lost()
        if broken:
            self.vanish([self.structure.ids[hold] for hold in broken])
        if len(machine.held) < self.walker.min_holds and not machine.fixed:
            self.body.pace = 0.0
            machine.rest()
            raise HoldLost("hands", len(machine.held), f"at least {self.walker.min_holds} must hold")
        coasting = self._coasting
        if coasting is not None and coasting.done:
            for arm in coasting.free:
                hands.settle_in_air(arm)
            hands.over = {}
            coasting = self._coasting = None
        if coasting is not None:
            coasting.go(self.stack)
        else:
            if hands.manual is None and not self.aborted:
                self._think()
                self._lift()
                self._foresee()
            self._advance()
        if hands.swinging is not None:
            early = self._due(hands.swinging) - self.path_time
            self.leader.lead(hands.swinging, early, self.body.wanted, self.aborted)
        self.stack.lead(machine.q, machine.v, machine.held, machine.chain.away)
        begin = time.perf_counter()
        step = self.step = self.stack.controller.step(machine.q, machine.v)
        cost = time.perf_counter() - begin
        slip, fixed = machine.move(step.v), machine.fixed
        self.stack.follow(machine.lag)
        if hands.swinging is not None:
            self._land(hands.swinging)
        pose = self.body.pose if coasting is None else coasting.pose
        error = dist(machine.q[:3].tolist(), pose[:3].tolist())
        state = hands.states(), hands.holds(), pose, error, slip, step.status, cost, fixed
        return Tick(machine.time, self.path_time, machine.q, machine.v, machine.rates, *state)

    def vanish(self, ids: Iterable[str]) -> None:
        """Take holds away: free, targeted or held. What of the plan does not need them stays; a hand that held one is
        open at once, and the body stops until there is a plan.

        Raises:
            UnknownNameError: no such hold; nothing is changed.
        """
        structure, progress = self.structure, self.progress
        gone = {structure.index(hold) for hold in ids}
        names = [structure.ids[k] for k in sorted(gone)]
        rest = structure.without(names)
        for name in names:
            self._say("vanished", "", name)
        lost = [arm for arm, hold in self.held.items() if hold in gone]
        stops = bool(lost) or self._planning is not None
        for arm in lost:
            self.hands.open(arm)
        if self.swinging is not None and self.swinging.hold in gone:
            self.hands.drop()
            stops = True
        self._renumber(rest)
        swinging = self.swinging
        first = progress.next + int(swinging is not None and swinging.counted)
        later = [k for k, step in enumerate(self.plan.regrasps) if k >= first and step.target in names]
        if stops or (swinging is not None and not swinging.counted):
            self._stop()
        elif later and not self._changing:
            self._planning = self.replanner.without(later[0])

    def go(self, goal: BodyPath) -> None:
        """Go somewhere else: the body stops, goes straight to where another path begins, and on along it.

        Args:
            goal: a path of its own.

        Raises:
            ShapeError: it is none; nothing is changed.
        """
        self.replanner.go(goal)
        self._stop()

    def set_down(self) -> None:
        """The body stops where it is, and a hand in the air goes to a hold that it can keep there."""
        self.replanner.stand()
        self.hands.drop()
        self._stop()

    def abort(self) -> None:
        """Stop: the body and the hand in the air slow down along their paths; nothing is lifted, nothing planned."""
        self.aborted = True
        if self.swinging is not None and self.swinging.state == "opening":
            self.swinging.pace = 0.0

    def carry_on(self) -> None:
        """Go on after an abort."""
        self.aborted = False

    def stopping(self) -> tuple[float, float]:
        """How far the body's origin and the hand in the air can travel after an abort now [m].

        What :mod:`wbc.walking.loop.stopping` says of the places and paces that they have now.
        """
        path, u, stops = self.plan.path, self.path_time, self.leader.stops
        off = float(np.linalg.norm(self.q[:3] - path.at(u)[0].translation))
        body = float(stops.of_body(path.poses[:, :3, 3], path.spacing, np.array(u), self.pace, off))
        swinging = self.swinging
        if swinging is None:
            return body, 0.0
        law, pace = swinging.law, swinging.pace if swinging.state == "open" else 0.0
        gap = float(np.linalg.norm(swinging.aim.position - self.machine.chain.origins[swinging.arm]))
        return body, float(stops.of_hand(law.places, law.spacing, np.array(swinging.clock), pace, gap))

    def take(self, plan: Plan) -> None:
        """Go on with a plan, or begin one of another path."""
        self.progress.take(plan, self.swinging)
        self.replanner.taken()
        self._changing = False

    def go_over(self, plan: Plan, begins: float, since: int) -> None:
        """Take a plan over another path, see :meth:`PlanProgress.go_over`."""
        self.progress.go_over(plan, begins, since, self.swinging)

    def open_hand(self, arm: int) -> None:
        """A hand lets go, to be moved by itself (arm mode); the body stands, and the rest is planned anew later."""
        self._say("lift", self.walker.arms[arm].name, self.structure.ids[self.held[arm]])
        self.hands.open(arm)
        self.replanner.from_stance(True)
        self._stop()

    def close_hand(self, arm: int, hold: int, roll: int) -> bool:
        """A hand that was moved by itself to a hold (its row) takes it at one of its rolls; whether it closes."""
        names, self.hands.manual = (self.walker.arms[arm].name, self.structure.ids[hold]), None
        if not self.hands.close(arm, hold, roll):
            self._say("failed", *names)
            return False
        self._stop()
        self._say("land", *names)
        return True

    def _think(self) -> None:
        """Some slices of planning, if there is anything to plan; a plan that is found is taken."""
        if self._changing and self._planning is None and self.pace == 0.0:
            self._give_up()
            if self.swinging is None:
                if self._refusals > REFUSALS:
                    self._say("refused", "", "")
                    raise NoPlanError("walk", self.structure.name, self._refused)
                self._planning = self.replanner.rest()
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
                # What was begun leads nowhere: from where the body stands there may be another path
                self._stop()
                self.replanner.from_stance(False)
            else:
                self._planning = None
                self._say("refused", "", "")
                raise

    def _give_up(self) -> None:
        """A hand whose hold is out of reach from where the body stopped stays in the air, until there is a plan."""
        swinging = self.swinging
        if swinging is None or not swinging.counted or swinging.state != "open":
            return
        if self.path_time < self._soonest(swinging):
            self.hands.drop()

    def _lift(self) -> None:
        """Send a free hand to its hold, or open that of the next re-grasp when the body is where the plan lifts it."""
        if self.swinging is not None or self._changing:
            return
        free = [arm for arm in range(len(self.walker.arms)) if arm not in self.held]
        if free:
            self._bring(free[0])
            return
        step = self._may_lift()
        if step is None or self.path_time < step.lift - 1e-9:
            return
        if len(self.held) <= self.walker.min_holds:
            raise HoldLost("hands", len(self.held), f"more than {self.walker.min_holds} must hold before one is lifted")
        if self.approve is not None and not self.approve(step):
            return
        arm = self.progress.arm_of(step)
        if self.hands.just_landed(arm):
            return
        swinging = self._next_swing(step)
        if not self._may_swing(swinging, f"{step.arm} from {step.source} to {step.target}"):
            return
        if not self.machine.may_open(arm):
            return  # what drives the walk brings it to rest
        self.progress.lift(arm)
        self.hands.open(arm)
        self.hands.swinging = swinging
        self._say("lift", step.arm, step.source)

    def _foresee(self) -> None:
        """Stop, and plan anew, where what is about to happen has changed and is not clear any more."""
        caution, swinging = self._caution, self.swinging
        if caution is None or (swinging is not None and (swinging.dropped or swinging.state == "closing")):
            return
        stands = self._stands()
        if swinging is None:
            if stands or len(self.held) < len(self.walker.arms):
                return
            lift = self._may_lift()
            leaving = -1 if lift is None else self.progress.arm_of(lift)
            found = caution.ahead(self._until(leaving), None if lift is None else lift.lift)
            if found is not None:
                self._refuse("the body's way", found)
            elif lift is not None:
                self._look_ahead(lift)
        elif swinging.pauses:
            if self.pace == 0.0 and (swinging.state == "opening" or swinging.pace == 0.0):
                swinging.pauses = False
                self._go_on(swinging)
        elif caution.new(swinging, stands, self._before_landing(swinging)):
            self._go_on(swinging)
        elif caution.strays(swinging) and caution.swing(swinging, self._course(swinging)) is not None:
            # At rest it is where it is to be, and can go on from there
            swinging.pauses, swinging.paused = swinging.paused < PAUSES, swinging.paused + 1
            if not swinging.pauses:
                self._go_on(swinging)

    def _look_ahead(self, step: Regrasp) -> None:
        """Prove the next swing before its hand is lifted, where the body could not stop any more before its grip ends:
        an arm that is not lifted then would be pulled straight.
        """
        caution, before = self._caution, step.lift - self.path_time
        if caution is None or self._looked is step or before > EARLY or self.pace == 0.0:
            return
        self._looked = step
        if self._lasts(self.progress.arm_of(step)) - step.lift > 0.5 * self.leader.stops.brake:
            return
        found = self._in_the_way(self._next_swing(step), caution.looked, step.lift)
        if found is not None:
            self._refuse(f"{step.arm} from {step.source} to {step.target}", found)

    def _next_swing(self, step: Regrasp) -> Swinging:
        """The swing of the next re-grasp, as its hand is to open."""
        arm, law = self.progress.arm_of(step), self.plan.laws[self.progress.next]
        grip = self._grip(self.progress.next_grip(arm))
        swinging = self.hands.going(arm, grip, law, latch=self.hands.data.latch_time)
        swinging.wrist = self.leader.wrist(arm)
        return swinging

    def _go_on(self, swinging: Swinging) -> None:
        """A hand goes on to its hold, or not."""
        if not self._may_swing(
            swinging, f"{self.walker.arms[swinging.arm].name} to {self.structure.ids[swinging.hold]}"
        ):
            self.hands.drop()

    def _may_swing(self, swinging: Swinging, what: str) -> bool:
        """Whether a hand may go on to its hold: with the body as it is to move, else while that stands; if it may not,
        it is planned anew.
        """
        caution = self._caution
        if caution is None:
            return True
        found = self._in_the_way(swinging, caution.swing, self.path_time)
        if found is None:
            return True
        self._refuse(what, found)
        return False

    def _in_the_way(
        self, swinging: Swinging, prove: Callable[[Swinging, Course], Nearest | None], begins: float
    ) -> Nearest | None:
        """What is too near to a hand that goes on to its hold from a path time on [s], also where the body stops."""
        course = self._course(swinging)._replace(lifts=begins)
        found = prove(swinging, course)
        stop = begins + 0.5 * self.leader.stops.brake * self.pace**2
        if found is None or course.stands or not swinging.counted or self._soonest(swinging) > stop:
            return found
        swinging.waits = True
        if prove(swinging, course._replace(stands=True)) is None:
            return None
        swinging.waits = False
        return found

    def _refuse(self, what: str, found: Nearest) -> None:
        """The body stops, and the rest is planned from there; given up where that has led nowhere before."""
        self._refusals += 1
        self._refused = f"{what}: {found}"
        here = None if self._caution is None or self.pace else self._caution.here()
        if here is not None:
            # No plan leads out of where it stands
            raise NoPlanError("walk", self.structure.name, f"where it stands two bodies are too near: {here}")
        self.replanner.from_stance(False)
        self._stop()

    def _course(self, swinging: Swinging) -> Course:
        """How body and hand are about to go on."""
        before, holds, last = self._before_landing(swinging), self._until(swinging.arm), self._end()
        due, stands = self._due(swinging), self._stands() or swinging.waits
        return Course(self.pace, before, holds, last, due, stands, self.body.corners(self.plan.path).pace)

    def _before_landing(self, swinging: Swinging) -> float:
        """Path time that the body does not pass before the swinging hand holds [s]."""
        end = self._until(swinging.arm)
        # A hand that is late makes the body late too: the next ones then swing where they were planned to
        return min(end, self._late()) if swinging.counted and not self._changing else end

    def _late(self) -> float:
        """Path time that the body does not pass before the swinging hand holds [s]: where the body has to wait for it,
        that at which it lands.
        """
        step = self.plan.regrasps[self.progress.next]
        return step.land + (0.0 if step.delay else LATE)

    def _end(self) -> float:
        """Path time that the body does not pass [s]."""
        plan = self.plan
        end = plan.path.duration if plan.complete else plan.reached
        return end if self.limit is None else min(end, self.limit[0])

    def _until(self, leaving: int) -> float:
        """Path time to which the body may go with the hands that hold, but that of an arm that is to leave [s]."""
        return min([self._end(), *(self._lasts(arm) for arm in self.held if arm != leaving)])

    def _lasts(self, arm: int) -> float:
        """Path time at which the grip of a hand ends [s]."""
        return self.progress.grips.ends_at(self.plan.path.spacing)[self.progress.grip[arm]]

    def _bring(self, arm: int) -> None:
        """A hand that is in the air goes to where the plan begins, while the body stands still."""
        machine = self.machine
        _, _, _, a, b, c = machine.q[self.walker.arms[arm].q].tolist()
        law = way_to(self.walker, self.structure, self.plan, arm, machine.chain, machine.q, machine.held)
        more: dict[str, Any] = {"counted": False, "waits": True, "state": "open", "first_wrist": (a, b, c)}
        grip = self._grip(self.progress.grip[arm])
        swinging = self.hands.going(arm, grip, law, latch=0.0, wrist=(a, b, c), **more)
        if self._may_swing(swinging, f"{self.walker.arms[arm].name} to {self.structure.ids[swinging.hold]}"):
            self.hands.swinging = swinging

    def _grip(self, grip: int) -> tuple[int, int, int]:
        """A grip's number, the row of its hold and the number of its roll."""
        grips = self.progress.grips
        return grip, int(grips.hold[grip]), int(grips.roll[grip])

    def _may_lift(self) -> Regrasp | None:
        """The next re-grasp, if its hand may be lifted when the body is there."""
        if self._changing or self.halted or self.swinging is not None:
            return None
        if self.limit is not None and self.progress.next >= self.limit[1]:
            return None
        return self.progress.step

    def _advance(self) -> None:
        """Move the body's command on: as fast as asked, as slow as the grips of the holding hands need."""
        progress, swinging = self.progress, self.swinging
        path, u, step = self.plan.path, self.path_time, self.progress.step
        lifted = self._may_lift()
        leaving = -1 if lifted is None else progress.arm_of(lifted)
        end = self._end()
        if swinging is None:
            if self.approve is not None and step is not None:
                end = min(end, step.lift)
            if self._caution is not None:
                end = min(end, max(self._caution.until, u))
        margin, landing = max(min(end, self._until(leaving)) - u, 0.0), None
        if swinging is not None:
            needed = swinging.latch
            if swinging.state != "closing":
                needed = (swinging.law.duration - swinging.clock) / swinging.most + self.hands.data.latch_time + SETTLE
            landing = max(self._before_landing(swinging) - u, 0.0), needed
        most = self.body.corners(path).pace(u)
        self.body.choose(margin, max(end - u, 0.0), landing, self._stands(), most)
        aim, progress.path_time = self.body.go(path, u)
        self.stack.body(aim)

    def _stands(self) -> bool:
        """The body is to stop, or not to move on."""
        if self.halted or self.aborted:
            return True
        return self._changing or (self.swinging is not None and (self.swinging.waits or self.swinging.pauses))

    def _soonest(self, swinging: Swinging) -> float:
        """Path time from which on the hold of a swinging hand is in reach [s]."""
        return float(self.progress.grips.first[swinging.grip]) * self.plan.path.spacing

    def _due(self, swinging: Swinging) -> float:
        """Path time at which a hand is to be on its hold [s]: the plan's; as soon as possible where the body stops."""
        soonest = self._soonest(swinging)
        if self._changing or self.halted or not swinging.counted:
            return soonest
        due = self.plan.regrasps[self.progress.next].land - self.hands.data.latch_time - SETTLE
        return due if self.limit is None else max(min(due, self.limit[0]), soonest)

    def _land(self, swinging: Swinging) -> None:
        """Close the swinging hand; when the latch is through it holds, or it has missed and tries again."""
        if not self.hands.settle(swinging):
            return
        names = self.walker.arms[swinging.arm].name, self.structure.ids[swinging.hold]
        if self.hands.close(swinging.arm, swinging.hold, int(self.progress.grips.roll[swinging.grip])):
            self.hands.swinging, self._refusals = None, 0
            self.progress.land(swinging)
            self._say("land", *names)
            return
        enough = self.hands.missed(swinging)
        self._say("failed", *names)
        if enough:
            self.vanish([names[1]])

    def _stop(self) -> None:
        """The body stops, and the rest is planned from there."""
        self._planning, self._changing = None, True

    def _renumber(self, rest: Structure) -> None:
        """Go on with a structure that has lost holds: rows of holds change, hands stay where they are."""
        old, there = self.structure, set(rest.ids)
        rows = np.array([rest.index(name) if name in there else -1 for name in old.ids], dtype=np.int64)
        self.stack.structure = rest
        self.machine.renumber(rest, rows)
        if self._caution is not None:
            self._caution.sight.structure = rest
        if self.swinging is not None:
            self.swinging.hold = int(rows[self.swinging.hold])
        self.progress.renumber(rows, self.swinging)

    def _say(self, what: What, arm: str, hold: str) -> None:
        self.events.append(Event(self.time, what, arm, hold, self.path_time))

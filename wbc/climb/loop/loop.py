"""The loop: a contact plan, carried out on one stack by a state machine a limb."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from math import inf, sqrt
from typing import Any

import numpy as np

from wbc import validation
from wbc.climb.loop.ahead import StateAhead
from wbc.climb.loop.limb import LimbMachine, LoopParts
from wbc.climb.loop.limb_state import CLOSED, Cause, LimbState
from wbc.climb.loop.options import PERIODS, LoopOptions
from wbc.climb.loop.records import WRENCH, ClimbRecorder
from wbc.climb.loop.reference import PlanReference
from wbc.climb.loop.stack import climb_stack
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.scene import ClimbScene, Foothold
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.controller import core_of
from wbc.controller.handle import InputGroup
from wbc.errors import RangeError, WbcError
from wbc.log import Log
from wbc.multibody import pin
from wbc.simulation import CommandKind, GrippingPlant, Plant, PlantError
from wbc.simulation.connection import Connection
from wbc.validation import Array

#: A planner: from a scene as it is now, and where the robot stands
Replan = Callable[[ClimbScene, Stance], ContactPlan]
#: What comes after a plan that is done: from the scene and where the robot stands; None: nothing
Onward = Callable[[ClimbScene, Stance], ContactPlan | None]
#: Time in which the plan comes to a stop, or goes on again, where a limb is late [s]
STOPPING = 0.2
#: How far the body may be from the plan, by torques, before that slows down: from half of this on [m]
LAG = 8e-3
#: Least rate at which a plan goes on for a body that is off it [1]
SLOWEST = 0.1
#: Rates with which a robot is at rest [m/s, rad/s]
STILL = 5e-3
#: Gain of all that follows the plan by velocities, and of closed contacts, times the period
FOLLOWING = 0.2
#: States before a lift
STANDING = (LimbState.HELD, LimbState.UNLOADING, LimbState.FREE)
#: Changes of one limb's state within a tick, at most
CHANGES = len(LimbState)


class ClimbOutcome(StrEnum):
    """How a run ended."""

    ARRIVED = "arrived"
    STOPPED = "stopped"
    PLANT_FAILED = "plant failed"
    OUT_OF_TIME = "out of time"


@dataclass(frozen=True, eq=False)
class ClimbRun:
    """What a loop has done.

    Attributes:
        outcome: how it ended. reason: why, where it did not arrive.
        log: of the start and of every tick, its contacts rows of the footholds of ``scene``.
        scene: of the first plan, with the footholds that came later after its own.
        plans: carried out one after another; the last one may be unfinished.
        changes: (time [s], limb, state, cause) of every change of a limb's state.
    """

    outcome: ClimbOutcome
    reason: str
    log: Log
    scene: ClimbScene
    plans: tuple[ContactPlan, ...]
    changes: tuple[tuple[float, str, LimbState, Cause], ...]


class ClimbLoop:
    """Carries out a plan: closed limbs are hard rows, body, joints and limbs in the air follow q(t).

        loop = ClimbLoop(plan)                    # or plant=..., which takes velocities, or torques
        run = loop.run()
        run.outcome, run.reason

    A plan waits for a limb that is late: its time slows down to a stop within 0.2 s. :meth:`see` tells what the scene
    is by now; where that concerns what is left of the plan, the robot comes to rest and ``replan`` is asked for another
    one from the stance that it is in. Until it has answered nothing moves.

    Args:
        plan: what is carried out, from its first configuration. plant: default: the kinematic one.
        replan: the planner; None: where one is needed the run ends, and says so. onward: what comes after a plan that
            is done; None: nothing does. options: see there.
        backend: as of ``Stack.compile``.

    Raises:
        ShapeError, RangeError: a plan that is none, or a plant that does not fit.
    """

    def __init__(
        self,
        plan: ContactPlan,
        plant: Plant | None = None,
        *,
        replan: Replan | None = None,
        onward: Onward | None = None,
        options: LoopOptions | None = None,
        backend: str = "auto",
    ) -> None:
        _check_plan(plan)
        options, self._replan, self._onward = options or LoopOptions(), replan, onward
        kinds = (CommandKind.VELOCITY,) if plant is None else tuple(plant.commands)
        self._torques = CommandKind.VELOCITY not in kinds and CommandKind.TORQUE in kinds
        kind = CommandKind.TORQUE if self._torques else CommandKind.VELOCITY
        self.dt = options.period or PERIODS[kind]
        self._connection = Connection(plant, plan.climber.robot, self.dt, kind)
        stack = climb_stack(plan.climber, plan.scene.gravity, self.dt, kind)
        command: Any = str(kind)
        self.robot, self.controller = stack.robot, stack.compile(command=command, backend=backend)
        grips = plant if isinstance(plant, GrippingPlant) else None
        parts = LoopParts(self.robot, stack, self.controller, options, grips, self._torques, self.dt)
        self._limbs = [LimbMachine(limb, parts) for limb in plan.climber.limbs]
        self._set_gains(options)
        fields = ("target", "feedforward", *(["acceleration"] * self._torques))
        self._follow = InputGroup(core_of(self.controller), [("reference", field, None) for field in fields])
        self._planned = self.robot.model.createData()
        self._changes: list[tuple[float, str, LimbState, Cause]] = []
        self._plans: list[ContactPlan] = []
        self._footholds: dict[str, Foothold] = {}
        self._recorder = ClimbRecorder(plan, self._torques, self.dt)
        self._outcome: ClimbOutcome | None = None
        self._reason, self._scene = "", plan.scene
        self._needs, self._turns, self._waiting, self._due = "", "", False, -inf
        self._failed: set[str] = set()
        self._path_time, self._rate = 0.0, 1.0
        self._q, self._last_rate = np.array(plan.q[0], dtype=float), np.zeros(self.robot.nv)
        self._ahead = StateAhead(self.robot, options.delay, self.dt)
        self._state = self._connection.reset(np.array(plan.q[0], dtype=float))
        self.controller.reset(self._state.q)
        self._begin(plan)
        for limb, foothold in zip(self._limbs, plan.start, strict=True):
            off = limb.stand(foothold, self._state.q, self.time) if foothold != FREE_LIMB else ""
            if off:
                raise RangeError("plan.q", plan.q[0], off)
        self._look()
        # Where it stands before the first tick, in which limbs may lift
        motion = self._state.q, self._state.v, np.zeros(self.robot.nv)
        none = np.zeros(len(WRENCH) * len(self._limbs)) if self._torques else None
        self._recorder.add((self.time, 0.0), motion, self._logged(), self._states, True, none)

    # ------------------------------------------------------------------ what users do

    def run(self, most: float | None = None, before_tick: Callable[[ClimbLoop], None] | None = None) -> ClimbRun:
        """Tick until the plan is done, or something ends it.

        Args:
            most: time on the plant's clock [s]; None: until the end. before_tick: is called with the loop before every
                tick, and may tell it what has changed.
        """
        try:
            with self._connection:
                while self._outcome is None and (most is None or self._state.time < most):
                    if before_tick is not None:
                        before_tick(self)
                    self.tick()
        except PlantError as error:
            self._end(ClimbOutcome.PLANT_FAILED, str(error))
        if self._outcome is None:
            self._end(ClimbOutcome.OUT_OF_TIME, f"{most:g} s were given")
        return self.result()

    def result(self) -> ClimbRun:
        """What was done so far; a run that has not ended is out of time."""
        outcome = self._outcome or ClimbOutcome.OUT_OF_TIME
        scene = self._plans[0].scene
        if len(self._footholds) > len(scene.footholds):
            scene = replace(scene, footholds=list(self._footholds.values()))
        return ClimbRun(outcome, self._reason, self._recorder.log(), scene, tuple(self._plans), tuple(self._changes))

    def see(self, scene: ClimbScene) -> None:
        """What the scene is from now on: footholds may have gone or come, and bodies appeared.

        Raises:
            RangeError: a scene with another gravity.
        """
        if not np.array_equal(scene.gravity, self._scene.gravity):
            raise RangeError("scene.gravity", scene.gravity, "the stack was compiled for another one")
        scene = self._able(scene)
        self._scene = scene
        plan, left = self._plans[-1], {foothold.id for foothold in scene.footholds}
        gone = {k for k, foothold in enumerate(plan.scene.footholds) if foothold.id not in left}
        for limb in self._limbs:
            missing = limb.missing(gone)
            if limb.state in CLOSED and limb.held in gone:
                self._change(limb, Cause.HOLD_LOST)
            self._needs = self._needs or missing
        before = plan.scene.bodies
        if set(scene.bodies) != set(before) or any(scene.bodies[k] is not before[k] for k in before):
            self._needs = self._needs or "the bodies of the scene are others"
        self._due = -inf

    def redirect(self, reason: str) -> None:
        """The rest of the plan is not wanted any more: limbs in the air land, the robot comes to rest, and the planner
        is asked.

        Args:
            reason: in words, for a run that ends there.
        """
        self._turns, self._due = validation.name("reason", reason), -inf

    def fail(self, limb: str) -> None:
        """A limb holds no more, now and for the rest of the run; its joints still move. What is left of the plan is not
        carried out: the robot comes to rest, and the planner is asked for a way on the other limbs.

        Raises:
            UnknownNameError: no such limb.
        """
        names = [one.name for one in self._limbs]
        machine = self._limbs[names.index(validation.one_of("limb", limb, names))]
        self._failed.add(limb)
        if machine.state in CLOSED:
            self._change(machine, Cause.LIMB_FAILED)
        self._scene = self._able(self._scene)
        self._needs, self._due = self._needs or f"{limb} holds no more", -inf

    def _able(self, scene: ClimbScene) -> ClimbScene:
        """A scene as limbs that have not failed may hold it."""
        names = [limb.name for limb in self._limbs]
        return scene.held_by([name for name in names if name not in self._failed]) if self._failed else scene

    @property
    def scene(self) -> ClimbScene:
        """As :meth:`see` has it, for limbs that have not failed."""
        return self._scene

    @property
    def ended(self) -> bool:
        """Whether the run is over."""
        return self._outcome is not None

    @property
    def time(self) -> float:
        """On the plant's clock [s]."""
        return float(self._state.time)

    @property
    def states(self) -> list[LimbState]:
        """Of the limbs."""
        return [limb.state for limb in self._limbs]

    @property
    def stance(self) -> Stance:
        """Where the robot is, and on which footholds of the scene as :meth:`see` has it."""
        rows = {foothold.id: k for k, foothold in enumerate(self._scene.footholds)}
        own = self._plans[-1].scene.footholds
        held = tuple(rows[own[k].id] if k != FREE_LIMB else FREE_LIMB for k in self._held)
        return Stance(held, np.array(self._state.q))

    # ------------------------------------------------------------------ a tick

    def tick(self) -> None:
        """One period.

        Raises:
            PlantError: the plant has no valid reading.
        """
        dt = self.dt
        if self._turns and all(limb.state in STANDING for limb in self._limbs):
            self._needs, self._turns = self._needs or self._turns, ""
        aimed = 0.0 if self._needs or self._waiting else self._followed()
        if self._rate != aimed:
            self._rate += min(max(aimed - self._rate, -dt / STOPPING), dt / STOPPING)
        if self._needs and self._rate <= 0.0 and np.abs(self._state.v).max() < STILL:
            self._plan_anew()
            return
        ahead = self._path_time + self._rate * dt
        if ahead >= self._due:
            ahead = self._advance_limbs(ahead)
            if self._outcome is not None:
                return
        q_next = self._reference.q(ahead)
        self._write(q_next)
        self._path_time, state = ahead, self._state
        if self._torques:
            step = self.controller.step(*self._ahead.met(state.q, state.v))
            command, wrenches = step.torque, self._wrenches(step.forces)
            self._ahead.decided(step.a)
        else:
            step = self.controller.step(state.q)
            command, wrenches = step.v, None
        state = self._state = self._connection.drive(command)
        motion = state.q, state.v, command
        self._recorder.add((state.time, ahead), motion, self._logged(), self._states, step.status == "solved", wrenches)
        if ahead >= self._reference.end and all(limb.coming is None for limb in self._limbs):
            self._go_on()

    def _followed(self) -> float:
        """At which rate the plan goes on for a body that is off it [1]: motors at their limits catch up meanwhile."""
        if not self._torques:
            return 1.0
        x, y, z = (self._state.q[:3] - self._q[:3]).tolist()
        return min(max(1.5 - sqrt(x * x + y * y + z * z) / LAG, SLOWEST), 1.0)

    def _write(self, q_next: Array) -> None:
        """The reference of this tick, and of the limbs in the air."""
        model = self.robot.model
        rate = pin.difference(model, self._q, q_next) / self.dt
        parts = [self._q, rate]
        if self._torques:
            parts.append((rate - self._last_rate) / self.dt)
            self._last_rate = rate
        self._follow.write(np.concatenate(parts))
        self._q = q_next
        if self._aloft:
            pin.forwardKinematics(model, self._planned, q_next)
            for limb in self._aloft:
                limb.follow(self._planned)

    def _wrenches(self, forces: Any) -> Array:
        """Of closed contacts, in the axes of their footholds ``[6 limbs]``."""
        out = np.zeros((len(self._limbs), len(WRENCH)))
        for row, limb in enumerate(self._limbs):
            if limb.state in CLOSED:
                force = forces[f"{limb.name} contact"]
                out[row, : len(force)] = force
        return out.ravel()

    # ------------------------------------------------------------------ limbs

    def _advance_limbs(self, ahead: float) -> float:
        """Each limb's state, as far as it changes at this tick; the time to which the plan goes on."""
        q, now = self._state.q, self.time
        # No lift comes before the limbs that bear the robot then have landed, nor before its limb is unloaded
        for limb in self._limbs:
            move = limb.coming
            if move is not None and move.lift < ahead and limb.state in STANDING:
                if self._turns or self._needs:
                    # Nothing lifts any more on a plan that is given up
                    ahead = max(min(ahead, move.lift), self._path_time)
                    continue
                ready = limb.state is LimbState.FREE or limb.unloaded(now)
                if not (ready and self._borne(limb, move)):
                    ahead = max(min(ahead, move.lift), self._path_time)
        self._waiting = False
        for limb in self._limbs:
            for _ in range(CHANGES):
                move = limb.coming
                cause = limb.cause(ahead, self._path_time, q, now, move is None or self._borne(limb, move))
                if cause is None:
                    break
                self._change(limb, cause)
                if cause is Cause.SETTLED:
                    # It bears for a tick at least, also where it is to lift again at once
                    break
            if limb.wait(self._path_time):
                self._waiting = True
                late = "" if self._needs else limb.too_late(q)
                if late:
                    self._end(ClimbOutcome.STOPPED, late)
        self._due = min(limb.due for limb in self._limbs)
        return ahead

    def _borne(self, lifted: LimbMachine, move: ContactMove) -> bool:
        """Whether all other limbs that are to have landed when this one lifts have."""
        return all(limb is lifted or limb.landed(move.lift) for limb in self._limbs)

    def _change(self, limb: LimbMachine, cause: Cause) -> None:
        state = limb.change(cause, self._state.q, self._q, self.time)
        self._changes.append((self.time, limb.name, state, cause))
        self._look()

    def _look(self) -> None:
        """What every tick needs of the limbs' states."""
        self._held = [limb.held for limb in self._limbs]
        self._states = [int(limb.state) for limb in self._limbs]
        self._aloft = [limb for limb in self._limbs if limb.state not in CLOSED]

    # ------------------------------------------------------------------ plans

    def _begin(self, plan: ContactPlan) -> None:
        """A plan, from where the robot is."""
        self._plans.append(plan)
        for foothold in plan.scene.footholds:
            self._footholds.setdefault(foothold.id, foothold)
        rows = {name: row for row, name in enumerate(self._footholds)}
        self._log_rows = [rows[foothold.id] for foothold in plan.scene.footholds]
        reference = self._reference = PlanReference(plan, self.robot)
        ordered = sorted(plan.moves, key=lambda move: move.lift)
        for row, limb in enumerate(self._limbs):
            limb.begin([move for move in ordered if move.limb == row], plan, reference, plan.start[row])
        self._needs, self._turns, self._waiting, self._due = "", "", False, -inf
        self._path_time, self._rate = 0.0, 1.0
        self._q, self._last_rate = np.array(plan.q[0], dtype=float), np.zeros(self.robot.nv)
        self._look()

    def _logged(self) -> list[int]:
        """Contacts as the log has them: rows of the footholds of all plans, those of the first plan first."""
        return [self._log_rows[row] if row >= 0 else row for row in self._held]

    def _go_on(self) -> None:
        """A plan is done: what comes after it, if anything does."""
        after = None
        if self._onward is not None:
            try:
                after = self._onward(self._scene, self.stance)
                if after is not None:
                    _check_plan(after)
            except WbcError as error:
                self._end(ClimbOutcome.STOPPED, f"nothing comes after the plan; {error}")
                return
        if after is None:
            self._end(ClimbOutcome.ARRIVED, "")
        else:
            self._begin(after)

    def _plan_anew(self) -> None:
        """The robot is at rest, and what is left of the plan cannot be done."""
        if self._replan is None:
            self._end(ClimbOutcome.STOPPED, f"{self._needs}, and no planner was given")
            return
        stance = self.stance
        try:
            plan = self._replan(self._scene, stance)
            _check_plan(plan)
            if tuple(plan.start) != stance.contacts:
                raise RangeError("plan.start", plan.start, f"expected the stance's contacts {stance.contacts}")
        except WbcError as error:
            self._end(ClimbOutcome.STOPPED, f"{self._needs}; {error}")
            return
        for limb in self._limbs:
            if limb.state not in (LimbState.HELD, LimbState.FREE):
                self._change(limb, Cause.NEW_PLAN)
        self._begin(plan)

    def _set_gains(self, options: LoopOptions) -> None:
        names = [limb.name for limb in self._limbs]
        items: Any = self.controller
        for name in ("reference", *(f"{name} swing" for name in names)):
            if self._torques:
                items[name].set(stiffness=options.bandwidth**2, damping=2.0 * options.bandwidth)
            else:
                items[name].gain = FOLLOWING / self.dt
        for name in names:
            items[f"{name} contact"].gain = options.bandwidth if self._torques else FOLLOWING / self.dt

    def _end(self, outcome: ClimbOutcome, reason: str) -> None:
        self._outcome, self._reason = outcome, reason


def _check_plan(plan: ContactPlan) -> None:
    """A plan has moves of its limbs, in time, and knots that are numbers."""
    validation.instance("plan", plan, ContactPlan, "a ContactPlan")
    robot, count = plan.climber.robot, len(plan.climber.limbs)
    times = validation.real_array("plan.times", plan.times)
    validation.real_array("plan.q", plan.q, (len(times), robot.nq))
    validation.real_array("plan.v", plan.v, (len(times), robot.nv))
    if len(plan.start) != count:
        raise RangeError("plan.start", plan.start, f"expected a foothold for each of {count} limbs")
    for k, move in enumerate(plan.moves):
        if not 0 <= move.limb < count or not -1 <= move.lands < len(plan.scene.footholds):
            raise RangeError(f"plan.moves[{k}]", move, "no such limb or foothold")
        if not 0.0 <= move.lift < move.land <= times[-1] + 1e-9:
            raise RangeError(f"plan.moves[{k}]", move, f"expected 0 <= lift < land <= {times[-1]:g} s")

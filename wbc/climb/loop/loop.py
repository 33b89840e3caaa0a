"""The loop: a contact plan, carried out on one stack by a state machine a limb."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from math import inf, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from wbc import validation
from wbc.climb.bearing import check_borne
from wbc.climb.limb_work import plan_limb_work
from wbc.climb.loop.ahead import StateAhead
from wbc.climb.loop.hand_over import HandOvers
from wbc.climb.loop.limb import UNLOAD, WAITS, LimbMachine
from wbc.climb.loop.limb_state import CLOSED, Cause, LimbState
from wbc.climb.loop.motor_watch import FeltPlant, MotorWatch
from wbc.climb.loop.pace import PlanPace
from wbc.climb.loop.records import WRENCH, ClimbRecorder
from wbc.climb.loop.reference import PlanReference
from wbc.climb.loop.stack import climb_stack
from wbc.climb.plan import ContactMove, ContactPlan
from wbc.climb.scene import ClimbScene, Foothold
from wbc.climb.stance import FREE_LIMB, Stance
from wbc.controller import Step, core_of
from wbc.controller.handle import InputGroup
from wbc.errors import RangeError, WbcError
from wbc.log import Log
from wbc.multibody import pin
from wbc.simulation import CommandKind, GrippingPlant, Plant, PlantError, PlantState
from wbc.simulation.connection import Connection
from wbc.validation import Array

#: A planner: from a scene as it is now, and where the robot stands
Replan = Callable[[ClimbScene, Stance], ContactPlan]
#: What comes after a plan that is done: from the scene and where the robot stands; None: nothing
Onward = Callable[[ClimbScene, Stance], ContactPlan | None]
#: Whether a limb may lift: "" for yes, the id of another foothold that it is to go to, None for not yet
Approve = Callable[[ContactMove], str | None]
#: A plan of one limb, by name, to footholds, by id, from where the robot stands
Placed = Callable[[ClimbScene, Stance, str, list[str]], ContactPlan]
#: Periods of loops of velocities and of torques [s]
PERIODS = {CommandKind.VELOCITY: 0.01, CommandKind.TORQUE: 0.002}
#: How far the body may be from the plan, by torques, before that slows down: from half of this on [m]
LAG = 8e-3
#: Least rate at which a plan goes on for a body that is off it [1]
SLOWEST = 0.1
#: Rate of a plan, by how far the body is off it, above which a robot is at the plan's end [1]: within :data:`LAG`
ARRIVED = 0.5
#: Rates with which a robot is at rest [m/s, rad/s]
STILL = 5e-3
#: Gain of all that follows the plan by velocities, and of closed contacts, times the period
FOLLOWING = 0.2
#: omega of a = a_ref + 2 omega (v_ref - v) + omega^2 (q_ref - q), by torques [1/s]
BANDWIDTH = 30.0
#: How far a grip may go from where it closed before it counts as slipping [m]
SLIPS = 1e-3
#: Singular value of closed limbs' rows, of metres and radians, below which they leave the body free
FIXES = 1e-4
#: Torques and wrenches that cannot do what they are to for so long end a run [s]
OVERLOAD = 0.1
#: Time in which a robot comes to rest of which something has failed, at most [s]
RESTING = 2.0
#: How far from the present plan another one may begin that goes on from it [m, rad]
CONTINUES = 1e-6
#: How far from where the robot is the next plan may begin [m, rad]: limbs under torques close beside their footholds
BEGINS = 0.05
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
        noted: (time [s], in words) of what was found wrong with the plant.
    """

    outcome: ClimbOutcome
    reason: str
    log: Log
    scene: ClimbScene
    plans: tuple[ContactPlan, ...]
    changes: tuple[tuple[float, str, LimbState, Cause], ...]
    noted: tuple[tuple[float, str], ...] = ()


class ClimbLoop:
    """Carries out a plan: closed limbs are hard rows, body, joints and limbs in the air follow q(t).

        loop = ClimbLoop(plan)                    # or plant=..., which takes velocities, or torques
        run = loop.run()
        run.outcome, run.reason

    A plan waits for a limb that is late: its time slows down to a stop within 0.2 s. :meth:`see` tells what the scene
    is by now; where that concerns what is left of the plan, the robot comes to rest and ``replan`` is asked for another
    one from the stance that it is in. Until it has answered nothing moves. By :meth:`stop` it rests on
    its plan until :meth:`carry_on`.

    Where a grip that the plant reports as lost was, there is no foothold any more. A grip that slips, a motor that
    gives less than it is commanded (:class:`MotorWatch`), and torques that give way for 0.1 s bring the robot to rest,
    and the run ends with their names.

    Args:
        plan: what is carried out, from its first configuration. plant: default: the kinematic one.
        replan: the planner; None: where one is needed the run ends, and says so. onward: what comes after a plan that
            is done; None: nothing does.
        period: of a tick [s]; None: 0.01 for velocities, 0.002 for torques. delay: of the torques, which the loop
            knows [s]. log: whether ticks are logged; without, the log has the start alone.
        backend: as of ``Stack.compile``.

    Attributes:
        approve: asked with a move before its limb lifts, every tick until it answers; None: nobody is asked.
        place: what plans a move to a foothold that ``approve`` names instead; ``replan`` plans the rest.
        step: of the controller, of the last tick; None: there was none.
        waiting: the move that waits for an answer. refused: why a foothold that was named is not taken; "" if it is.
        stopped: why :meth:`stop` was called; "" where the run goes on.
        reference, path_time: motion of the plan that is carried out now, and where on it the robot is [s].

    Raises:
        ShapeError, RangeError: a plan that is none, or that motors and contacts do not bear at rest under torques; a
            plant that does not fit; a period or delay that is none.
    """

    def __init__(
        self,
        plan: ContactPlan,
        plant: Plant | None = None,
        *,
        replan: Replan | None = None,
        onward: Onward | None = None,
        period: float | None = None,
        delay: float = 0.0,
        log: bool = True,
        backend: str = "auto",
    ) -> None:
        self._replan, self._onward = replan, onward
        kinds = (CommandKind.VELOCITY,) if plant is None else tuple(plant.commands)
        self._torques = CommandKind.VELOCITY not in kinds and CommandKind.TORQUE in kinds
        kind = CommandKind.TORQUE if self._torques else CommandKind.VELOCITY
        self.dt = PERIODS[kind] if period is None else period
        self._check(plan)
        self._connection = Connection(plant, plan.climber.robot, self.dt, kind)
        stack = climb_stack(plan.climber, plan.scene.gravity, self.dt, kind)
        command: Any = str(kind)
        self.robot, self.controller = stack.robot, stack.compile(command=command, backend=backend)
        self._grips: GrippingPlant | None = plant if isinstance(plant, GrippingPlant) else None
        given = stack, self.controller, self._grips, self._torques
        self._limbs = [LimbMachine(limb, *given) for limb in plan.climber.limbs]
        self._set_gains()
        fields = ("target", "feedforward", *(["acceleration"] * self._torques))
        self._follow = InputGroup(core_of(self.controller), [("reference", field, None) for field in fields])
        self._planned, self._seen = self.robot.model.createData(), self.robot.model.createData()
        self._changes: list[tuple[float, str, LimbState, Cause]] = []
        self._plans: list[ContactPlan] = []
        self._footholds: dict[str, Foothold] = {}
        self._recorder, self._logs = ClimbRecorder(plan, self._torques, self.dt), validation.flag("log", log)
        self.step: Step | None = None
        self._outcome: ClimbOutcome | None = None
        self._reason, self._scene, self._in_sight = "", plan.scene, plan.scene
        self._failed: set[str] = set()
        self.approve: Approve | None = None
        self.place: Placed = partial(plan_limb_work, plan.climber)
        self.refused, self.stopped = "", ""
        self._pace = PlanPace(self.robot, self.dt, hard=not self._torques)
        self._noted: list[tuple[float, str]] = []
        self._broken, self._ends_by, self._given_way = "", inf, 0
        self._ahead = StateAhead(self.robot, delay, self.dt)
        self._state = self._connection.reset(np.array(plan.q[0], dtype=float))
        self._felt: FeltPlant | None = plant if self._torques and isinstance(plant, FeltPlant) else None
        self._motors = MotorWatch(self.robot, self.dt, delay)
        self._motors.begin(self._state.q, self._state.v)
        self.controller.reset(self._state.q)
        self._begin(plan)
        for limb, foothold in zip(self._limbs, plan.start, strict=True):
            off = limb.stand(foothold, self._state.q, self.time) if foothold != FREE_LIMB else ""
            if off:
                raise RangeError("plan.q", plan.q[0], off)
        # Where it stands before the first tick, in which limbs may lift
        motion = self._state.q, self._state.v, np.zeros(self.robot.nv)
        none = np.zeros(len(WRENCH) * len(self._limbs)) if self._torques else None
        self._row = self._logged()
        self._recorder.add((self.time, 0.0), motion, *self._row, True, none)

    def _begin(self, plan: ContactPlan, goes_on: bool = False) -> None:
        """A plan, from where the robot is, which is as fast as the plan at once where it goes on from another one."""
        self._plans.append(plan)
        for foothold in plan.scene.footholds:
            self._footholds.setdefault(foothold.id, foothold)
        rows = {name: row for row, name in enumerate(self._footholds)}
        self._log_rows = [rows[foothold.id] for foothold in plan.scene.footholds]
        reference = self.reference = PlanReference(plan, self.robot)
        ordered = sorted(plan.moves, key=lambda move: move.lift)
        self._hand_overs = HandOvers(ordered, reference, UNLOAD if self._torques else 0.0)
        for row, limb in enumerate(self._limbs):
            limb.begin([move for move in ordered if move.limb == row], plan, reference, plan.start[row])
        self._needs, self._turns, self._late, self._due = "", "", False, -inf
        self.waiting: ContactMove | None = None
        self._granted: set[int] = set()
        self._other, self._aside, self.path_time = "", False, 0.0
        self._pace.begin(reference, 1.0 if goes_on else _rate_along(plan.v[0], self._state.v))
        self._q, self._last_rate, self._row = np.array(plan.q[0], dtype=float), np.zeros(self.robot.nv), self._logged()

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
                    if self._outcome is None:
                        self.tick()
        except PlantError as error:
            self._end(ClimbOutcome.PLANT_FAILED, str(error))
        if self._outcome is None:
            self._end(ClimbOutcome.OUT_OF_TIME, f"{most:g} s were given")
        return self.result()

    def end(self, reason: str) -> None:
        """The run is over, as stopped; what it has done stays.

        Args:
            reason: in words.
        """
        self._end(ClimbOutcome.STOPPED, validation.name("reason", reason))

    def result(self) -> ClimbRun:
        """What was done so far; a run that has not ended is out of time."""
        outcome = self._outcome or ClimbOutcome.OUT_OF_TIME
        scene = self._plans[0].scene
        if len(self._footholds) > len(scene.footholds):
            scene = replace(scene, footholds=list(self._footholds.values()))
        return ClimbRun(outcome, self._reason, self._recorder.log(), scene, tuple(self._plans), tuple(self._changes),
                        tuple(self._noted))  # fmt: skip

    def recorded(self, file: Path) -> AbstractContextManager[None]:
        """Within it the log is written to a file as it comes, so that a run that is killed leaves what it did.

        Raises:
            LogFileError: it cannot be written.
        """
        return self._recorder.written(file)

    def see(self, scene: ClimbScene) -> None:
        """What the scene is from now on: footholds may have gone or come, and bodies appeared.

        Raises:
            RangeError: a scene with another gravity, or a foothold that is elsewhere than it was.
        """
        if not np.array_equal(scene.gravity, self._scene.gravity):
            raise RangeError("scene.gravity", scene.gravity, "the stack was compiled for another one")
        for foothold in scene.footholds:
            known = self._footholds.get(foothold.id, foothold).pose
            if known is not foothold.pose and known != foothold.pose:
                place = foothold.pose.translation.tolist()
                raise RangeError(f"scene.footholds, {foothold.id}", place, "it was elsewhere; give it another id there")
        before, there = ({foothold.id for foothold in some.footholds} for some in (self._in_sight, scene))
        for row, name in enumerate(self._footholds):
            if (name in before) != (name in there):
                self._recorder.seen(row, self.time, name in there)
        self._in_sight, scene = scene, self._able(scene)
        self._scene = scene
        plan, left = self._plans[-1], {foothold.id for foothold in scene.footholds}
        gone = {k for k, foothold in enumerate(plan.scene.footholds) if foothold.id not in left}
        for limb in self._limbs:
            missing = limb.missing(gone)
            if limb.state in CLOSED and limb.held in gone:
                self._change(limb, Cause.HOLD_LOST)
            self._needs = self._needs or missing
        bodies = plan.scene.bodies
        if set(scene.bodies) != set(bodies) or any(scene.bodies[k] is not bodies[k] for k in bodies):
            self._needs = self._needs or "the bodies of the scene are others"
        self._due = -inf

    def redirect(self, reason: str, at_once: bool = False) -> None:
        """The rest of the plan is not wanted any more: limbs in the air land, the robot comes to rest, and the planner
        is asked.

        Args:
            reason: in words, for a run that ends there. at_once: limbs do not land before that.
        """
        self._turns = validation.name("reason", reason)
        if at_once:
            self._needs = self._needs or self._turns
        self._grant_unavoidable()

    def go_over(self, plan: ContactPlan) -> None:
        """Another plan from this instant on, which begins where and as fast as the present one is; limbs in the air
        stay there, and its moves of them begin at 0.

        Raises:
            ShapeError, RangeError: a plan that is none, or that does not begin so; or the loop is not :attr:`steady`.
        """
        if not self.steady:
            raise RangeError("plan", self._pace.rate, "expected a loop that goes on by velocities at its full rate")
        self._check(plan, Stance(self.held, self._q), CONTINUES)
        self._begin(plan, goes_on=True)

    def stop(self, reason: str) -> None:
        """The robot comes to rest along its plan and stays there until :meth:`carry_on`; limbs in the air rest where
        they are, and none is lifted, unless its lift is so near that joints cannot stop before it.

        Args:
            reason: in words.
        """
        self.stopped = validation.name("reason", reason)
        self._grant_unavoidable()

    def carry_on(self) -> None:
        """Go on after :meth:`stop`."""
        self.stopped, self._due = "", -inf

    def fail(self, limb: str) -> None:
        """A limb holds no more, now and for the rest of the run; its joints still move. What is left of the plan is not
        carried out: the robot comes to rest, and the planner is asked for a way on the other limbs.

        Raises:
            UnknownNameError: no such limb.
        """
        names = [one.name for one in self._limbs]
        machine = self._limbs[names.index(validation.one_of("limb", limb, names))]
        self._failed.add(limb)
        machine.missing({move.lands for move in machine.moves})
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
    def still(self) -> bool:
        """Whether the robot is at rest."""
        return self._pace.rate <= 0.0 and bool(np.abs(self._state.v).max() < STILL)

    @property
    def steady(self) -> bool:
        """Whether its plan goes on at its full rate, by velocities, and nothing keeps it from that."""
        kept = self._needs or self._turns or self.stopped or self._other or self._late or self._torques
        return not kept and self._pace.rate == 1.0 and self._outcome is None

    @property
    def plan(self) -> ContactPlan:
        """What is carried out now; limbs and footholds of moves are rows of its climber and scene."""
        return self._plans[-1]

    @property
    def held(self) -> tuple[int, ...]:
        """Of each limb the row of the foothold in the plan's scene that it holds, or ``FREE_LIMB``."""
        return tuple(limb.held for limb in self._limbs)

    @property
    def coming(self) -> tuple[ContactMove, ...]:
        """Of each limb the move that is under way or comes next, by time of lift: their footholds are reserved."""
        moves = [limb.coming for limb in self._limbs]
        return tuple(sorted((move for move in moves if move is not None), key=lambda move: move.lift))

    @property
    def ended(self) -> bool:
        """Whether the run is over."""
        return self._outcome is not None

    @property
    def time(self) -> float:
        """On the plant's clock [s]."""
        return float(self._state.time)

    @property
    def velocity(self) -> Array:
        """As the plant reports it ``(nv)`` [m/s, rad/s]."""
        return np.array(self._state.v)

    @property
    def states(self) -> list[LimbState]:
        """Of the limbs."""
        return [limb.state for limb in self._limbs]

    @property
    def stance(self) -> Stance:
        """Where the robot is, and on which footholds of the scene as :meth:`see` has it."""
        rows = {foothold.id: k for k, foothold in enumerate(self._scene.footholds)}
        own = self._plans[-1].scene.footholds
        held = tuple(rows[own[k].id] if k != FREE_LIMB else FREE_LIMB for k in self.held)
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
        stops = self._needs or self._late or self.stopped or self._other
        aimed = 0.0 if stops else min(self._followed(), self._hand_overs.rate(self.path_time))
        end = self._before_lifts() if self._turns or self.approve or aimed == 0.0 else inf
        rate = self._pace.rate
        if rate != aimed or end < inf:
            rate = self._pace.go(self.path_time, aimed, end)
        rests = rate <= 0.0 and (self._needs or self._other) and not self.stopped and self.still
        if rests or self.time > self._ends_by:
            self._plan_anew()
            return
        ahead = self.path_time + rate * dt
        if ahead >= self._due:
            ahead = self._advance_limbs(ahead)
            if self._outcome is not None:
                return
            if ahead in self._hand_overs.moving:
                # A plan that was held up where it moves goes on from rest
                self._pace.rate = min(rate, (ahead - self.path_time) / dt)
        q_next = self.reference.q(ahead)
        self._write(q_next)
        self.path_time, state = ahead, self._state
        if self._torques:
            step = self.controller.step(*self._ahead.met(state.q, state.v))
            command, wrenches = step.torque, self._wrenches(step.forces)
            self._ahead.decided(step.a)
        else:
            step = self.controller.step(state.q)
            command, wrenches = step.v, None
        state = self._state = self._connection.drive(command)
        motion = state.q, state.v, command
        self.step = step
        if self._logs:
            self._recorder.add((state.time, ahead), motion, *self._row, step.status == "solved", wrenches)
        if self._grips is not None:
            self._heed(state, command)
        if self._torques:
            self._given_way = 0 if step.status == "solved" else self._given_way + 1
            if self._given_way * dt > OVERLOAD and not self._broken:
                self._break(_gave_way(step))
        if ahead >= self.reference.end and not self._broken and all(limb.coming is None for limb in self._limbs):
            # Motors at their limits, or a load that nobody knows, may have kept the body from where the plan ends
            if self._followed() > ARRIVED:
                self._go_on()
            elif ahead > self.reference.end + WAITS:
                away = float(np.linalg.norm(state.q[:3] - self._q[:3]))
                self._end(ClimbOutcome.STOPPED, f"the body is {1e3 * away:.1f} mm off the end of the plan")

    def _heed(self, state: PlantState, command: Array) -> None:
        """What the plant has lost, and what of it fails."""
        assert self._grips is not None
        for frame in self._grips.lost():
            limb = next(limb for limb in self._limbs if limb.frame == frame)
            foothold = limb.torn()
            self._noted.append((state.time, f"the foothold {foothold.id} of {limb.name} broke off"))
            self.see(self._scene.without(foothold.id))
            if not self._kept_still(state.q):
                self._break(f"{self._noted.pop()[1]}, and what is left does not keep the body")
                self._ends_by = self.time
        if self._broken or self._felt is None or not self._motors.sends(command):
            return
        for dof in self._motors.see(state.q, state.v, self._felt.contact_torques):
            share = max(float(self._motors.share[dof]), 0.0)
            joint = self.robot.dof_names[dof]
            gets = f"{joint} gets {share:.0%} of the torque asked of it"
            self._break(f"{gets}: its motor is limp, or bears a load that nobody knows")
        pin.forwardKinematics(self.robot.model, self._seen, state.q)
        for limb in self._limbs:
            slipped = limb.slipped(self._seen)
            if slipped > SLIPS:
                self._break(f"{limb.name} has slipped by {1e3 * slipped:.1f} mm on its foothold")

    def _kept_still(self, q: Array) -> bool:
        """Whether closed limbs fix the body while no joint moves."""
        pin.computeJointJacobians(self.robot.model, self._seen, q)
        rows = [limb.fixing(self._seen)[:, :6] for limb in self._limbs if limb.state in CLOSED]
        return bool(rows) and int(np.linalg.matrix_rank(np.vstack(rows), FIXES)) == 6

    def _break(self, text: str) -> None:
        """Something of the plant has failed: the robot comes to rest, and the run ends."""
        self._noted.append((self.time, text))
        if not self._broken:
            self._broken, self._needs, self._ends_by = text, text, self.time + RESTING

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
        pin.forwardKinematics(model, self._planned, self._q, rate)
        for limb in self._limbs:
            limb.follow(self._planned)
        self._q = q_next

    def _wrenches(self, forces: Any) -> Array:
        """Of closed contacts, in the axes of their footholds ``[6 limbs]``."""
        out = np.zeros((len(self._limbs), len(WRENCH)))
        for row, limb in enumerate(self._limbs):
            if limb.state in CLOSED:
                out[row] = forces[f"{limb.name} contact"] @ limb.item.borne
        return out.ravel()

    # ------------------------------------------------------------------ limbs

    def _advance_limbs(self, ahead: float) -> float:
        """Each limb's state, as far as it changes at this tick; the time to which the plan goes on."""
        q, now = self._state.q, self.time
        # No lift comes before the limbs that bear the robot then have landed, nor before its limb is unloaded
        for limb in self._limbs:
            move = limb.coming
            if move is not None and move.lift < ahead and limb.state in STANDING:
                ready = limb.state is LimbState.FREE or limb.unloaded(now)
                # A plan that is given up comes to rest behind that, as soon as joints can, the limb still held
                if not self._needs and not (ready and self._may_lift(move) and self._borne(limb, move)):
                    ahead = max(min(ahead, move.lift), self.path_time)
            if move is not None and move.land < ahead and limb.state not in STANDING:
                # What comes after a landing counts on its load, which by torques takes a time, or has its limb lift
                loads = self._torques and limb.state is not LimbState.SWINGING
                again = any(later.lift < ahead for later in limb.moves[1:2])
                if again or (loads and move.land in self._hand_overs.resting):
                    ahead = max(min(ahead, move.land), self.path_time)
        self._late = False
        for limb in self._limbs:
            for _ in range(CHANGES):
                move = limb.coming
                may = move is None or (self._may_lift(move) and self._borne(limb, move))
                cause = limb.cause(ahead, self.path_time, q, now, may)
                if cause is None:
                    break
                self._change(limb, cause)
                if cause is Cause.SETTLED:
                    # It bears for a tick at least, also where it is to lift again at once
                    break
            if limb.wait(self.path_time):
                self._late = True
                late = "" if self._needs else limb.too_late(q)
                if late:
                    self._end(ClimbOutcome.STOPPED, late)
        self._due = min(limb.due for limb in self._limbs)
        return ahead

    def _borne(self, lifted: LimbMachine, move: ContactMove) -> bool:
        """Whether all other limbs that are to have landed when this one lifts have."""
        return all(limb is lifted or limb.landed(move.lift) for limb in self._limbs)

    def _may_lift(self, move: ContactMove) -> bool:
        """Whether nothing keeps a limb that is not in the air from its next move."""
        if self._needs:
            return False
        return id(move) in self._granted or not (self._turns or self.stopped or self._other or self.approve)

    def _before_lifts(self) -> float:
        """Time of the plan of the first lift that may not be made now [s]; whoever has a say is asked."""
        self.waiting = None
        first = inf
        for limb in self._limbs:
            move = limb.coming
            if move is None or limb.state not in STANDING:
                continue
            lift = move.lift
            if self.approve and id(move) not in self._granted and limb.state is not LimbState.UNLOADING:
                lift -= UNLOAD if self._torques else 0.0
                near = not self._pace.stops(self.path_time + 2.0 * self.dt, lift)
                if near and not (self._needs or self._turns or self.stopped or self._other):
                    self._ask(self.approve, move)
            if self._late or not self._may_lift(move):
                first = min(first, lift)
        return first

    def _ask(self, approve: Approve, move: ContactMove) -> None:
        """Whether a limb may lift."""
        answer = approve(move)
        if answer is None:
            self.waiting = self.waiting or move
        elif answer:
            self._other, self._another = answer, move
        else:
            self._granted.add(id(move))
            self._due = -inf

    def _grant_unavoidable(self) -> None:
        """Lifts before which the joints can no more come to rest are made."""
        for limb in self._limbs:
            move = limb.coming
            if move is None or limb.state not in STANDING or self.approve:
                continue
            if move.lift >= self.path_time and not self._pace.stops(self.path_time, move.lift, self._pace.rate):
                self._granted.add(id(move))
        self._due = -inf

    def _change(self, limb: LimbMachine, cause: Cause) -> None:
        state = limb.change(cause, self._state.q, self.time)
        self._changes.append((self.time, limb.name, state, cause))
        self._row = self._logged()

    # ------------------------------------------------------------------ plans

    def _logged(self) -> tuple[list[int], list[int]]:
        """Contacts and aims as the log has them, rows of the footholds of all plans, those of the first plan first; and
        states.
        """
        held, aims = [limb.held for limb in self._limbs], [limb.aim for limb in self._limbs]
        contacts = [self._log_rows[row] if row >= 0 else row for row in (*held, *aims)]
        return contacts, [limb.state for limb in self._limbs]

    def _check(self, plan: ContactPlan, stance: Stance | None = None, within: float = BEGINS) -> None:
        """Refuses a plan that is none, that does not begin in a stance, and under torques one that contacts or motors
        do not bear.
        """
        _check_plan(plan)
        if stance is not None:
            if tuple(plan.start) != stance.contacts:
                raise RangeError("plan.start", plan.start, f"expected the stance's contacts {stance.contacts}")
            off = float(np.abs(pin.difference(self.robot.model, stance.q, np.asarray(plan.q[0], dtype=float))).max())
            if off > within:
                raise RangeError("plan.q", off, f"expected a plan that begins within {within:g} m and rad of the robot")
        if self._torques:
            check_borne(plan)

    def _asked(self, planner: Onward, why: str, ends: bool = False) -> ContactPlan | None:
        """What a planner has from where the robot is. The run ends where that is no plan that begins here; where it is
        none, it has arrived if that may end it.
        """
        stance = self.stance
        try:
            plan = planner(self._scene, stance)
            if plan is None and ends:
                self._end(ClimbOutcome.ARRIVED, "")
                return None
            plan = validation.instance("plan", plan, ContactPlan, "a ContactPlan")
            self._check(plan, stance)
        except WbcError as error:
            self._end(ClimbOutcome.STOPPED, f"{why}; {error}")
            return None
        return plan

    def _go_on(self) -> None:
        """A plan is done: what comes after it, if anything does."""
        if self._aside:
            self._needs = "another foothold was chosen"
            self._plan_anew()
        elif self._onward is None:
            self._end(ClimbOutcome.ARRIVED, "")
        elif (after := self._asked(self._onward, "nothing comes after the plan", ends=True)) is not None:
            self._begin(after)

    def _plan_anew(self) -> None:
        """The robot is at rest, and what is left of the plan cannot be done."""
        if self._broken:
            self._end(ClimbOutcome.PLANT_FAILED, f"{self._broken}, seen at {self._noted[-1][0]:.2f} s")
        elif self._other and not self._needs:
            self._go_aside(self._another, self._other)
        elif self._replan is None:
            self._end(ClimbOutcome.STOPPED, f"{self._needs}, and no planner was given")
        elif (plan := self._asked(self._replan, self._needs)) is not None:
            self._begin_anew(plan)

    def _go_aside(self, move: ContactMove, foothold: str) -> None:
        """A limb goes to another foothold than its plan has, where it can; if not, the plan goes on waiting."""
        self._other, self.refused, stance = "", "", self.stance
        try:
            plan = self.place(self._scene, stance, self._limbs[move.limb].name, [foothold])
            self._check(plan, stance)
        except WbcError as error:
            self.refused = str(error)
            return
        self._begin_anew(plan)
        self._aside = True
        self._granted.update(id(move) for move in plan.moves)

    def _begin_anew(self, plan: ContactPlan) -> None:
        """A plan, from where the robot is at rest."""
        for limb in self._limbs:
            if limb.state not in (LimbState.HELD, LimbState.FREE):
                self._change(limb, Cause.NEW_PLAN)
        self._begin(plan)

    def _set_gains(self) -> None:
        items: Any = self.controller
        gain = BANDWIDTH if self._torques else FOLLOWING / self.dt
        following = {"stiffness": gain**2, "damping": 2.0 * gain} if self._torques else {"gain": gain}
        items["reference"].set(**following)
        for limb in self._limbs:
            items[f"{limb.name} swing"].set(**following)
            items[f"{limb.name} contact"].gain = gain

    def _end(self, outcome: ClimbOutcome, reason: str) -> None:
        self._outcome, self._reason = outcome, reason


def _gave_way(step: Step) -> str:
    """What has given way for long in a tick: limits of joints alone are no lack of torques or contacts."""
    most: dict[str, float] = {}
    for slack in step.relaxed:
        most[slack.row if slack.item == "limits" else ""] = slack.amount
    if not most or "" in most:
        return f"motors and contacts have given way for {OVERLOAD:g} s"
    joint = max(most, key=lambda row: most[row])
    return (
        f"{joint} has been beyond its limits for {OVERLOAD:g} s: its motor is limp, or bears a load that nobody knows"
    )


def _rate_along(planned: Array, v: Array) -> float:
    """The rate of a plan at which a robot begins it, r = v . v_p / v_p . v_p within 0 and 1; 1 of a plan at rest."""
    if float(np.abs(planned).max()) <= STILL:
        return 1.0
    return min(max(float(v @ planned) / float(planned @ planned), 0.0), 1.0)


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

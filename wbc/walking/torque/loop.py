"""A walk's rates, followed by torques on a robot with masses."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wbc import validation
from wbc.errors import ShapeError, UnknownNameError
from wbc.multibody import pin
from wbc.simulation import Command, CommandKind, Encoders, GripKind, Plant, PlantState
from wbc.validation import Array
from wbc.walking.torque.bearing import Bearing
from wbc.walking.torque.faults import Fault
from wbc.walking.torque.motor_watch import MotorWatch
from wbc.walking.torque.readings import JointFilter
from wbc.walking.torque.stack import STEADY, UNKNOWN, TorqueStack
from wbc.walking.torque.tested import Tested
from wbc.walking.torque.watch import Watch

#: A closed hand that is farther from its hold slips; the walk ends where it is farther off than the hands are in the
#: mean, which is what the walk does not take for the body's [m]
SLIPS, LOST = 3e-4, 1e-3
#: Part of joints' rate limits that is used: what acts and is not known moves them a little faster
RATE = 1.0 - 1e-4
#: A hand that closes at rest is slower [m/s], [rad/s]
MEETS = 0.002, np.radians(0.5)
#: Torques that do not do what they are to for so long end the walk [s]
OVERLOAD = 0.05


@dataclass(frozen=True)
class Gains:
    """Of the loop.

    Attributes:
        bandwidth: omega of  a = dv_ref/dt + 2 omega (v_ref - v) + omega^2 (q_ref - q)  [1/s].
        leak: how fast q_ref comes to q, so that it does not wander where closed chains let nothing move [1/s].
        grip: how fast the drift of closed hands decays [1/s].
        friction: most that is added to a motor's torque against what acts on its joint and is not known [N m].
    """

    bandwidth: float = 40.0
    leak: float = 2.0
    grip: float = 20.0
    friction: float = 8.0


def turns(held: Mapping[str, GripKind]) -> str:
    """Why these hands do not keep the body from turning, in words; "": they do."""
    if len(held) >= STEADY or any(kind is not GripKind.POSITION for kind in held.values()):
        return ""
    return f"{len(held)} hands that may tilt on their holds do not keep the body from turning, {STEADY} do"


class TorqueLoop:
    """A plant that takes the velocities of a walk, and drives one that takes torques.

        walker = wbc.robots.with_masses(wbc.robots.walker())
        loop = TorqueLoop(TorqueStack(walker, [GripKind.AXIS]), PinocchioPlant(walker.robot))
        Walk(walker, structure, plan, plant=loop)

    Within a period of the walk the reference goes from the last velocity to the new one in a straight line; q_ref is
    its integral. Every millisecond the stack finds torques for dv_ref/dt + 2 omega (v_ref - v) + omega^2 (q_ref - q),
    and for what the closed hands bear. Torques that take hold late are found for the state that they will meet: what is
    read, and the accelerations that were decided since. Nothing of the walk, its planner or its stack is changed.

    What acts and is not known is the residual r of the robot's momentum (a disturbance observer). Of a joint, such as
    friction, -r is added to the stack's torques, within :attr:`Gains.friction` and what the motors have. Of the body,
    such as a payload, it is an external wrench to the stack, whose accelerations are then those that come about.

    A hand opens as late as torques take hold: those on their way were found for a hand that is closed. The reference
    then begins anew where the robot is, as what was strained between closed hands would spring.

    A motor that gives less than it is commanded (:class:`MotorWatch`, with the wrenches that the hands measure) is
    found, and the stack does without it; so is a hand that slips on its hold. :meth:`failing` says which: what drives
    the walk then brings it to rest. So it does where holds and motors would not bear the robot (:class:`Bearing`).

    Args:
        stack: compiled. plant: takes torques, and grasps. gains: of the reference.
        delay: of the torques, which the loop knows [s]. encoders: their noise, which the loop knows; None: none.
        faults: that come in time.

    Attributes:
        watch: what was seen of the plant. bearing: what holds and motors bear. about: plain data for a log, which say
            what it is.

    Raises:
        ShapeError: a plant that takes no torques, or grasps nothing.
    """

    commands: Collection[CommandKind] = (CommandKind.VELOCITY,)

    def __init__(
        self,
        stack: TorqueStack,
        plant: Plant,
        gains: Gains | None = None,
        *,
        delay: float = 0.0,
        encoders: Encoders | None = None,
        faults: Sequence[Fault] = (),
        about: Mapping[str, Any] | None = None,
    ) -> None:
        if CommandKind.TORQUE not in plant.commands:
            raise ShapeError("plant", type(plant).__name__, "expected a plant that takes torques")
        if not isinstance(plant, Tested):
            raise ShapeError("plant", type(plant).__name__, "expected a plant that can grasp, and fail")
        self.stack, self.plant, self._tested = stack, plant, plant
        self.nq, self.nv = plant.nq, plant.nv
        self.time_step = stack.controller.stack.dt
        items: Any = stack.controller
        arms = stack.walker.arms
        self._model, self._reference, self._body = stack.walker.robot.model, items["reference"], items[UNKNOWN]
        self._items = {(arm.hand, kind): items[f"{arm.hand} {kind}"] for arm in arms for kind in stack.kinds}
        self._gains, self._faults = gains or Gains(), tuple(fault for fault in faults if fault.kind != "delay")
        self._command = Command(CommandKind.TORQUE, np.zeros(self.nv))
        ahead = round(validation.scalar("delay", delay, low=0.0, unit="s") / self.time_step)
        # Hands that are to open: after so many ticks
        self._opening: dict[str, int] = {}
        # Accelerations on their way, the oldest first, and how long each lasts until the next torque takes hold
        self._decided = np.zeros((ahead, self.nv))
        self._lasts = (np.arange(ahead, 0, -1) - 0.5) * self.time_step**2
        self.about = dict(about or {"name": type(plant).__name__})
        self.watch = Watch(self._model, stack.rating, [arm.hand for arm in arms])
        self._effort = np.array(stack.walker.robot.limits.effort)
        self._effort[: stack.walker.robot.base_nv] = 0.0
        encoders, self.bearing = encoders or Encoders(), Bearing(stack)
        self._motors = MotorWatch(self._model, self._effort, self.time_step, encoders.velocity)
        self._data = self._model.createData()
        base = stack.walker.robot.base_nv
        self._filter = None if encoders.exact else JointFilter(self._model, base, encoders, self.time_step)
        self._state = plant.read()
        # Torques on their way, the oldest first, and that which takes hold next at the end; the stack's, and what was
        # added to them
        self._sent, self._added = np.zeros((2, ahead + 1, self.nv))

    def reset(self, q: Array, time: float) -> None:
        """At rest, nothing grasped."""
        self.plant.reset(q, time)
        self._look()
        gains, controller = self._gains, self.stack.controller
        controller.reset(q)
        controller["torques"].torque = self._effort[self.stack.walker.robot.base_nv :]
        controller["limits"].velocity_scale = RATE
        self._motors.begin(q, np.zeros(self.nv))
        self._sent[:] = self._added[:] = 0.0
        self._left = self._effort
        # Hands that slip, and whether the walk ends of it
        self._slipping: dict[str, bool] = {}
        self._failing, self._overloaded = "", 0
        self._opening.clear()
        self._reference.set(stiffness=gains.bandwidth**2, damping=2.0 * gains.bandwidth)
        for item in self._items.values():
            item.enabled, item.gain = False, gains.grip
        self._closed: dict[str, GripKind] = {}
        # What came before is seen in the state; a motor that died is still dead
        self._coming = [fault for fault in self._faults if fault.kind == "limp" or fault.time >= time]
        self._decided[:] = 0.0
        self._q = np.array(q)
        self._v, self._next = np.zeros((2, self.nv))

    def move(self, v: Array) -> None:
        """See :class:`wbc.simulation.MovingPlant`."""
        state = self._state
        self._tested.reset(state.q, state.time, v)
        self._look()
        self._motors.begin(state.q, v)
        self._v, self._next = np.array(v), np.array(v)

    def read(self) -> PlantState:
        """The plant's; of noisy encoders what the filter makes of it."""
        return self._state

    def apply(self, command: Command) -> None:
        """Take velocities, for the next period."""
        self._next = validation.real_array("command.values", command.values, (self.nv,))

    def grasp(self, frame: str, pose: pin.SE3, kind: GripKind) -> None:
        """The plant's hand closes, and the stack counts on it."""
        kind = GripKind(validation.one_of("kind", str(kind), [str(k) for k in self.stack.kinds]))
        if self._opening.pop(frame, None) is not None:
            self._tested.release(frame)
        self._meets(frame)
        self._tested.grasp(frame, pose, kind)
        self._look(struck=True)
        state = self._state
        self._motors.struck(state.q, state.v)
        item = self._items[frame, kind]
        item.target, item.enabled = pose, True
        self._closed[frame] = kind
        self.watch.grasps(self._tested, frame)

    def _meets(self, frame: str) -> None:
        """Say so where a hand is not at rest as it closes; it may roll."""
        state, model, data = self._state, self._model, self._data
        pin.forwardKinematics(model, data, state.q, state.v)
        twist = pin.getFrameVelocity(model, data, model.getFrameId(frame), pin.LOCAL).vector
        speed, rate = float(np.sqrt(twist[:3] @ twist[:3])), float(np.sqrt(twist[3:5] @ twist[3:5]))
        if speed > MEETS[0] or rate > MEETS[1]:
            self._note(state.time, f"{frame} closed with {1e3 * speed:.2g} mm/s and {rate:.2g} rad/s")

    def release(self, frame: str) -> None:
        """The stack does without the hand, and the plant's opens when the first such torques take hold."""
        if frame not in self._closed:
            raise UnknownNameError("frame", frame, self._closed)
        self._opening[frame] = len(self._decided)
        self._slipping.pop(frame, None)
        self._let_go(frame)
        self._q = self._ahead(self._state)[0]

    def holds_without(self, frame: str) -> bool:
        """Whether holds and motors bear the robot, at rest where it is, when this closed hand opens; if they do not,
        :meth:`failing` says what is lacking.
        """
        state = self._state
        held = {hand: kind for hand, kind in self._closed.items() if hand != frame}
        short = self.bearing.lacking(state.q, held)
        why = self.bearing.words(short, held) if short else turns(held)
        if why:
            self._note(state.time, why, ends=True)
        return not why

    def lost(self) -> tuple[str, ...]:
        """Hands whose holds have broken off; the stack has done without them since."""
        lost = self._tested.lost()
        for frame in lost:
            why = turns(self._closed)
            self._note(self._state.time, f"the hold of {frame} broke off{f'; {why}' if why else ''}", ends=bool(why))
        return lost

    def failing(self) -> str:
        """The first motor that was found limp, or hand that has slipped too far, in words; "": none."""
        return self._failing

    def advance(self, dt: float) -> None:
        """A period of the walk: as many of torques as go into it."""
        count = max(round(dt / self.time_step), 1)
        ramp, step = (self._next - self._v) / count, self.time_step
        plant, reference, command, controller = self.plant, self._reference, self._command, self.stack.controller
        for _ in range(count):
            state = self._state
            if self._coming:
                self._fail(state.time)
            q, v = self._ahead(state)
            reference.target, reference.feedforward, reference.acceleration = self._q, self._v, ramp / step
            if self._motors.limp:
                self._idle(q, v, ramp / step)
            self._body.wrench = self._unknown(state.q)
            self.step = controller.step(q, v)
            command.values[:] = self._compensated(self.step.torque)
            plant.apply(command)
            self._open()
            plant.advance(step)
            self._look(self._decided[0] if len(self._decided) else self.step.a)
            self._sent[:-1], self._added[:-1] = self._sent[1:], self._added[1:]
            self._sent[-1], self._added[-1] = self.step.torque, command.values - self.step.torque
            wrenches = self._tested.wrenches
            self._find(wrenches)
            self.watch.see(wrenches, self.step.status)
            self._q = pin.integrate(self._model, self._q, (self._v + 0.5 * ramp) * step)
            self._v = self._v + ramp
            if len(self._decided):
                self._decided[:-1] = self._decided[1:]
                self._decided[-1] = self.step.a
            self._overloaded = 0 if self.step.status == "solved" else self._overloaded + 1
        off = pin.difference(self._model, self._q, self._state.q)
        self._q = pin.integrate(self._model, self._q, min(self._gains.leak * dt, 1.0) * off)
        self._feel()
        self._bear()
        self.watch.period(self._tested)

    def _compensated(self, torque: Array) -> Array:
        """Torques with what goes against the residual of the momentum ``[nv]``; none on a base."""
        most = self._gains.friction
        against = np.maximum(np.minimum(self._motors.residual, most), -most)
        return np.maximum(np.minimum(torque - against, self._left), -self._left)

    def _unknown(self, q: Array) -> Array:
        """What acts on the body beside what is known, along the axes of the world ``[6]`` [N, N m]."""
        turn, residual = pin.XYZQUATToSE3(q[:7]).rotation, self._motors.residual
        return np.concatenate([turn @ residual[:3], turn @ residual[3:6]])

    def _idle(self, q: Array, v: Array, a: Array) -> None:
        """Joints whose motors are limp do what they do: others would be moved for them else."""
        limp, robot = self._motors.limp, self.stack.walker.robot
        target, rate, a = self._q.copy(), self._v.copy(), a.copy()
        places = robot.position_index[limp].astype(int)
        target[places], rate[limp], a[limp] = q[places], v[limp], self.step.a[limp]
        self._reference.target, self._reference.feedforward, self._reference.acceleration = target, rate, a

    def _open(self) -> None:
        """Hands whose time to open has come."""
        for frame, ticks in list(self._opening.items()):
            if ticks:
                self._opening[frame] = ticks - 1
            else:
                del self._opening[frame]
                self._tested.release(frame)

    def _look(self, decided: Array | None = None, struck: bool = False) -> None:
        """Take what is read; ``decided``: the accelerations of the tick that is over; None: there was none."""
        state, known = self.plant.read(), self._filter
        if known is not None:
            state = (
                known.struck(state) if struck else known.begin(state) if decided is None else known.see(state, decided)
            )
        self._state = state

    def _bear(self) -> None:
        """Torques that have given way for long, with what is lacking to stand."""
        if self._overloaded * self.time_step < OVERLOAD or self._failing:
            return
        state = self._state
        short = self.bearing.lacking(state.q, self._closed)
        text = f"motors and holds have given way for {1e3 * OVERLOAD:.0f} ms"
        self._note(state.time, f"{text}; {self.bearing.words(short, self._closed)}" if short else text, ends=True)

    def _find(self, wrenches: Mapping[str, Array]) -> None:
        """Motors that have gone limp."""
        state, model, data = self._state, self._model, self._data
        pin.computeJointJacobians(model, data, state.q)
        contacts = np.zeros(self.nv)
        for name, wrench in wrenches.items():
            contacts += pin.getFrameJacobian(model, data, model.getFrameId(name), pin.LOCAL).T @ wrench
        for dof in self._motors.see(state.q, state.v, self._sent[0], self._added[0], contacts):
            robot, share = self.stack.walker.robot, float(self._motors.share[dof])
            self._effort_left()
            text = f"the motor of {robot.dof_names[dof]} is limp: it gives {share:.0%} of its torque"
            self._note(state.time, text, ends=True)

    def _effort_left(self) -> None:
        """The stack asks nothing of motors that are limp."""
        left = self._left = self._effort.copy()
        left[self._motors.limp] = 0.0
        self.stack.controller["torques"].torque = left[self.stack.walker.robot.base_nv :]

    def _feel(self) -> None:
        """Hands that slip on their holds."""
        state, model, data = self._state, self._model, self._data
        if not self._closed:
            return
        pin.framesForwardKinematics(model, data, state.q)
        places = [(data.oMf[model.getFrameId(frame)].translation, self._items[frame, kind].target.translation)
                  for frame, kind in self._closed.items()]  # fmt: skip
        gaps = np.array([at - target for at, target in places]).reshape(-1, 3)
        for frame, gap, own in zip(self._closed, gaps, gaps - gaps.mean(axis=0), strict=True):
            off = float(np.sqrt(gap @ gap))
            if off > SLIPS and frame not in self._slipping:
                self._slipping[frame] = False
                self._note(state.time, f"{frame} slips on its hold")
            if off > SLIPS and np.sqrt(own @ own) > LOST and not self._slipping[frame]:
                self._slipping[frame] = True
                self._note(state.time, f"{frame} has slipped by {1e3 * off:.1f} mm on its hold", ends=True)

    def _note(self, time: float, text: str, ends: bool = False) -> None:
        self.watch.noted.append((time, text))
        if ends and not self._failing:
            self._failing = f"{text}, seen at {time:.2f} s"

    def _ahead(self, state: PlantState) -> tuple[Array, Array]:
        """Where the torque of this tick will find the robot."""
        if not len(self._decided):
            return state.q, state.v
        moved = len(self._decided) * self.time_step * state.v + self._lasts @ self._decided
        return pin.integrate(self._model, state.q, moved), state.v + self.time_step * self._decided.sum(axis=0)

    def _fail(self, time: float) -> None:
        """Faults whose time has come."""
        for fault in [fault for fault in self._coming if fault.time <= time]:
            hand = f"{fault.what}_hand"
            if hand in self._opening or not fault.begin(self._tested):
                continue
            self._coming.remove(fault)
            if fault.kind == "break":
                self._let_go(hand)

    def _let_go(self, frame: str) -> None:
        self._items[frame, self._closed.pop(frame)].enabled = False
        self.watch.releases(frame)

"""Stacks that command torques, in open loop, every step judged: limits, torques by Pinocchio alone, certificates."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pinocchio as pin

from tests.soak.episodes import LENGTH, label
from tests.soak.judge import Judge, Outside
from tests.soak.machines import configuration
from tests.soak.stacks import DT
from tests.soak.torque_stacks import followed, provoke, strong, torque_stack
from wbc.api import Controller
from wbc.controller import Status, Step, core_of
from wbc.robot import Robot
from wbc.stack.codegen import row_units
from wbc.tasks import (
    DriveTorqueLimits,
    ExternalWrench,
    JointFriction,
    RollingContact,
    SlidingContact,
    TorqueLimits,
)
from wbc.tasks._contact import Contact
from wbc.tasks.rolling import FLAT
from wbc.tasks.stopping import stopping_deceleration
from wbc.validation import Array

#: What accelerations and wrenches take beyond the torques that are sent, at most, of the largest of them
SENT = 1e-6


class Needed:
    """Torques that accelerations and wrenches take, by Pinocchio's recursion and numpy alone."""

    def __init__(self, controller: Controller) -> None:
        self._controller, robot = controller, controller.stack.robot
        self._model, self._data, self._base = robot.model, robot.model.createData(), robot.base_nv
        self._couplings = robot.couplings
        items = {e.name: e.item for e in controller.stack.entries}
        self._contacts = {name: item for name, item in items.items() if isinstance(item, Contact)}
        self._pushed = [name for name, item in items.items() if isinstance(item, ExternalWrench)]
        self._rubbing = [(name, item.dofs(robot)) for name, item in items.items() if isinstance(item, JointFriction)]
        self._frames = {
            name: self._model.getFrameId(item.frame)
            for name, item in items.items()
            if isinstance(item, (Contact, ExternalWrench))
        }

    def begin(self) -> None:
        """Take the run-time values of an episode."""
        given = self._controller
        self._pushes = [(self._frames[name], given[name].wrench.copy()) for name in self._pushed]
        self._frictions = [(dofs, given[n].viscous, given[n].coulomb, given[n].slow) for n, dofs in self._rubbing]
        self._slides = {
            name: (given[name].target.rotation[:, 2].copy(), float(given[name].friction), float(given[name].slow))
            for name, item in self._contacts.items()
            if isinstance(item, SlidingContact)
        }
        self._grounds = {
            name: given[name].target.rotation[:, 2].copy()
            for name, item in self._contacts.items()
            if isinstance(item, RollingContact)
        }

    def torques(self, step: Step, q: Array, v: Array) -> Array:
        """M a + h - J'w - L; what a floating base lacks comes first."""
        model, data = self._model, self._data
        found = pin.rnea(model, data, q, v, step.a)
        for frame, wrench in self._pushes:
            found -= pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED).T @ wrench
        for dofs, viscous, coulomb, slow in self._frictions:
            found[dofs] += viscous * v[dofs] + coulomb * np.tanh(v[dofs] / slow)
        if self._slides or self._grounds:
            pin.forwardKinematics(model, data, q)
        for name, force in step.forces.items():
            if not force.any():
                continue
            J = pin.computeFrameJacobian(model, data, q, self._frames[name], pin.LOCAL)
            if name in self._grounds:
                wheel, normal = self._contacts[name], self._grounds[name]
                turn = pin.updateFramePlacement(model, data, self._frames[name]).rotation
                axis = turn @ np.array(wheel.axis)
                upright = normal - axis * (axis @ normal)
                upright /= np.sqrt(upright @ upright + FLAT**2)
                forwards = np.cross(axis, upright)
                along = turn.T @ np.column_stack([forwards, np.cross(normal, forwards), normal]) @ force
                arm = turn.T @ (-wheel.radius * upright)
                found -= J[:3].T @ along + J[3:].T @ np.cross(arm, along)
            elif name in self._slides:
                normal, friction, slow = self._slides[name]
                turn = pin.updateFramePlacement(model, data, self._frames[name]).rotation
                speed = turn @ (J[:3] @ v)
                slip = speed - normal * (normal @ speed)
                along = normal - friction * slip / np.sqrt(slip @ slip + slow**2)
                found -= force[0] * (J[:3].T @ (turn.T @ along))
            else:
                found -= J[list(self._contacts[name].axes)].T @ force
        for one in self._couplings:
            found[one.leader] += one.ratio * found[one.follower]
            found[one.follower] = 0.0
        return np.asarray(found)


class TorqueJudge(Judge):
    """The same of torques: their limits hold exactly, they are what accelerations and wrenches need, and what gives way
    has a name.
    """

    def __init__(self, controller: Controller) -> None:
        super().__init__(controller)
        self.needed = Needed(controller)
        # as LONGEST of a tick: rows on forces count in their sizes
        core = core_of(controller)
        rows = row_units(controller.stack, core.layout)
        self.longest = max(1.0, *rows, *core.layout.dof_scales(controller.stack))
        self._robot = controller.stack.robot
        self._motors = controller["motors"]
        entries = controller.stack.entries
        (item,) = (e.item for e in entries if isinstance(e.item, TorqueLimits))
        self._driven = list(item.dofs(self._robot))
        self._slews = item.slew is not None and bool(self._driven)
        self._wrists = [(controller[e.name], e.item) for e in entries if isinstance(e.item, DriveTorqueLimits)]
        self._last: Array | None = None

    def begin(self) -> None:
        """Another episode: nothing is known of the last torques."""
        self._last = None

    def motors(self, step: Step, dt: float) -> str:
        """Torques, how fast they change, and those of drives, are within their limits, whatever became of the tick."""
        most = np.full(self._robot.nv, np.inf)
        most[self._driven] = self._motors.scale * self.limits.effort[self._driven]
        if (np.abs(step.torque) > most * (1 + 1e-15)).any():
            return "beyond a torque limit"
        last, self._last = self._last, step.torque.copy()
        if self._slews and last is not None:
            at, change = self._driven, self._motors.slew * dt
            low, high = (np.clip(last[at] + s * change, -most[at], most[at]) for s in (-1.0, 1.0))
            room = 1e-12 * np.maximum(1.0, np.abs(last[at]))
            if ((step.torque[at] < low - room) | (step.torque[at] > high + room)).any():
                return "torques change too fast"
        for handle, item in self._wrists:
            given = item.transmission.inverse.T @ step.torque[list(item.dofs(self._robot))]
            if (np.abs(given) > handle.scale * handle.torque * (1 + 1e-9) + 1e-12).any():
                return "beyond a limit of a drive"
        return ""

    def torques(self, step: Step, q: Array, before: Array) -> str:
        """Whether what is sent is what the accelerations and wrenches of a step need."""
        if step.status in (Status.BRAKED, Status.CAPPED):
            return ""
        needed = self.needed.torques(step, q, before)
        off = np.abs(needed - step.torque).max()
        return "" if off <= SENT * max(self.longest, np.abs(needed).max()) else "other torques than a takes"

    def step(self, step: Step, before: Array, dt: float) -> str:
        """Numbers, limits of accelerations, velocities and torques, and the certificate."""
        numbers = np.frombuffer(step._data, count=step._context.memory.report)
        if np.isnan(numbers).any() or not (np.isfinite(step.a).all() and np.isfinite(step.torque).all()):
            return "NaN"
        limits, wrong = self.limits, self.motors(step, dt)
        if wrong:
            return wrong
        if (np.abs(step.a) > limits.acceleration * (1 + 1e-12) + 1e-12).any():
            return "beyond an acceleration limit"
        within = np.abs(before) <= limits.velocity * (1 + 1e-12)
        if (within & (np.abs(step.v) > limits.velocity * (1 + 1e-9) + 1e-12)).any():
            return "beyond a velocity limit"
        if step.status == Status.RELAXED and not step.relaxed:
            return "a conflict without a name"
        if step.status in (Status.BRAKED, Status.CAPPED):
            return ""
        found = step.certificate
        optimal = max(found.stationarity, found.complementarity) <= 1e-9
        sound = found.violation <= 1e-6 * self.longest and (optimal or found.error_bound <= 1e-3 * self.longest)
        return "" if sound else "a certificate that fails is not reported"


def viable(robot: Robot, q: Array, rng: np.random.Generator, longest: float) -> Array:
    """A velocity from which every joint can stop before its limits."""
    limits = robot.limits
    v = limits.velocity * rng.uniform(-1.0, 1.0, robot.nv)
    for i, k in enumerate(robot.position_index):
        low, high = limits.position_lower[i], limits.position_upper[i]
        if k < 0 or not np.isfinite(high - low):
            continue
        B = stopping_deceleration(limits.acceleration[i], limits.velocity[i], high - low, longest)
        room = max(0.0, high - q[k] if v[i] > 0 else q[k] - low)
        v[i] = np.sign(v[i]) * min(abs(v[i]), np.sqrt(2 * B * room))
    return np.asarray(v)


def episode(controller: Controller, judge: TorqueJudge, rng: np.random.Generator) -> Counter[str]:
    """Counts of how steps ended and of what was wrong, from a state that limits can be kept from."""
    robot, counts, change = controller.stack.robot, Counter[str](), LENGTH
    watch = Outside(robot)
    together = replace(robot, limits=robot.coupled(robot.limits))
    q = configuration(together, rng, False)
    v = viable(together, q, rng, controller.stack.dt_range[1]) * float(rng.choice([0.0, 0.3, 1.0]))
    q, v = followed(robot, q, v)
    controller.reset(q, v)
    judge.begin()
    if rng.random() < 0.5:
        change = int(rng.integers(1, LENGTH))
    for k in range(LENGTH):
        if k in (0, change):
            provoke(controller, rng)
            judge.needed.begin()
        dt = DT * float(rng.uniform(0.25, 2.0)) if rng.random() < 0.5 else None
        try:
            step = controller.step(q, v, dt)
        except Exception as error:  # noqa: BLE001 - a soak counts whatever escapes
            counts[f"raised: {type(error).__name__}"] += 1
            return counts
        seconds = DT if dt is None else dt
        counts[label(step)] += 1
        counts.update(f"gave way: {kind}" for kind in judge.gave_way(step))
        wrong = judge.step(step, v, seconds) or judge.torques(step, q, v)
        q, v = pin.integrate(robot.model, q, (v + 0.5 * seconds * step.a) * seconds), step.v
        if not wrong and (watch._beyond(q) > 1e-9).any():
            wrong = "beyond a position limit"
        if wrong:
            counts[f"wrong: {wrong}"] += 1
            return counts
    return counts


def torques(seed: int, k: int, backend: str, ticks: int) -> list[tuple[str, Counter[str]]]:
    """A random stack with ``ticks`` ticks: its description and its counts."""
    rng = np.random.default_rng([seed, backend == "native", k, 2])
    controller = torque_stack(strong(rng), rng).compile(backend=backend, command="torque")
    judge, counts, done = TorqueJudge(controller), Counter[str](), 0
    while done < ticks:
        counts += episode(controller, judge, rng)
        done += LENGTH
    items = " ".join(e.name for e in controller.stack.entries)
    return [(f"torque {backend} {seed}/{k}: {controller.stack.robot.nv} dof, {items}", counts)]

"""Random stacks that command torques: contacts, loads and motors of any strength, in open loop, every step judged."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin

import wbc
from bench.soak.episodes import LENGTH, label
from bench.soak.judge import Judge, Outside
from bench.soak.machines import configuration, machine
from bench.soak.stacks import DT, pose, weight
from wbc.controller import Controller, Status, Step, core_of
from wbc.robot import Robot
from wbc.shapes import HalfSpace, Sphere
from wbc.stack.codegen import row_units
from wbc.tasks import (
    EndEffector,
    ExternalWrench,
    JointFriction,
    JointLimits,
    LineContact,
    Obstacle,
    PointContact,
    Posture,
    RigidGrasp,
    SlidingContact,
    SurfaceContact,
    TorqueLimits,
)
from wbc.tasks._contact import Contact, ContactForce
from wbc.tasks.stopping import stopping_deceleration
from wbc.validation import Array

#: What accelerations and wrenches take beyond the torques that are sent, at most, of the largest of them
SENT = 1e-6


def strong(rng: np.random.Generator) -> Robot:
    """A random robot with motors from much too weak to more than strong enough."""
    robot = machine(rng)
    effort = 10.0 ** rng.uniform(0.0, 3.0, robot.nv)
    effort[: robot.base_nv] = np.inf
    acceleration = robot.limits.acceleration.copy()
    acceleration[: robot.base_nv] = np.inf
    limits = robot.limits.override(effort=effort, acceleration=acceleration)
    if rng.random() < 0.3:
        robot.model.gravity.linear = np.zeros(3)
    return (
        wbc.robots.load(robot.model)
        .with_shapes(robot.shapes)
        .with_limits(
            **{
                name: getattr(limits, name) for name in ("position_lower", "position_upper", "velocity", "acceleration")
            },
            effort=effort,
        )
    )


def torque_stack(robot: Robot, rng: np.random.Generator) -> wbc.Stack:
    """Limits of joints and torques, and a random choice of contacts, loads, margins and tasks."""
    names = [frame.name for frame in robot.model.frames if str(frame.name).startswith("f")]
    stack = wbc.Stack(robot, dt=DT)

    def frame() -> str:
        return str(rng.choice(names))

    def some(probability: float) -> bool:
        return bool(rng.random() < probability)

    for k in range(int(rng.integers(1, 3))):
        kind = str(rng.choice(["pose", "position", "orientation"]))
        stack.add(EndEffector(frame(), kind=kind), name=f"hand{k}", weight=weight(rng))
    stack.add(Posture(), name="posture", weight=weight(rng), level=int(some(0.2)))
    stack.add(JointLimits(), name="limits").add(TorqueLimits(), name="motors")
    most = int(rng.choice([0, 1, 2, 3]))
    for k in range(most):
        at = frame()
        contact: Contact = [
            RigidGrasp(at, force=float(10.0 ** rng.uniform(0, 3)), torque=float(10.0 ** rng.uniform(0, 2))),
            PointContact(at, friction=float(rng.uniform(0.0, 1.5)), least=float(rng.choice([0.0, 5.0]))),
            SurfaceContact(at, half_lengths=(0.1, 0.05), friction=float(rng.uniform(0.0, 1.5))),
            LineContact(at, half_length=0.1, friction=float(rng.uniform(0.0, 1.5))),
            SlidingContact(at, friction=float(rng.uniform(0.0, 0.5))),
        ][int(rng.integers(5))]
        stack.add(contact, name=f"contact{k}")
    if some(0.3):
        stack.add(ExternalWrench(frame()), name="push")
    if some(0.3):
        stack.add(JointFriction(viscous=0.1, coulomb=0.2), name="gears")
    if some(0.3):
        stack.add(Obstacle(Sphere(0.1), margin=0.01), name="ball")
    if some(0.2):
        stack.add(Obstacle(HalfSpace()), name="floor", soft=weight(rng) if some(0.5) else None)
    return stack


def provoke(controller: Controller, rng: np.random.Generator) -> None:
    """Other run-time values."""
    for entry in controller.stack.entries:
        handle, item = controller[entry.name], entry.item
        if isinstance(item, EndEffector):
            place = pose(rng, 0.5 if rng.random() < 0.8 else 50.0)
            handle.target = {"pose": place, "orientation": place.rotation, "position": place.translation}[item.kind]
        elif isinstance(item, Contact):
            handle.enabled = bool(rng.random() < 0.8)
        elif isinstance(item, ContactForce):
            handle.weight = weight(rng)
            handle.target = 10.0 ** rng.uniform(-1.0, 3.0) * rng.normal(size=item.contact.components)
        elif isinstance(item, TorqueLimits):
            handle.scale = float(rng.choice([1.0, 1.0, 1.0, 0.3, 0.0]))
        elif isinstance(item, ExternalWrench):
            handle.wrench = 10.0 ** rng.uniform(-1.0, 2.0) * rng.normal(size=6)
        elif isinstance(item, Obstacle):
            handle.pose = pose(rng, 0.6)
        if entry.is_task and entry.name != "rest" and not isinstance(item, ContactForce):
            handle.weight = weight(rng)


class Needed:
    """Torques that accelerations and wrenches take, by Pinocchio's recursion and numpy alone."""

    def __init__(self, controller: Controller) -> None:
        self._controller, robot = controller, controller.stack.robot
        self._model, self._data, self._base = robot.model, robot.model.createData(), robot.base_nv
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

    def torques(self, step: Step, q: Array, v: Array) -> Array:
        """M a + h - J'w - L; what a floating base lacks comes first."""
        model, data = self._model, self._data
        found = pin.rnea(model, data, q, v, step.a)
        for frame, wrench in self._pushes:
            found -= pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED).T @ wrench
        for dofs, viscous, coulomb, slow in self._frictions:
            found[dofs] += viscous * v[dofs] + coulomb * np.tanh(v[dofs] / slow)
        if self._slides:
            pin.forwardKinematics(model, data, q)
        for name, force in step.forces.items():
            if not force.any():
                continue
            J = pin.computeFrameJacobian(model, data, q, self._frames[name], pin.LOCAL)
            if name in self._slides:
                normal, friction, slow = self._slides[name]
                turn = pin.updateFramePlacement(model, data, self._frames[name]).rotation
                speed = turn @ (J[:3] @ v)
                slip = speed - normal * (normal @ speed)
                along = normal - friction * slip / np.sqrt(slip @ slip + slow**2)
                found -= force[0] * (J[:3].T @ (turn.T @ along))
            else:
                found -= J[list(self._contacts[name].axes)].T @ force
        return np.asarray(found)


class TorqueJudge(Judge):
    """The same of torques: their limits hold exactly, they are what accelerations and wrenches need, and what gives way
    has a name.

    Attributes:
        scale: of the torque limits.
    """

    scale = 1.0

    def __init__(self, controller: Controller) -> None:
        super().__init__(controller)
        self.needed = Needed(controller)
        # as LONGEST of a tick: rows on forces count in their sizes
        core = core_of(controller)
        rows = row_units(controller.stack, core.layout)
        self.longest = max(1.0, *rows, *core.layout.dof_scales(controller.stack))

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
        limits, scale = self.limits, self.scale
        if (np.abs(step.torque) > scale * limits.effort * (1 + 1e-15)).any():
            return "beyond a torque limit"
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
    robot, counts = controller.stack.robot, Counter[str]()
    watch = Outside(robot)
    q = configuration(robot, rng, False)
    v = viable(robot, q, rng, controller.stack.dt_range[1]) * float(rng.choice([0.0, 0.3, 1.0]))
    controller.reset(q, v)
    provoke(controller, rng)
    judge.scale = float(controller["motors"].scale)
    judge.needed.begin()
    for _ in range(LENGTH):
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

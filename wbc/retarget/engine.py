"""The stack that brings a robot to targets, and its ticks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import casadi as ca
import numpy as np

from wbc import robots, tasks
from wbc.api import Controller, Stack
from wbc.controller.compiled_stack import core_of
from wbc.controller.handle import InputGroup
from wbc.controller.step import Step
from wbc.multibody import pin
from wbc.retarget.clip import Array
from wbc.retarget.options import RetargetOptions
from wbc.retarget.plan import MotionPlan, balanced, logarithms
from wbc.retarget.robot_body import RobotBody, with_frame
from wbc.robot import Robot
from wbc.rotations import exponential
from wbc.shapes import Convex, HalfSpace, PlacedShape
from wbc.symbolic.tracer import Tracer
from wbc.tasks.base import Values
from wbc.tick.outcome import Status

#: Gain of tasks, as share of one over the time of a tick
GAIN = 0.5
#: Gain of tasks at most: what is far off comes back without swinging the robot about [1/s]
FASTEST = 15.0
#: Gain of held contacts, as share of one over the time of a tick
HOLD_GAIN = 0.9
#: What links that come nearer to each other, or to the ground, than their clearance cost
CLEARANCE_PRICE = 1e4
#: How many pairs of links have rows at a time
CLOSEST = 10
#: Links with so many joints between them and fewer may touch: hulls of links stand out of them near their joints
NEIGHBOURS = 3
#: Random configurations of which pairs of links that can touch are found
PAIR_SAMPLES = 2000
#: Corners of the hull of a link besides feet and hands, at most: more than have rows of their own, so that they are
#: measured before a tick, which is faster
LINK_CORNERS = 96
#: Fewer do where they are within this of it [m]
NEAR_ENOUGH = 1e-5
#: Half the thickness of what is drawn as a plane [m]
THIN = 2e-4
#: Links besides feet that have rows of the ground at a time
NEAREST = 8
#: The ground's rows begin this far below it, so that they say nothing of feet that are held on it [m]
DEPTH = 2e-4
#: What a foot that goes below the ground costs, see docs/soft.md
GROUND_PRICE = 1e5
#: How fast feet come down to the ground's rows, as share of one over the time of a tick
GROUND_RATE = 0.5
#: A foot whose stance is younger than this gives way to those that stand [s]
LANDING = 0.1
#: After so many ticks it is tried again
AGAIN = 3
#: What a held contact moves by, beyond what was foreseen, before its tick is done again [m]
MATTERS = 1.5e-5
#: What a held contact moves by within a tick and more is no second order [m]
FORESEEN = 1e-3
#: Distance from a sole's middle at which its turns are counted [m]
LEVER = 0.12
#: A foot is held from where it is this near to its place [m]
FOOT_ENGAGED = 1e-2
#: A hand, which its task draws less [m]
HAND_ENGAGED = 3e-2
#: Ticks that bring the robot to the first frame
SETTLING = 400
#: The first frame is reached when no joint moves faster [rad/s]
SETTLED = 1e-3


def limited(robot: Robot, options: RetargetOptions) -> Robot:
    """A robot with limits of velocity and acceleration for every joint, the base included: the description's where it
    has one, else the options'.
    """
    limits, base = robot.limits, robot.base_nv
    velocity = np.where(np.isfinite(limits.velocity), limits.velocity, options.velocity)
    acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, options.acceleration)
    velocity[:base], acceleration[:base] = options.base_velocity, options.base_acceleration
    return robot.with_limits(velocity=velocity, acceleration=acceleration)


@dataclass(frozen=True)
class _StillContact(tasks.Hold):
    """A contact at rest, as rows at q alone: what a tick loses at second order the next one makes up for."""

    abstract: ClassVar[bool] = True

    def residual(self, robot: Robot, kin: Tracer, inputs: Values) -> ca.SX | None:
        """None: its rows are not bent."""
        return None


@dataclass(frozen=True)
class _Leading:
    """Columns of a plan's rows: item, input, and how many numbers."""

    item: str
    name: str
    size: int


class Engine:
    """The compiled stack of a robot that follows a plan, tick by tick.

    Attributes:
        robot: with its limits. controller: of the stack. columns: what a row of :meth:`rows` holds.
    """

    def __init__(
        self, body: RobotBody, followed: Sequence[str], options: RetargetOptions, dt: float, *, head: bool = False
    ) -> None:
        self.body, self.options, self.dt = body, options, dt
        self.robot = self._shaped(limited(body.robot, options))
        self._limbs = [name for name in body.limbs if name in followed]
        weights = options.weights
        stack = Stack(self.robot, dt=dt, calm=False)
        gain = min(GAIN / dt, FASTEST)
        free = self.robot.base != "fixed"
        self.columns: list[_Leading] = []

        def led(item: str, *sizes: tuple[str, int]) -> None:
            self.columns += [_Leading(item, name, size) for name, size in sizes]

        if free:
            six = (weights.pelvis,) * 3 + (weights.turn,) * 3
            stack.add(tasks.EndEffector(body.pelvis, weights=six, gain=gain), name="pelvis")
            led("pelvis", ("target", 12), ("feedforward", 6))
        self._chest = body.plan.upright and body.plan.chest != body.plan.pelvis
        if self._chest:
            stack.add(tasks.EndEffector(body.chest, "orientation", gain=gain), name="chest", weight=weights.chest)
            led("chest", ("target", 9), ("feedforward", 3))
        self._head = head and bool(body.head)
        if self._head:
            stack.add(tasks.EndEffector(body.head, "orientation", gain=gain), name="head", weight=weights.head)
            led("head", ("target", 9), ("feedforward", 3))
        if options.balance and free:
            # Over the contacts, wherever their height
            mass = tasks.CenterOfMass(weights=(1.0, 1.0, 0.0), gain=gain)
            stack.add(mass, name="balance", weight=options.balance)
            led("balance", ("target", 3), ("feedforward", 3))
        for name in self._limbs:
            self._add_limb(stack, name, gain, led)
        stack.add(tasks.Posture(start="neutral", gain=1.0), name="posture", weight=weights.posture)
        stack.add(tasks.JointLimits(shortest_dt=dt), name="limits")
        feet = [name for name in body.limbs if self.is_foot(name)]
        for name in feet:
            ground = tasks.Obstacle(HalfSpace(), links=(body.limbs[name].end,), pose=_below(DEPTH), closest=1)
            stack.add(ground, name=f"{name} above ground", soft=GROUND_PRICE)
        if options.clearance is not None:
            clear = tasks.SelfCollision(margin=options.clearance, closest=CLOSEST, method="sensed")
            stack.add(clear, name="clearance", soft=CLEARANCE_PRICE)
        links = (*self._links, *(limb.end for name, limb in body.limbs.items() if name not in feet))
        if free and links:
            ground = tasks.Obstacle(HalfSpace(), links=links, pose=_below(DEPTH), closest=NEAREST)
            stack.add(ground, name="above ground", soft=GROUND_PRICE)
        self.stack = stack
        self.controller: Controller = stack.compile()
        for item in (*(f"{name} above ground" for name in feet), *(["above ground"] if free and links else [])):
            self.controller[item].rate = GROUND_RATE / dt
        self._group = InputGroup(core_of(self.controller), [(c.item, c.name, None) for c in self.columns])
        self._held: dict[str, bool] = {}
        self._items = {column.item for column in self.columns}

    def _shaped(self, robot: Robot) -> Robot:
        """The robot with balls around what it may touch the ground with, and where clearances are asked for with shapes
        on all links.
        """
        pairs = robot.self_pairs
        if self.options.clearance is not None:
            robot = robots.fit_shapes(robot)
            found = robots.find_self_pairs(robot, samples=PAIR_SAMPLES).kept
            pairs = tuple(pair for pair in found if _joints_between(robot, *pair) > NEIGHBOURS)
        ends = self.body.limbs.values()
        shapes = {limb.end: [_solid(limb.surface)] for limb in ends}
        last = {limb.joints[-1] for limb in ends}
        self._links: list[str] = []
        for joint, balls in self.body.balls.items() if robot.base != "fixed" else ():
            if joint not in last:
                frame = f"retarget_ground_{joint}"
                robot = with_frame(robot, frame, joint, pin.SE3.Identity())
                shapes[frame] = [_solid(balls.corners(LINK_CORNERS, NEAR_ENOUGH))]
                self._links.append(frame)
        return robot.with_shapes({**robot.shapes, **shapes}).with_self_pairs(pairs)

    def is_foot(self, name: str) -> bool:
        """Whether a limb walks."""
        free = self.robot.base != "fixed"
        return free and (name.endswith("leg") or not self.body.plan.upright)

    def _add_limb(self, stack: Stack, name: str, gain: float, led: Callable[..., None]) -> None:
        body, weights, limb = self.body, self.options.weights, self.body.limbs[name]
        if body.plan.upright and limb.middle:
            stack.add(
                tasks.EndEffector(limb.middle, "position", gain=gain), name=f"{name} middle", weight=weights.middle
            )
            led(f"{name} middle", ("target", 3), ("feedforward", 3))
        if self.is_foot(name):
            if limb.contact == "flat":
                six = (weights.foot,) * 3 + (weights.sole,) * 3
                stack.add(tasks.EndEffector(limb.end, weights=six, gain=gain), name=name)
                led(name, ("target", 12), ("feedforward", 6))
            else:
                stack.add(tasks.EndEffector(limb.end, "position", gain=gain), name=name, weight=weights.foot)
                led(name, ("target", 3), ("feedforward", 3))
        else:
            if limb.wrist:
                stack.add(
                    tasks.EndEffector(limb.wrist, "position", gain=gain), name=f"{name} wrist", weight=weights.wrist
                )
                led(f"{name} wrist", ("target", 3), ("feedforward", 3))
            stack.add(tasks.EndEffector(limb.end, "position", gain=gain), name=name, weight=0.1 * weights.wrist)
            led(name, ("target", 3), ("feedforward", 3))
        if self.robot.base != "fixed" and self.options.hold:
            kind: Literal["pose", "position"] = "pose" if limb.contact == "flat" else "position"
            stack.add(_StillContact(limb.end, kind, gain=HOLD_GAIN / self.dt), name=f"{name} stands")
            led(f"{name} stands", ("target", 12))

    def rows(self, plan: MotionPlan) -> Array:
        """Numbers of all inputs over ticks [ticks, numbers]."""
        dt = plan.dt
        turn, pelvis = plan.turn, plan.pelvis
        parts: dict[tuple[str, str], Array] = {}
        if self.robot.base != "fixed":
            parts["pelvis", "target"] = _pose(turn, pelvis)
            parts["pelvis", "feedforward"] = np.hstack([_rate(pelvis, dt), _turn_rate(turn, dt)])
        if self._chest:
            parts["chest", "target"], parts["chest", "feedforward"] = _columns(plan.chest), _turn_rate(plan.chest, dt)
        if self._head and plan.head is not None:
            parts["head", "target"], parts["head", "feedforward"] = _columns(plan.head), _turn_rate(plan.head, dt)
        if self.options.balance and self.robot.base != "fixed":
            over = balanced(plan)
            parts["balance", "target"], parts["balance", "feedforward"] = over, _rate(over, dt)
        for name in self._limbs:
            limb, flat = plan.limbs[name], self.body.limbs[name].contact == "flat" and self.is_foot(name)
            for item, values in ((f"{name} middle", limb.middle), (f"{name} wrist", limb.wrist), (name, limb.end)):
                if item in self._items:
                    parts[item, "target"], parts[item, "feedforward"] = values, _rate(values, dt)
            ahead = limb.end + (_next(limb.end) - limb.end) / HOLD_GAIN
            rotation = np.broadcast_to(np.eye(3), (plan.ticks, 3, 3))
            if flat and limb.rotation is not None:
                turned = _turn_rate(limb.rotation, dt)
                parts[name, "target"] = _pose(limb.rotation, limb.end)
                parts[name, "feedforward"] = np.hstack([parts[name, "feedforward"], turned])
                # What a hold must be given so that a frame on one target is on the next one a tick later
                rotation = exponential(turned * (dt / HOLD_GAIN)) @ limb.rotation
            parts[f"{name} stands", "target"] = _pose(rotation, ahead)
        return np.ascontiguousarray(np.hstack([parts[c.item, c.name] for c in self.columns]))

    def start(self, plan: MotionPlan, rows: Array) -> Array:
        """Bring the robot to the first frame, with the velocity with which the clip goes on; its configuration."""
        robot, controller = self.robot, self.controller
        q = robot.neutral.copy()
        if robot.base != "fixed":
            now = self.body.robot.pose(q, self.body.pelvis)
            target = pin.SE3(plan.turn[0], plan.pelvis[0])
            root = robot.model.joints[1]
            base = pin.SE3(pin.XYZQUATToSE3(q[:7])) if root.nq == 7 else pin.SE3.Identity()
            q[:7] = pin.SE3ToXYZQUAT(target * now.inverse() * base)
            q[3:7] /= np.linalg.norm(q[3:7])
        still = rows.copy()[:2]
        at = 0
        for column in self.columns:
            if column.name == "feedforward":
                still[:, at : at + column.size] = 0.0
            at += column.size
        self._hold(dict.fromkeys(self._limbs, False))
        q = self._settled(q, still[0], SETTLING)
        # What is held jumps to its place, so it is brought there before
        self._hold({name: bool(plan.limbs[name].held[0]) for name in self._limbs})
        q = self._settled(q, still[0], SETTLING // 4)
        if plan.ticks < 2:
            return q
        after = self._settled(q, still[1], SETTLING // 4)
        v = pin.difference(robot.model, q, after) / self.dt
        limit = robot.limits.velocity
        controller.reset(q, np.clip(v, -limit, limit))
        return q

    def _settled(self, q: Array, row: Array, most: int) -> Array:
        controller, model = self.controller, self.robot.model
        controller.reset(q)
        for _ in range(most):
            self._group.write(row)
            v = controller.step(q).v
            q = pin.integrate(model, q, v * self.dt)
            if float(np.abs(v).max()) < SETTLED:
                break
        return q

    def _hold(self, wanted: dict[str, bool]) -> None:
        for name, on in wanted.items():
            if self.options.hold and self.robot.base != "fixed" and self._held.get(name) != on:
                self.controller[f"{name} stands"].enabled = on
                # A foot that is held is where it was asked for; rows of the ground would say the same again
                if self.is_foot(name) and self.body.limbs[name].contact == "flat":
                    self.controller[f"{name} above ground"].enabled = not on
                self._held[name] = on

    def tick(self, q: Array, row: Array) -> Step:
        """One tick at q for one row of :meth:`rows`."""
        self._group.write(row)
        return self.controller.step(q)

    def run(self, plan: MotionPlan) -> tuple[Array, list[tuple[int, tuple[str, ...]]]]:
        """All ticks of a plan.

        Returns:
            Configurations [ticks, nq], and the ticks at which rows gave way with the names of their items.
        """
        rows = self.rows(plan)
        q = self.start(plan, rows)
        out = np.empty((plan.ticks, self.robot.nq))
        out[0] = q
        model, dt = self.robot.model, self.dt
        held = np.array([plan.limbs[name].held for name in self._limbs]).T
        changing = set(np.flatnonzero(np.concatenate([[True], (held[1:] != held[:-1]).any(axis=1)])).tolist())
        #: limb -> the first tick in which it may be held again
        not_before = dict.fromkeys(self._limbs, 0)
        waiting: list[str] = []
        gave: list[tuple[int, tuple[str, ...]]] = []
        v = np.array(self.controller.last_command)
        write, step_of, solved = self._group.write, self.controller.step, Status.SOLVED
        losses = _Losses(self, plan, rows)
        for k in range(plan.ticks - 1):
            if k in changing or waiting:
                asked = [name for name, on in zip(self._limbs, held[k], strict=True) if on]
                waiting = [name for name in asked if not self._held.get(name)]
                there = losses.near([name for name in waiting if k >= not_before[name]], q, k)
                self._hold({name: name in asked and (name in there or name not in waiting) for name in self._limbs})
                waiting = [name for name in waiting if name not in there]
            write(rows[k])
            step = step_of(q)
            if step.status is not solved and (landing := self._landing(plan, k)):
                # Feet that come to stand give way before those that stand
                self._hold(dict.fromkeys(landing, False))
                not_before |= dict.fromkeys(landing, k + AGAIN)
                waiting += landing
                step = step_of(q, v)
            if step.status is not solved:
                gave.append((k, tuple(dict.fromkeys(slack.item for slack in step.relaxed)) or (str(step.status),)))
            after = pin.integrate(model, q, step.v * dt)
            if losses.look(after, k + 1, self._held) and step.status is solved:
                # What was not foreseen is made up for in a second tick from the same state
                losses.correct(k)
                write(rows[k])
                again = step_of(q, v)
                if again.status is solved:
                    step, after = again, pin.integrate(model, q, again.v * dt)
                    losses.look(after, k + 1, self._held)
            losses.learn(k + 1)
            v, q = step.v, after
            out[k + 1] = q
        return out, gave

    def follow(self, plan: MotionPlan, q: Array) -> Array:
        """The ticks of a plan that goes on from q; the configuration after the last."""
        rows = self.rows(plan)
        self._hold({name: bool(limb.held[0]) for name, limb in plan.limbs.items()})
        for row in rows[:-1]:
            q = pin.integrate(self.robot.model, q, self.tick(q, row).v * self.dt)
        return q

    def _landing(self, plan: MotionPlan, tick: int) -> list[str]:
        """Limbs that are held and whose stance has not begun long ago."""
        first = max(tick - round(LANDING / self.dt), 0)
        return [name for name, on in self._held.items() if on and tick > 0 and not plan.limbs[name].stands[first]]


def _solid(corners: Array) -> PlacedShape:
    """The hull of some corners in a link's frame; what is flat gets a thickness."""
    if len(corners) < 4 or np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[2] < THIN:
        sides = np.array([[x, y, z] for x in (-THIN, THIN) for y in (-THIN, THIN) for z in (-THIN, THIN)])
        corners = (corners[:, None] + sides).reshape(-1, 3)
    return PlacedShape(Convex(corners), pin.SE3.Identity())


def _joints_between(robot: Robot, first: str, second: str) -> int:
    """How many joints lie on the way from one link to another."""
    model = robot.model
    chains = []
    for link in (first, second):
        chain = [int(model.frames[int(model.getFrameId(link))].parentJoint)]
        while chain[-1] > 0:
            chain.append(int(model.parents[chain[-1]]))
        chains.append(chain)
    return len(set(chains[0]) ^ set(chains[1]))


def _below(depth: float) -> pin.SE3:
    """The pose of a plane this far below the ground [m]."""
    return pin.SE3(np.eye(3), np.array([0.0, 0.0, -depth]))


class _Losses:
    """Held contacts move at second order within a tick; their targets make up for what is foreseen of it.

    Errors are of position, and of a sole's rotation about its ankle's axes times :data:`LEVER` [m].
    """

    def __init__(self, engine: Engine, plan: MotionPlan, rows: Array) -> None:
        model = engine.robot.model
        self._model, self._data, self._rows = model, model.createData(), rows
        #: limb -> its frame, its targets, and where its hold begins in a row
        self._places: dict[str, tuple[int, Array, Array | None, int]] = {}
        self._engaged: dict[str, float] = {}
        #: limb -> how far it was off before, and what its target makes up for now
        self._before: dict[str, Array] = {}
        self._made_up: dict[str, Array] = {}
        #: limb -> what the last tick lost
        self._lost: dict[str, Array] = {}
        #: limb -> how far it is off now
        self._errors: dict[str, Array] = {}
        at = 0
        for column in engine.columns:
            if column.item.endswith(" stands"):
                name = column.item.removesuffix(" stands")
                limb, flat = plan.limbs[name], engine.body.limbs[name].contact == "flat"
                frame = int(model.getFrameId(engine.body.limbs[name].end))
                self._engaged[name] = FOOT_ENGAGED if engine.is_foot(name) else HAND_ENGAGED
                self._places[name] = frame, limb.end, limb.rotation if flat else None, at
            at += column.size

    def look(self, q: Array, tick: int, held: dict[str, bool]) -> bool:
        """See where held contacts are; whether one lost more than was foreseen and than matters."""
        self._errors = {}
        if not any(held.values()):
            return False
        pin.forwardKinematics(self._model, self._data, q)
        worst = 0.0
        for name in self._places:
            if held.get(name):
                self._errors[name] = error = self._error(name, tick)
                missed = self._missed(name, error)
                size = float(missed @ missed)
                worst = max(worst, size if size < FORESEEN**2 else 0.0)
        return worst > MATTERS**2

    def near(self, names: list[str], q: Array, tick: int) -> list[str]:
        """Those of some limbs whose contacts are so near to their targets that they can be held from here on."""
        if names:
            pin.forwardKinematics(self._model, self._data, q)
        return [name for name in names if float(np.linalg.norm(self._error(name, tick))) < self._engaged[name]]

    def _error(self, name: str, tick: int) -> Array:
        frame, targets, rotations, _ = self._places[name]
        pose = pin.updateFramePlacement(self._model, self._data, frame)
        error = np.zeros(6)
        error[:3] = pose.translation - targets[tick]
        if rotations is not None:
            error[3:] = LEVER * pin.log3(pose.rotation @ rotations[tick].T)
        return error

    def _missed(self, name: str, error: Array) -> Array:
        before = self._before.get(name)
        return np.zeros(6) if before is None else np.asarray(error - (1.0 - HOLD_GAIN) * before)

    def _make_up(self, name: str, tick: int, lost: Array) -> None:
        """Move a target against what is lost."""
        _, _, rotations, at = self._places[name]
        row = self._rows[tick]
        row[at + 9 : at + 12] -= lost[:3] / HOLD_GAIN
        if rotations is not None:
            turned = pin.exp3(-lost[3:] / (LEVER * HOLD_GAIN)) @ row[at : at + 9].reshape(3, 3).T
            row[at : at + 9] = turned.T.ravel()

    def correct(self, tick: int) -> None:
        """Have the same tick make up for what it lost."""
        for name, error in self._errors.items():
            missed = self._missed(name, error)
            self._make_up(name, tick, missed)
            self._made_up[name] = self._made_up.get(name, 0.0) + missed

    def learn(self, tick: int) -> None:
        """Foresee what the next tick loses: what this one did, and as much more as it lost more than the one before."""
        for name in [name for name in self._before if name not in self._errors]:
            for kept in (self._before, self._made_up, self._lost):
                kept.pop(name, None)
        for name, error in self._errors.items():
            if name in self._before:
                loss = self._missed(name, error) + self._made_up.get(name, 0.0)
                ahead = 2.0 * loss - self._lost.get(name, loss)
                self._lost[name] = loss
                ahead = ahead if float(ahead @ ahead) < FORESEEN**2 else np.zeros(6)
                self._make_up(name, tick, ahead)
                self._made_up[name] = ahead
            self._before[name] = error


def _pose(rotation: Array, position: Array) -> Array:
    return np.hstack([_columns(rotation), position])


def _columns(rotation: Array) -> Array:
    return np.asarray(np.swapaxes(rotation, 1, 2).reshape(-1, 9))


def _next(values: Array) -> Array:
    return np.concatenate([values[1:], values[-1:]])


def _rate(values: Array, dt: float) -> Array:
    return np.asarray((_next(values) - values) / dt)


def _turn_rate(rotations: Array, dt: float) -> Array:
    """Angular velocity in the world that leads from one rotation to the next."""
    return np.asarray(logarithms(_next(rotations) @ np.swapaxes(rotations, 1, 2)) / dt)

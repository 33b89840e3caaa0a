"""The whole QP of a stack by numpy and Pinocchio alone: no expression of the package is evaluated here."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from tests.constraints.test_joint_limits import expected as joint_interval
from wbc.api import Stack
from wbc.shapes import Capsule, Sphere
from wbc.tasks import (
    CenterOfMass,
    Damping,
    Elbow,
    EndEffector,
    Fixed,
    FrameVelocityLimit,
    Hold,
    JointLimits,
    Obstacle,
    Posture,
)

#: error, Jacobian, partial time derivative
Linear = tuple[np.ndarray, np.ndarray, np.ndarray]


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """a x b, column by column where b is a matrix."""
    return pin.skew(a) @ b


class Referee:
    """Kinematics of one configuration and the QP that a stack should have there."""

    def __init__(self, stack: Stack, q: np.ndarray, v: np.ndarray, dt: float) -> None:
        self.stack, self.robot, self.q, self.v, self.dt = stack, stack.robot, q, v, dt
        self.model = self.robot.model
        self.data = self.model.createData()
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        self.com = pin.centerOfMass(self.model, self.data, q).copy()
        self.com_jacobian = pin.jacobianCenterOfMass(self.model, self.data, q).copy()

    def pose(self, frame: str) -> pin.SE3:
        return pin.SE3.Identity() if frame == "world" else self.data.oMf[self.model.getFrameId(frame)]

    def jacobian(self, frame: str) -> np.ndarray:
        """Linear rows at the frame's origin, then angular rows; world axes."""
        if frame == "world":
            return np.zeros((6, self.model.nv))
        here = self.model.getFrameId(frame)
        return np.array(pin.getFrameJacobian(self.model, self.data, here, pin.LOCAL_WORLD_ALIGNED))

    def point(self, frame: str, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place and Jacobian of a point fixed in a frame."""
        arm, J = self.pose(frame).rotation @ offset, self.jacobian(frame)
        return self.pose(frame).translation + arm, J[:3] - cross(arm, J[3:])

    def seen_along(self, axes: str, value: np.ndarray, slope: np.ndarray, drift: np.ndarray) -> Linear:
        """A world vector and its rates as components along the axes of a frame that turns."""
        turn, spin = self.pose(axes).rotation.T, self.jacobian(axes)[3:]
        return turn @ value, turn @ (slope + cross(value, spin)), turn @ drift

    def end_effector(self, item: EndEffector, values: dict[str, Any]) -> Linear:
        base, target, rate = self.pose(item.relative_to), values["target"], values["feedforward"]
        axes = {"reference": item.relative_to, "frame": item.frame}.get(item.axes, item.axes)
        parts = []
        if item.kind != "orientation":
            place = target.translation if item.kind == "pose" else target
            goal, goal_slope = self.point(item.relative_to, place)
            here, slope = self.point(item.frame, np.zeros(3))
            parts.append(self.seen_along(axes, here - goal, slope - goal_slope, -base.rotation @ rate[:3]))
        if item.kind != "position":
            turn = base.rotation @ (target.rotation if item.kind == "pose" else target)
            own = self.pose(item.frame).rotation
            phi, right = pin.log3(turn.T @ own), pin.Jlog3(turn.T @ own)
            carried, driven = self.jacobian(item.relative_to)[3:], base.rotation @ rate[-3:]
            error = turn @ phi
            slope = turn @ right @ own.T @ (self.jacobian(item.frame)[3:] - carried) - cross(error, carried)
            drift = turn @ right @ own.T @ -driven + cross(driven, error)
            parts.append(self.seen_along(axes, error, slope, drift))
        return tuple(np.concatenate(p) for p in zip(*parts, strict=True))

    def task(self, item: Any, values: dict[str, Any]) -> Linear:
        nv = self.model.nv
        if isinstance(item, EndEffector):
            return self.end_effector(item, values)
        if isinstance(item, Elbow):
            here, slope = self.point(item.frame, np.array(item.offset))
            axes = item.frame if item.axes == "frame" else item.axes
            return self.seen_along(axes, here - values["target"], slope, -values["feedforward"])
        if isinstance(item, CenterOfMass):
            error = self.com - values["target"]
            return self.seen_along(item.axes, error, self.com_jacobian, -values["feedforward"])
        if isinstance(item, Posture):
            start, goal = values["target"], self.q
            names = item.joints or self.robot.joint_names[1 if self.robot.base != "fixed" else 0 :]
            rows = np.concatenate([np.arange(nv)[self.robot.dofs(n)] for n in names])
            error = pin.difference(self.model, start, goal)
            back, slope = (pin.dDifference(self.model, start, goal, a) for a in (pin.ARG0, pin.ARG1))
            return error[rows], slope[rows], (back @ values["feedforward"])[rows]
        assert isinstance(item, Damping)
        return np.zeros(nv), np.eye(nv), np.zeros(nv)

    def hold(self, item: Hold, values: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        pose, target = self.pose(item.frame), values["target"]
        off = np.concatenate([pose.translation - target.translation, pin.log3(pose.rotation @ target.rotation.T)])
        rows = {"pose": slice(0, 6), "position": slice(0, 3), "orientation": slice(3, 6)}[item.kind]
        right = -values["gain"] * off[rows]
        return self.jacobian(item.frame)[rows], right, right

    def speed(self, item: FrameVelocityLimit, values: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        carrier = self.jacobian(item.relative_to)
        arm = self.pose(item.frame).translation - self.pose(item.relative_to).translation
        J = self.jacobian(item.frame) - np.vstack([carrier[:3] - cross(arm, carrier[3:]), carrier[3:]])
        turn = self.pose(item.axes).rotation.T
        boxes = [b if b is not None else (np.inf,) * 3 for b in (item.linear, item.angular)]
        rows = np.flatnonzero(np.isfinite(np.concatenate(boxes)))
        limit = np.concatenate([np.atleast_1d(values[n]) for n in ("linear", "angular") if n in values])
        return np.vstack([turn @ J[:3], turn @ J[3:]])[rows], -limit, limit

    def obstacle(self, item: Obstacle, values: dict[str, Any]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """h, its Jacobian and its drift, from nearest points."""
        out = []
        origin, normal = values["pose"].translation, values["pose"].rotation[:, 2]
        for link, _, placed in item.pairs(self.robot):
            half = placed.shape.length / 2 if isinstance(placed.shape, Capsule) else 0.0
            ends = [placed.placement.act(np.array([0.0, 0.0, s * half])) for s in ((-1, 1) if half else (1,))]
            if isinstance(item.shape, Sphere):
                inner = self.pose(link).actInv(origin)
                side = ends[-1] - ends[0]
                along = np.clip((inner - ends[0]) @ side / max(side @ side, 1e-30), 0.0, 1.0)
                place, J = self.point(link, ends[0] + along * side)
                away = (place - origin) / np.linalg.norm(place - origin)
                gap = np.linalg.norm(place - origin) - placed.shape.radius - item.shape.radius - values["margin"]
                out.append((gap, away @ J, -away @ values["velocity"][:3]))
                continue
            for end in ends:
                place, J = self.point(link, end)
                gap = normal @ (place - origin) - placed.shape.radius - values["margin"]
                turning = np.cross(values["velocity"][3:], normal) @ (place - origin)
                out.append((gap, normal @ J, turning - normal @ values["velocity"][:3]))
        return tuple(np.array(part) for part in zip(*out, strict=True))

    def interval(self, item: Any, values: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
        """Simple bounds of one constraint alone."""
        nv, limits = self.model.nv, self.robot.limits
        if isinstance(item, JointLimits):
            scaled = _Scaled(self.robot, values["velocity_scale"], values["return_rate"])
            pairs = [joint_interval(scaled.robot, scaled.item(item), i, self.q, self.v, self.dt) for i in range(nv)]
            low, high = np.array(pairs).T
            return low, high
        assert isinstance(item, Fixed)
        low, high = np.full(nv, -np.inf), np.full(nv, np.inf)
        for name in item.joints:
            here = self.robot.dofs(name)
            step = limits.acceleration[here] * self.dt if item.acceleration else np.inf
            rest = self.v[here] - np.clip(self.v[here], -step, step)
            low[here] = high[here] = rest
        return low, high

    def qp(self, written: dict[str, dict[str, Any]]) -> tuple[np.ndarray, ...]:
        """H, g, A, lower, upper, task errors and margins."""
        stack, robot, nv = self.stack, self.robot, self.model.nv
        size = np.where(np.array(robot.dof_units) == "m", stack.length, 1.0)
        H, g = np.diag(stack.damping / size**2), np.zeros(nv)
        errors, matrices, sides, margins = [np.zeros(0)], [np.zeros((0, nv))], [], [np.zeros(0)]
        low, high = np.full(nv, -np.inf), np.full(nv, np.inf)
        for entry in stack.tasks:
            values, item = written[entry.name], entry.item
            e, J, drift = self.task(item, values)
            scale = np.array([stack.length if row.unit == "m" else 1.0 for row in item.rows(robot)])
            own = np.ones(len(e)) if getattr(item, "weights", None) is None else np.array(item.weights)
            w = values["weight"] * values["mask"] * values["enabled"] * own / scale**2
            H = H + (J.T * w) @ J
            g = g + (J.T * w) @ (values["gain"] * e + drift)
            errors.append(e)
        for entry in sorted(stack.constraints, key=lambda c: c.item.order):
            item, values = entry.item, written[entry.name]
            if item.form != "bounds":
                continue
            on = values["mask"] * values["enabled"] != 0
            one, two = self.interval(item, values)
            low, high = np.where(on, np.clip(one, low, high), low), np.where(on, np.clip(two, low, high), high)
        for entry in stack.constraints:
            item, values = entry.item, written[entry.name]
            on = values["mask"] * values["enabled"] != 0
            if isinstance(item, Obstacle):
                h, J, drift = self.obstacle(item, values)
                margins.append(h)
                rows = J, -values["rate"] * h - drift, np.full(len(h), np.inf)
            elif item.form == "rows":
                rows = self.hold(item, values) if isinstance(item, Hold) else self.speed(item, values)
            else:
                continue
            matrices.append(rows[0])
            sides.append((np.where(on, rows[1], -np.inf), np.where(on, rows[2], np.inf), on))
        lower = np.concatenate([low, *[s[0] for s in sides]])
        upper = np.concatenate([high, *[s[1] for s in sides]])
        on_rows = np.concatenate([np.zeros(0, dtype=bool), *[s[2] for s in sides]])
        A = np.vstack(matrices) * on_rows[:, None]
        return H, g, A, lower, upper, np.concatenate(errors), np.concatenate(margins)


class _Scaled:
    """A robot whose velocity limits carry the scale, and an item whose return rate is the run-time one."""

    def __init__(self, robot: Any, scale: float, rate: float) -> None:
        self.robot, self.rate = robot.with_limits(velocity=scale * robot.limits.velocity), rate

    def item(self, item: JointLimits) -> JointLimits:
        return JointLimits(
            position=item.position,
            velocity=item.velocity,
            acceleration=item.acceleration,
            margin=item.margin,
            return_rate=self.rate,
        )

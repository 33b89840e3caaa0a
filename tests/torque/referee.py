"""The QP of a torque tick by numpy and Pinocchio alone, and its solution by quadprog."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import quadprog

from wbc.api import Controller
from wbc.robot import Robot
from wbc.symbolic.kinematics import frame_index
from wbc.tasks import CenterOfMass, EndEffector, PointContact, Posture, RigidGrasp, SurfaceContact

G = 9.81
FORCE_WEIGHT, REST, REST_WEIGHT = 1e-4, 5.0, 1e-8


class Referee:
    """One state of one controller at its default gains and weights."""

    def __init__(self, controller: Controller, q: np.ndarray, v: np.ndarray, dt: float) -> None:
        self.controller, self.stack, self.robot = controller, controller.stack, controller.stack.robot
        self.q, self.v, self.dt = q, v, dt
        self.model, self.data = self.robot.model, self.robot.model.createData()
        pin.forwardKinematics(self.model, self.data, q, v, np.zeros(self.model.nv))
        pin.updateFramePlacements(self.model, self.data)
        pin.computeJointJacobians(self.model, self.data, q)
        self.M = pin.crba(self.model, self.model.createData(), q)
        self.M = np.triu(self.M) + np.triu(self.M, 1).T
        self.h = pin.nonLinearEffects(self.model, self.model.createData(), q, v)
        self.contacts = {
            e.name: e.item for e in self.stack.entries if isinstance(e.item, (PointContact, SurfaceContact, RigidGrasp))
        }
        self.places, n = {}, self.model.nv
        for name, item in self.contacts.items():
            self.places[name] = slice(n, n := n + item.components)
        self.n = n

    def frame(self, name: str) -> tuple[pin.SE3, np.ndarray, np.ndarray, np.ndarray]:
        """Pose, Jacobian, and its rate times v at the frame's origin in world axes; Jacobian in the frame's axes."""
        f = frame_index(self.model, name)
        J = pin.getFrameJacobian(self.model, self.data, f, pin.LOCAL_WORLD_ALIGNED)
        local = pin.getFrameJacobian(self.model, self.data, f, pin.LOCAL)
        bias = pin.getFrameClassicalAcceleration(self.model, self.data, f, pin.LOCAL_WORLD_ALIGNED).vector
        return self.data.oMf[f].copy(), np.array(J), np.array(bias), np.array(local)

    def task(self, item: Any, target: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """error, J, (dJ/dt) v."""
        nv = self.model.nv
        if isinstance(item, EndEffector):
            pose, J, bias, _ = self.frame(item.frame)
            return pose.translation - target, J[:3], bias[:3]
        if isinstance(item, CenterOfMass):
            data = self.model.createData()
            com = pin.centerOfMass(self.model, data, self.q, self.v, np.zeros(nv))
            error, bias = com - target, data.acom[0].copy()
            return error, pin.jacobianCenterOfMass(self.model, self.model.createData(), self.q), bias
        assert isinstance(item, Posture)
        base = 6 if self.robot.base == "floating" else 0
        error = pin.difference(self.model, target, self.q)[base:]
        return error, np.eye(nv)[base:], np.zeros(nv - base)

    def cone(self, item: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rows on a wrench."""
        if isinstance(item, RigidGrasp):
            most = np.concatenate([np.broadcast_to(item.force, 3), np.broadcast_to(item.torque, 3)]).astype(float)
            return np.eye(6), -most, most
        if isinstance(item, PointContact):
            angles = 2 * np.pi * np.arange(item.edges) / item.edges
            slope = np.cos(np.pi / item.edges) * item.friction
            faces = np.column_stack([-np.cos(angles), -np.sin(angles), np.full(item.edges, slope)])
        else:
            # every wrench of the corners' pyramids is allowed, and each row touches them: tests/torque/test_contacts.py
            X, Y = item.half_lengths
            mu = item.friction / np.sqrt(2)
            faces = []
            for s in (1, -1):
                faces += [[s, 0, mu, 0, 0, 0], [0, s, mu, 0, 0, 0], [0, 0, Y, s, 0, 0], [0, 0, X, 0, s, 0]]
                for a in (1, -1):
                    for b in (1, -1):
                        faces.append([a * Y, b * X, mu * (X + Y), s * a * mu, s * b * mu, -s])
        rows = np.vstack([np.eye(len(faces[0]))[2], faces])
        return rows, np.zeros(len(rows)), np.full(len(rows), np.inf)

    def qp(self) -> tuple[np.ndarray, ...]:
        """H, g, equality rows and sides, inequality rows and lower sides."""
        stack, nv, n = self.stack, self.model.nv, self.n
        metre = np.where(np.array(self.robot.dof_units) == "m", stack.length, 1.0)
        weight = pin.computeTotalMass(self.model) * G
        sizes = [metre]
        for item in self.contacts.values():
            sizes.append(np.repeat([weight, weight * self.robot.characteristic_length], 3)[: item.components])
        size = np.concatenate(sizes)
        # damping of all variables, and joints that come to rest
        H = np.diag(stack.damping / size**2)
        rest = np.zeros(n)
        rest[:nv] = REST_WEIGHT / metre**2
        H += np.diag(rest)
        g = rest * np.concatenate([4 * REST * self.v, np.zeros(n - nv)])
        for place in self.places.values():
            H[place, place] += np.diag(FORCE_WEIGHT / size[place] ** 2)
        for entry in stack.tasks:
            if not isinstance(entry.item, (EndEffector, CenterOfMass, Posture)):
                continue
            gain = 2.0
            e, J, bias = self.task(entry.item, self.controller[entry.name].get("target"))
            length = stack.length if not isinstance(entry.item, Posture) else 1.0
            wide = np.hstack([J, np.zeros((len(J), n - nv))])
            wanted = -4 * gain**2 * e - 4 * gain * J @ self.v - bias
            H += entry.weight / length**2 * wide.T @ wide
            g -= entry.weight / length**2 * wide.T @ wanted
        equal, sides, rows, lower = [], [], [], []
        dynamics, base = np.hstack([self.M, np.zeros((nv, n - nv))]), 6 if self.robot.base == "floating" else 0
        for name, item in self.contacts.items():
            pose, J, bias, local = self.frame(item.frame)
            k, target = item.components, self.controller[name].get("target")
            turn = pose.rotation @ target.rotation.T
            phi = pin.log3(turn)
            e = np.concatenate([pose.translation - target.translation, phi])[:k]
            speed = J @ self.v
            de = np.concatenate([speed[:3], pin.Jlog3(turn).T @ speed[3:]])[:k]
            equal.append(np.hstack([J[:k], np.zeros((k, n - nv))]))
            sides.append(-10.0 * de - bias[:k] - 20.0 * (speed[:k] + 10.0 * e))
            dynamics[:, self.places[name]] = -local[:k].T
            F, low, high = self.cone(item)
            wide = np.zeros((len(F), n))
            wide[:, self.places[name]] = F
            rows += [wide, -wide[np.isfinite(high)]]
            lower += [low, -high[np.isfinite(high)]]
        equal.append(dynamics[:base])
        sides.append(-self.h[:base])
        most = self.robot.limits.effort[base:]
        rows += [dynamics[base:], -dynamics[base:]]
        lower += [-most - self.h[base:], -most + self.h[base:]]
        ends = [acceleration_interval(self.robot, i, self.q, self.v, self.dt, stack.dt_range[1]) for i in range(nv)]
        for sign, end in ((1.0, 0), (-1.0, 1)):
            bound = sign * np.array([pair[end] for pair in ends])
            on = np.flatnonzero(np.isfinite(bound))
            rows.append(sign * np.eye(n)[on])
            lower.append(bound[on])
        return H, g, np.vstack(equal), np.concatenate(sides), np.vstack(rows), np.concatenate(lower)

    def solve(self) -> tuple[np.ndarray, np.ndarray]:
        """(a and wrenches, torques)."""
        H, g, E, e, A, b = self.qp()
        nv, base = self.model.nv, 6 if self.robot.base == "floating" else 0
        C = np.vstack([E, A])
        # in units of rows and columns, for the solver's tolerances
        column = 1.0 / np.sqrt(np.diag(H))
        row = 1.0 / np.linalg.norm(C * column, axis=1)
        scaled = (C * column) * row[:, None]
        x = (
            quadprog.solve_qp(H * np.outer(column, column), -g * column, scaled.T, np.r_[e, b] * row, len(E))[0]
            * column
        )
        tau = self.M @ x[:nv] + self.h
        for name, item in self.contacts.items():
            local = self.frame(item.frame)[3]
            tau -= local[: item.components].T @ x[self.places[name]]
        tau[:base] = 0.0
        return x, tau


def acceleration_interval(
    robot: Robot, i: int, q: np.ndarray, v: np.ndarray, dt: float, longest: float
) -> tuple[float, float]:
    """Allowed accelerations of one joint by bisection of what they lead to, from a state inside the limits."""
    limits, k = robot.limits, int(robot.position_index[i])
    speed, most = limits.velocity[i], limits.acceleration[i]
    low = max(-most, (-speed - v[i]) / dt)
    high = min(most, (speed - v[i]) / dt)
    if k < 0:
        return low, high
    lower, upper = limits.position_lower[i], limits.position_upper[i]
    B = min(most, speed / longest, (upper - lower) / (1.5 * longest**2))

    def safe(a: float, position: float, velocity: float, wall: float) -> bool:
        """The wall above is not met within the tick, and can still be braked for after it."""
        end, w = position + velocity * dt + 0.5 * a * dt * dt, velocity + a * dt
        peak = position - 0.5 * velocity**2 / a if velocity > 0.0 > w else end
        return max(end, peak) <= wall and (w <= 0.0 or w * w <= 2.0 * B * (wall - end))

    def greatest(position: float, velocity: float, wall: float) -> float:
        a, b = -1e6, 1e6
        if safe(b, position, velocity, wall):
            return b
        for _ in range(200):
            middle = 0.5 * (a + b)
            a, b = (middle, b) if safe(middle, position, velocity, wall) else (a, middle)
        return a

    if np.isfinite(upper):
        high = min(max(greatest(q[k], v[i], upper), low), high)
    if np.isfinite(lower):
        low = max(min(-greatest(-q[k], -v[i], -lower), high), low)
    return low, high

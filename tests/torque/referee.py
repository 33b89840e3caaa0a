"""The QP of a torque tick from what Pinocchio says of the state, and its solution by quadprog."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from tests.judges.quadprog_qp import referee
from tests.pinocchio_state import PinocchioState
from wbc.api import Controller
from wbc.qp import QP
from wbc.robot import Robot
from wbc.tasks import CenterOfMass, EndEffector, PointContact, Posture, RigidGrasp, SurfaceContact

G = 9.81
FORCE_WEIGHT, REST, REST_WEIGHT = 1e-4, 5.0, 1e-8
Wrenched = PointContact | SurfaceContact | RigidGrasp


def cone(item: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows on a wrench and their sides, which tests/torque/test_contacts.py holds to sums of forces."""
    rows = item.cone({declared.name: ca.SX(declared.default) for declared in item.limits()})
    outputs = ca.Function("cone", [], [ca.densify(ca.SX(part)) for part in (rows.matrix, rows.lower, rows.upper)])()
    matrix, lower, upper = (np.array(outputs[f"o{k}"]) for k in range(3))
    return matrix, lower[:, 0], upper[:, 0]


class Referee:
    """One state of one controller at its default gains and weights."""

    def __init__(self, controller: Controller, q: np.ndarray, v: np.ndarray, dt: float) -> None:
        self.controller, self.stack, self.robot = controller, controller.stack, controller.stack.robot
        self.state, self.dt, self.base = PinocchioState(self.robot.model, q, v), dt, self.robot.base_nv
        self.contacts = {e.name: e.item for e in self.stack.entries if isinstance(e.item, Wrenched)}
        self.places, n = {}, self.robot.nv
        for name, item in self.contacts.items():
            self.places[name] = slice(n, n := n + item.components)
        self.n = n

    def task(self, item: Any, target: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """error, J, (dJ/dt) v."""
        state, nv = self.state, self.robot.nv
        if isinstance(item, EndEffector):
            frame = state.frame(item.frame)
            return frame.pose.translation - target, frame.J[:3], frame.bias[:3]
        if isinstance(item, CenterOfMass):
            return state.center - target, state.center_J, state.center_bias
        assert isinstance(item, Posture)
        error = pin.difference(self.robot.model, target, state.q)[self.base :]
        return error, np.eye(nv)[self.base :], np.zeros(nv - self.base)

    def wide(self, matrix: np.ndarray, first: int = 0) -> np.ndarray:
        """Columns of the variables from the ``first`` on, as columns of all."""
        return np.pad(matrix, ((0, 0), (first, self.n - first - matrix.shape[1])))

    def qp(self) -> QP:
        """Of accelerations and wrenches."""
        stack, state, nv, n = self.stack, self.state, self.robot.nv, self.n
        metre = np.where(np.array(self.robot.dof_units) == "m", stack.length, 1.0)
        weight = pin.computeTotalMass(self.robot.model) * G
        units = np.repeat([weight, weight * self.robot.characteristic_length], 3)
        size = np.concatenate([metre, *[units[: item.components] for item in self.contacts.values()]])
        # damping of all variables, joints that come to rest, and small wrenches
        rest = np.r_[REST_WEIGHT / metre**2, np.zeros(n - nv)]
        H = np.diag(stack.damping / size**2 + rest + np.r_[np.zeros(nv), np.full(n - nv, FORCE_WEIGHT)] / size**2)
        g = rest * np.r_[4 * REST * state.v, np.zeros(n - nv)]
        for entry in stack.tasks:
            if not isinstance(entry.item, (EndEffector, CenterOfMass, Posture)):
                continue
            gain = 2.0
            e, J, bias = self.task(entry.item, self.controller[entry.name].get("target"))
            length = stack.length if not isinstance(entry.item, Posture) else 1.0
            wanted = -4 * gain**2 * e - 4 * gain * J @ state.v - bias
            H[:nv, :nv] += entry.weight / length**2 * J.T @ J
            g[:nv] -= entry.weight / length**2 * J.T @ wanted
        dynamics, most = self.wide(state.M), self.robot.limits.effort[self.base :]
        rows, lower, upper = list[np.ndarray](), list[np.ndarray](), list[np.ndarray]()
        for name, item in self.contacts.items():
            frame, target, k = state.frame(item.frame), self.controller[name].get("target"), item.components
            turn = frame.pose.rotation @ target.rotation.T
            e = np.r_[frame.pose.translation - target.translation, pin.log3(turn)]
            de = np.r_[frame.twist[:3], pin.Jlog3(turn).T @ frame.twist[3:]]
            wanted = (-10.0 * de - frame.bias - 20.0 * (frame.twist + 10.0 * e))[:k]
            F, low, high = cone(item)
            rows += [self.wide(frame.J[:k]), self.wide(F, self.places[name].start)]
            lower, upper = [*lower, wanted, low], [*upper, wanted, high]
            dynamics[:, self.places[name]] = -frame.local[:k].T
        none = np.zeros(self.base)
        ends = [acceleration_interval(self.robot, i, state.q, state.v, self.dt, stack.dt_range[1]) for i in range(nv)]
        free = np.full(n - nv, np.inf)
        least = np.concatenate([[low for low, _ in ends], -free, *lower, np.r_[none, -most] - state.h])
        greatest = np.concatenate([[high for _, high in ends], free, *upper, np.r_[none, most] - state.h])
        return QP(H, g, least, greatest, np.vstack([*rows, dynamics]))

    def solve(self) -> tuple[np.ndarray, np.ndarray]:
        """(a and wrenches, torques)."""
        x, state = referee(self.qp()), self.state
        assert x is not None
        tau = pin.rnea(self.robot.model, state.data, state.q, state.v, x[: self.robot.nv])
        for name, item in self.contacts.items():
            tau -= state.frame(item.frame).local[: item.components].T @ x[self.places[name]]
        tau[: self.base] = 0.0
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

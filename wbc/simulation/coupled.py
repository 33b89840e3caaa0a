"""Accelerations of robots of which some joints follow others through rigid gears, and of those with closed loops."""

from __future__ import annotations

from collections.abc import Mapping

import casadi as ca
import numpy as np

from wbc.errors import RangeError
from wbc.multibody import mass_matrix, pin
from wbc.robot import Robot
from wbc.simulation.dynamics import ConstrainedDynamics, Grip
from wbc.simulation.plant import GripKind
from wbc.symbolic.evaluation import SingleState
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.motion import MotionExpressions
from wbc.symbolic.tracer import Tracer
from wbc.validation import Array

#: How far a follower may be from where its leader has it, and a loop open [rad; m], [rad/s; m/s]
GAP = 1e-6
#: Rows of a frame's twist that each kind of grip holds
ROWS = {GripKind.POSE: (0, 1, 2, 3, 4, 5), GripKind.AXIS: (0, 1, 2, 3, 4), GripKind.POSITION: (0, 1, 2)}
#: Singular values of the grips' rows below this part of the largest say the same twice
SAME = 1e-10


class CoupledDynamics(ConstrainedDynamics):
    """v = G w of the joints that lead: G'M G dw/dt = G'(tau - h) + G'J'f, J G dw/dt = drift, by dense matrices.

    A torque of a follower acts on its leader by the ratio. J are the rows of grips, as of
    :class:`ConstrainedDynamics`, and of closed loops, whose drift is that of grips too.
    """

    def __init__(self, robot: Robot, model: pin.Model, rate: float) -> None:
        super().__init__(model, rate)
        self._robot = robot
        followers = {coupling.follower for coupling in robot.couplings}
        self.free = [dof for dof in range(model.nv) if dof not in followers]
        self._G = np.eye(model.nv)[:, self.free]
        for coupling in robot.couplings:
            self._G[coupling.follower, self.free.index(coupling.leader)] = coupling.ratio
        self._loops = _rows(robot, model) if robot.loops else None

    def reduced(self, matrix: Array) -> Array:
        return np.asarray(self._G.T @ matrix @ self._G)

    def coupled(self, q: Array, v: Array) -> tuple[Array, Array]:
        """The state with followers exactly where they belong, and loops closed.

        Raises:
            RangeError: one is elsewhere, or open.
        """
        q, v, index = q.copy(), v.copy(), self._robot.position_index
        for coupling in self._robot.couplings:
            name = self._robot.dof_names[coupling.follower]
            at, leads = int(index[coupling.follower]), int(index[coupling.leader])
            place, rate = coupling.ratio * q[leads] + coupling.offset, coupling.ratio * v[coupling.leader]
            for field, found, wanted in (("q", q[at], place), ("v", v[coupling.follower], rate)):
                if abs(found - wanted) > GAP:
                    leader = self._robot.dof_names[coupling.leader]
                    reason = f"{name} follows {leader}, which puts it at {wanted:.9g}"
                    raise RangeError(f"{field}[{name!r}]", float(found), reason)
            q[at], v[coupling.follower] = place, rate
        if self._loops is None:
            return q, v
        error, jacobian, _ = self._looked(q, v)
        for field, found in (("q", error), ("v", jacobian @ v)):
            if np.abs(found).max() > GAP:
                name = self._robot.loops.rows[int(np.abs(found).argmax())][0]
                reason = f"it leaves the loop {name} open by {np.abs(found).max():.3g}; see robot.closed"
                raise RangeError(field, q if field == "q" else v, reason)
        q = self._robot.closed(q)
        jacobian = self._looked(q, v)[1] @ self._G
        w = v[self.free]
        return q, np.asarray(self._G @ (w - np.linalg.lstsq(jacobian, jacobian @ w, rcond=SAME)[0]))

    def _looked(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        assert self._loops is not None
        error, jacobian, bias = self._loops(q, v)
        return error[:, 0], jacobian, bias[:, 0]

    def hold(self, grips: Mapping[str, Grip]) -> None:
        self._grips = [(name, self.model.getFrameId(name), grip, list(ROWS[grip.kind])) for name, grip in grips.items()]
        self._forces = [np.zeros(len(rows)) for *_, rows in self._grips]

    def acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        model, data, G = self.model, self.data, self._G
        mass = self.reduced(mass_matrix(model, data, q))
        force = G.T @ (tau - pin.nonLinearEffects(model, data, q, v))
        if not self._grips and self._loops is None:
            return np.asarray(G @ np.linalg.solve(mass, force))
        K, drift = self._constraint(q, v)
        solved = np.linalg.solve(mass, np.column_stack([force, K.T]))
        pushes = np.linalg.lstsq(K @ solved[:, 1:], drift - K @ solved[:, 0], rcond=SAME)[0]
        self._forces = np.split(pushes, np.cumsum([len(rows) for *_, rows in self._grips]))[:-1]
        return np.asarray(G @ (solved[:, 0] + solved[:, 1:] @ pushes))

    def latched(self, q: Array, v: Array) -> Array:
        """The velocity after the grips have closed on moving frames, without a bounce ``[nv]``."""
        if not self._grips and self._loops is None:
            return v
        K = self._constraint(q, v)[0]
        solved = np.linalg.solve(self.reduced(mass_matrix(self.model, self.data, q)), K.T)
        w = v[self.free]
        return np.asarray(self._G @ (w - solved @ np.linalg.lstsq(K @ solved, K @ w, rcond=SAME)[0]))

    def wrenches(self) -> dict[str, Array]:
        """On the robot, in the axes of the frame and about its origin, of the last acceleration ``[6]`` [N, N m]."""
        out = {}
        for (name, _, _, rows), force in zip(self._grips, self._forces, strict=True):
            out[name] = np.zeros(6)
            out[name][rows] = force
        return out

    def _constraint(self, q: Array, v: Array) -> tuple[Array, Array]:
        """J G of all grips and loops, and what J a is to be."""
        model, data, rate = self.model, self.data, self._rate
        # Jacobians first: the accelerations are to be those of these velocities alone
        jacobians = [pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL) for _, frame, _, _ in self._grips]
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)
        K, drift = list[Array](), list[Array]()
        for J, (_, frame, grip, rows) in zip(jacobians, self._grips, strict=True):
            gap = data.oMf[frame].actInv(grip.pose)
            if grip.kind is GripKind.POSE:
                error = pin.log6(gap).vector
                bias = pin.getFrameAcceleration(model, data, frame, pin.LOCAL).vector
            else:
                # Of the origin itself, and of the z axis by the turn that brings it to where it is held
                error = np.concatenate([gap.translation, np.cross([0.0, 0.0, 1.0], gap.rotation[:, 2])])
                bias = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL).vector
            K.append(J[rows] @ self._G)
            drift.append((rate * rate * error - bias)[rows] - 2.0 * rate * J[rows] @ v)
        if self._loops is not None:
            error, J, bias = self._looked(q, v)
            K.append(J @ self._G)
            drift.append(-rate * rate * error - bias - 2.0 * rate * J @ v)
        return np.vstack(K), np.concatenate(drift)


def _rows(robot: Robot, model: pin.Model) -> SingleState:
    """(q, v) -> (e, J, (dJ/dt) v) of the loops' rows."""
    tracer = Tracer(Kinematics(model))
    error = robot.loops.error(tracer)
    bias = tracer.second(error, MotionExpressions(tracer.kinematics))[1]
    outputs = [ca.densify(part) for part in (*tracer.expanded(error, ca.densify(tracer.slope(error))), bias)]
    return SingleState(ca.Function("loops", [tracer.q, tracer.v], list(ca.cse(outputs))))

"""An independent build of the same QP, by Pinocchio and numpy: the referee of this package's own answers."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from bench.contender import exact_solution
from bench.problems import Array, Case
from bench.scenery import measured


class Referee:
    """Kinematics of a case by Pinocchio, with none of this package's expressions."""

    def __init__(self, case: Case) -> None:
        """Load the shared description."""
        self.case, self.problem = case, case.problem
        root = (pin.JointModelFreeFlyer(),) if self.problem.floating else ()
        self.model = pin.buildModelFromUrdf(str(case.urdf), *root)
        self.data = self.model.createData()
        self.frames = [self.model.getFrameId(f) for f in self.problem.frames]
        self.first_joint = 6 if self.problem.floating else 0

    def update(self, q: Array) -> None:
        """Compute placements and Jacobians at ``q``."""
        pin.computeJointJacobians(self.model, self.data, q)
        pin.updateFramePlacements(self.model, self.data)
        pin.jacobianCenterOfMass(self.model, self.data, q)

    def errors(self, q: Array, tick: int) -> tuple[float, float]:
        """Largest position error [m], the centre of mass included, and largest rotation error [rad]."""
        self.update(q)
        position, rotation = [0.0], [0.0]
        for frame, pose in zip(self.frames, self.case.poses[tick], strict=True):
            found = self.data.oMf[frame]
            position.append(float(np.linalg.norm(found.translation - pose[:3, 3])))
            rotation.append(float(np.linalg.norm(pin.log3(pose[:3, :3].T @ found.rotation))))
        if self.problem.com:
            position.append(float(np.linalg.norm(self.data.com[0] - self.case.com[tick])))
        return max(position), max(rotation)

    def clearances(self) -> tuple[Array, Array]:
        """Distance of each pair [m], and its derivative, pairs x nv, after :meth:`update`."""
        distances, gradients = [], []
        solids = self.problem.solids
        for pair, found in zip(
            self.problem.pairs, measured(self.model, self.data, solids, self.problem.pairs), strict=True
        ):
            points = [found.getNearestPoint1(), found.getNearestPoint2()]
            first, second = (self._moving(solids[k].link, p) for k, p in zip(pair, points, strict=True))
            distances.append(found.min_distance)
            gradients.append(found.normal @ (second - first))
        return np.array(distances), np.array(gradients).reshape(-1, self.model.nv)

    def _moving(self, link: str, point: Array) -> Array:
        """Jacobian, 3 x nv, of the velocity of a point in the world that a link carries."""
        if not link:
            return np.zeros((3, self.model.nv))
        frame = self.model.getFrameId(link)
        jacobian = pin.getFrameJacobian(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
        return np.asarray(jacobian[:3] - pin.skew(point - self.data.oMf[frame].translation) @ jacobian[3:])

    def velocity(self, q: Array, tick: int) -> Array:
        """Exact solution [rad/s, m/s] of the QP that the problem states at ``q``."""
        self.update(q)
        problem, nv, first = self.problem, self.model.nv, self.first_joint
        gain, length = 1.0 / problem.dt, problem.length
        damping = np.full(nv, problem.damping)
        damping[: 3 if problem.floating else 0] /= length**2
        hessian, linear = np.diag(damping), np.zeros(nv)

        def add(jacobian: Array, error: Array, weight: float) -> None:
            nonlocal hessian, linear
            hessian = hessian + weight * jacobian.T @ jacobian
            linear = linear + weight * gain * jacobian.T @ error

        for frame, pose in zip(self.frames, self.case.poses[tick], strict=True):
            found, wanted = self.data.oMf[frame], pose[:3, :3]
            jacobian = pin.getFrameJacobian(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
            add(jacobian[:3], found.translation - pose[:3, 3], length**-2)
            off = wanted.T @ found.rotation
            turn = wanted @ pin.Jlog3(off) @ found.rotation.T
            add(turn @ jacobian[3:], wanted @ pin.log3(off), 1.0)
        if problem.com:
            add(self.data.Jcom, self.data.com[0] - self.case.com[tick], length**-2)
        joints = np.eye(nv)[first:]
        add(joints, (q - self.case.q0)[-len(joints) :], problem.posture_weight)
        here = q[-len(joints) :]
        speed = self.model.upperVelocityLimit[first:]
        upper = np.minimum(speed, (self.model.upperPositionLimit[-len(joints) :] - here) * gain)
        lower = np.maximum(-speed, (self.model.lowerPositionLimit[-len(joints) :] - here) * gain)
        distances, gradients = self.clearances()
        rows = np.vstack([joints, -joints, -gradients])
        sides = np.concatenate([upper, -lower, problem.rate * (distances - problem.margin)])
        return exact_solution(hessian, linear, rows, sides)

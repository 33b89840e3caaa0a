"""Where a contender's path has led, by Pinocchio: with none of this package's expressions."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from bench.problems import Array, Case


class Referee:
    """Kinematics of a case."""

    def __init__(self, case: Case) -> None:
        """Load the shared description."""
        self.case, self.problem = case, case.problem
        root = (pin.JointModelFreeFlyer(),) if self.problem.floating else ()
        self.model = pin.buildModelFromUrdf(str(case.urdf), *root)
        self.data = self.model.createData()
        self.frames = [self.model.getFrameId(f) for f in self.problem.frames]

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

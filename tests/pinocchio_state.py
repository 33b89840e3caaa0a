"""What Pinocchio says of a robot in one state: its dynamics, its centre of mass, and how its frames move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc.symbolic.kinematics import frame_index

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class FrameState:
    """A frame's pose; its Jacobian, twist and (dJ/dt) v at its origin along the world's axes, and its Jacobian along
    its own axes.
    """

    pose: pin.SE3
    J: Array
    twist: Array
    bias: Array
    local: Array


class PinocchioState:
    """A model at q and v; M [nv, nv] and h [nv] of M a + h = tau."""

    def __init__(self, model: pin.Model, q: Array, v: Array) -> None:
        self.model, self.data, self.q, self.v = model, model.createData(), q, v
        self.M = pin.crba(model, self.data, q).copy()
        self.h = pin.nonLinearEffects(model, self.data, q, v).copy()
        self.center_J = pin.jacobianCenterOfMass(model, self.data, q).copy()
        # without joint accelerations what is left of a task's acceleration is (dJ/dt) v
        pin.centerOfMass(model, self.data, q, v, np.zeros(model.nv))
        self.center, self.center_bias = self.data.com[0].copy(), self.data.acom[0].copy()
        pin.computeJointJacobians(model, self.data, q)
        pin.forwardKinematics(model, self.data, q, v, np.zeros(model.nv))
        pin.updateFramePlacements(model, self.data)

    def frame(self, name: str) -> FrameState:
        """The motion of a frame by name."""
        index, along = frame_index(self.model, name), pin.LOCAL_WORLD_ALIGNED
        J, local = (np.array(pin.getFrameJacobian(self.model, self.data, index, axes)) for axes in (along, pin.LOCAL))
        bias = pin.getFrameClassicalAcceleration(self.model, self.data, index, along).vector.copy()
        return FrameState(self.data.oMf[index].copy(), J, J @ self.v, bias, local)

"""Loading robots (first slice: three URDFs by name)."""

from __future__ import annotations

import pathlib

import numpy as np
import pinocchio as pin

from wbc.robot.limits import Limits
from wbc.robot.robot import Robot

_TABLE = {
    "panda": ("panda_description/urdf/panda.urdf", "fixed", ("panda_finger_joint1", "panda_finger_joint2")),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "fixed", ()),
    "talos": ("talos_data/robots/talos_reduced.urdf", "floating", ()),
}


def load(name: str) -> Robot:
    """A robot by name."""
    file, base, locked = _TABLE[name]
    folder = pathlib.Path(pin.__file__).parents[4] / "share/example-robot-data/robots"
    args = (pin.JointModelFreeFlyer(),) if base == "floating" else ()
    model = pin.buildModelFromUrdf(str(folder / file), *args)
    if locked:
        model = pin.buildReducedModel(model, [model.getJointId(n) for n in locked], pin.neutral(model))
    nv = model.nv
    lower, upper = np.full(nv, -np.inf), np.full(nv, np.inf)
    for j in range(1, model.njoints):
        if model.nqs[j] == model.nvs[j]:
            iv, iq, n = model.idx_vs[j], model.idx_qs[j], model.nvs[j]
            lower[iv : iv + n] = model.lowerPositionLimit[iq : iq + n]
            upper[iv : iv + n] = model.upperPositionLimit[iq : iq + n]
    velocity = np.array(model.upperVelocityLimit)
    effort = np.array(model.upperEffortLimit)
    velocity[velocity == 0] = np.inf
    if base == "floating":
        velocity[:6], effort[:6] = np.inf, np.inf
    return Robot(name, model, Limits(lower, upper, velocity, np.full(nv, np.inf), effort), base,
                 neutral=pin.neutral(model))

"""From one configuration to the next: ``move(q, v, dt)`` is q (+) v dt, for ticks that follow each other in C."""

from __future__ import annotations

import casadi as ca

from wbc.stack.declaration import Declaration
from wbc.symbolic.kinematics import Kinematics


def motion(stack: Declaration) -> ca.Function:
    """The function of a stack's robot."""
    kinematics, dt = Kinematics(stack.robot.model), ca.SX.sym("dt")
    later = kinematics.integrate(kinematics.q, kinematics.v * dt)
    return ca.Function("move", [kinematics.q, kinematics.v, dt], [ca.densify(later)], ["q", "v", "dt"], ["later"])

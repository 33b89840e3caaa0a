"""Accelerations at which all joints can brake together, where the mass matrix and the torque limits decide.

``JointLimits`` counts on decelerations up to ``robot.limits.acceleration`` in every state. The motors have them in a
state (q, v) for all directions in which joints may move if

    |h(q, v)|_k + s sum_j |M_kj(q)| A_j <= share T_k      for every joint k,

A the accelerations that are asked for, s their scale. The largest s of many random states is found here: it is sampled,
not proven. Where none of n independent states allows less, with a confidence of 95 % less than a share 3 / n of all
states does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from wbc import validation
from wbc.errors import CommandError, RangeError
from wbc.robot import Robot
from wbc.validation import Array


@dataclass(frozen=True, eq=False)
class Braking:
    """What :func:`braking` found.

    Attributes:
        acceleration: at which every joint can brake, in all states that were tried [nv, rad/s^2, m/s^2].
        scale: s, by which the accelerations that were asked for are less, at most 1. joint: whose motor decides.
        q, v: the state in which it does. samples: how many states were tried.
    """

    acceleration: Array
    scale: float
    joint: str
    q: Array
    v: Array
    samples: int


def braking(robot: Robot, *, share: float = 0.95, samples: int = 2000, seed: int = 0) -> Braking:
    """Accelerations for ``robot.with_limits(acceleration=...)`` that the motors have wherever the robot is.

        robot = robot.with_limits(acceleration=wbc.support.braking(robot).acceleration)

    Args:
        robot: on a fixed base, with finite limits of acceleration and torque. share: part of the torques that braking
            may take. samples: random configurations within the limits, each with a random velocity within its limits; a
            third of the velocities are full speed, a third rest. seed: of the random states.

    Raises:
        CommandError: the base floats: what its joints can brake is up to the contacts. RangeError: a limit that is not
            finite, or motors that cannot carry the robot, with the joint and the torque that is missing.
    """
    if robot.base != "fixed":
        raise CommandError("robot", robot.name, "what joints on a base that moves can brake is up to its contacts")
    count = validation.integer("samples", samples, low=1)
    part = validation.scalar("share", share, low=0.0, high=1.0, open_low=True)
    limits, model, random = robot.limits, robot.model, np.random.default_rng(validation.integer("seed", seed))
    for name in ("acceleration", "effort", "velocity"):
        if not np.isfinite(values := getattr(limits, name)).all():
            joint = robot.dof_names[int(np.argmin(np.isfinite(values)))]
            raise RangeError(f"robot.limits.{name}", np.inf, f"expected a finite limit of {joint!r}")
    data, least, found = model.createData(), 1.0, (robot.dof_names[0], robot.neutral, np.zeros(robot.nv))
    low, high = (
        np.where(np.isfinite(x), x, s * np.pi) for x, s in ((limits.position_lower, -1), (limits.position_upper, 1))
    )
    for k in range(count):
        q = pin.neutral(model)
        for i, place in enumerate(robot.position_index):
            if place >= 0:
                q[place] = random.uniform(low[i], high[i])
        v = limits.velocity * (random.uniform(-1, 1, robot.nv) if k % 3 else random.choice([-1.0, 1.0], robot.nv))
        v *= k % 3 != 1
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        left = part * limits.effort - np.abs(pin.nonLinearEffects(model, data, q, v))
        motor = int(np.argmin(left / (np.abs(M) @ limits.acceleration)))
        if left[motor] <= 0.0:
            reason = (
                f"{robot.dof_names[motor]!r} lacks {-left[motor]:.3g} to carry the robot at {np.round(q, 3).tolist()}"
            )
            raise RangeError("robot.limits.effort", float(limits.effort[motor]), reason)
        scale = float(left[motor] / (np.abs(M[motor]) @ limits.acceleration))
        if scale < least:
            least, found = scale, (robot.dof_names[motor], q, v)
    return Braking(least * limits.acceleration, least, *found, count)

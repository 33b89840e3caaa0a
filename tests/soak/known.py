"""Problems with a velocity that is known to meet every row: no tick may fall back, and the optimum is the referee's."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pinocchio as pin

from tests.judges.quadprog_qp import SAME, distance
from tests.models import frame_jacobian, placement
from tests.soak.episodes import label
from tests.soak.machines import configuration, machine
from tests.soak.stacks import DT, pose, weight
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.robot import Robot
from wbc.shapes import Sphere
from wbc.tasks import EndEffector, FrameVelocityLimit, Hold, JointLimits, Obstacle, Posture
from wbc.validation import Array

#: Gain of the holds [1/s]
GAIN = 2.0


def feasible_stack(robot: Robot, rng: np.random.Generator) -> Stack:
    """A hand and a posture against a hold, a speed limit and a ball."""
    last = sum(str(frame.name).startswith("f") for frame in robot.model.frames) - 1
    stack = Stack(robot, dt=DT)
    stack.add(EndEffector(f"f{last}"), name="hand", weight=weight(rng))
    stack.add(Posture(), name="posture", weight=float(10.0 ** rng.uniform(-4.0, 0.0)))
    stack.add(JointLimits(), name="limits")
    stack.add(Hold(f"f{last // 2}", kind="position", gain=GAIN), name="hold")
    stack.add(FrameVelocityLimit(f"f{last}", linear=10.0), name="speed")
    stack.add(Obstacle(Sphere(0.05)), name="ball")
    return stack


def pose_problem(controller: Controller, rng: np.random.Generator) -> tuple[Array, Array]:
    """A state, and a velocity that meets every row: targets of constraints are put where that velocity leads."""
    robot = controller.stack.robot
    last = sum(str(frame.name).startswith("f") for frame in robot.model.frames) - 1
    q = configuration(robot, rng, outside=False)
    controller.reset(q)
    controller["hand"].target = pose(rng)
    controller["ball"].pose = pin.SE3(np.eye(3), np.array([50.0, 0.0, 0.0]))
    controller["hold"].enabled = False
    # The bounds are those of the configuration in the buffers, which is that of the last step until the next one
    core_of(controller).tick.q[:] = q
    bounds = controller.qp()
    low, high = np.maximum(bounds.lower[: robot.nv], -1.0), np.minimum(bounds.upper[: robot.nv], 1.0)
    v: Array = low + (high - low) * rng.uniform(0.25, 0.75, robot.nv)
    frame = f"f{last // 2}"
    held = placement(robot, frame, q)
    held.translation[:] += frame_jacobian(robot, frame, q)[:3] @ v / GAIN
    controller["hold"].target, controller["hold"].enabled = held, True
    return q, v


def problems(seed: int, k: int, backend: str, states: int) -> list[tuple[str, Counter[str]]]:
    """A stack with ``states`` problems: how they ended; ``wrong: ...`` for what must not be."""
    rng = np.random.default_rng([seed, 7, k])
    controller = feasible_stack(machine(rng), rng).compile(backend=backend)
    counts = Counter[str]()
    for _ in range(states):
        q, v = pose_problem(controller, rng)
        step = controller.step(q)
        counts[label(step)] += 1
        # the buffers still hold the tick, but for the velocity that accelerations count from
        core_of(controller).tick.v_last[:] = 0.0
        qp = controller.qp()
        if qp.violation(v).max() > 1e-9:
            counts["wrong: the known velocity is not feasible"] += 1
        elif step.status != "solved":
            counts["wrong: degraded although a velocity meets all rows"] += 1
        else:
            off = distance(qp, step.v)
            counts["referee gives up"] += off is None
            if off is not None and off > SAME:
                counts["wrong: another optimum than the referee's"] += 1
    return [(f"known {seed}/{k}: {controller.stack.robot.nv} dof", counts)]

"""What a redundant arm can do while its hand stays: shown on demand, commanded never."""

from __future__ import annotations

import numpy as np

from wbc.multibody import pin
from wbc.robot import Robot
from wbc.validation import Array

#: Largest joint step between two pictures [rad]
STEP = 0.03
#: Pictures each way
PICTURES = 60
#: A singular value below this part of the largest is none
FLAT = 1e-6
#: The hand strays less than this [m, rad]
STAYS = 1e-3


def self_motion(robot: Robot, frame: str, q: Array, rows: int = 6) -> list[Array]:
    """Configurations from q and back to q, one way and the other, with the frame where it is at q.

        dq = N N' d,  J N = 0       then      q <- q (+) J^+ e        until a limit, or MOST steps

    N spans the null space of the frame's Jacobian by the joints behind the base, d is the last direction.

    Args:
        rows: 6 for a pose, 3 for a position.

    Returns:
        None of them where no joint can move without the frame.
    """
    out: list[Array] = []
    for sign in (1.0, -1.0):
        way = _one_way(robot, frame, q, rows, sign)
        out += [*way, *way[-2::-1], q] if way else []
    return out


def _one_way(robot: Robot, frame: str, q: Array, rows: int, sign: float) -> list[Array]:
    model, data = robot.model, robot.model.createData()
    number, base = model.getFrameId(frame), robot.base_nv
    pin.framesForwardKinematics(model, data, q)
    home, here, direction, out = data.oMf[number].copy(), q.copy(), np.zeros(0), list[Array]()
    for _ in range(PICTURES):
        J = pin.computeFrameJacobian(model, data, here, number, pin.LOCAL_WORLD_ALIGNED)[:rows, base:]
        moves = np.abs(J).max(axis=0) > FLAT
        _, sizes, turned = np.linalg.svd(J[:, moves])
        kernel = turned[int((sizes > FLAT * max(float(sizes.max(initial=0.0)), FLAT)).sum()) :]
        if not len(kernel):
            return out
        wanted = kernel[0] * sign if not len(direction) else kernel.T @ (kernel @ direction)
        largest = float(np.abs(wanted).max())
        if largest < FLAT:
            return out
        direction = wanted / largest
        step = np.zeros(robot.nv)
        step[np.flatnonzero(moves) + base] = STEP * direction
        there = robot.integrate(here, step, 1.0)
        for _ in range(3):
            pin.framesForwardKinematics(model, data, there)
            error = _error(home, data.oMf[number])[:rows]
            J = pin.computeFrameJacobian(model, data, there, number, pin.LOCAL_WORLD_ALIGNED)[:rows, base:]
            back = np.zeros(robot.nv)
            back[base:] = np.linalg.pinv(J, rcond=1e-4) @ error
            there = robot.integrate(there, back, 1.0)
        pin.framesForwardKinematics(model, data, there)
        if np.abs(_error(home, data.oMf[number])[:rows]).max() > STAYS or not _within(robot, there):
            return out
        here = there
        out.append(here)
    return out


def _error(wanted: pin.SE3, here: pin.SE3) -> Array:
    turn = pin.log3(wanted.rotation @ here.rotation.T)
    return np.concatenate([wanted.translation - here.translation, turn])


def _within(robot: Robot, q: Array) -> bool:
    places = np.asarray(robot.position_index)
    known = places >= 0
    at = q[places[known]]
    limits = robot.limits
    return bool((at >= limits.position_lower[known]).all() and (at <= limits.position_upper[known]).all())

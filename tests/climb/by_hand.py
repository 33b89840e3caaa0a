"""Plans made by hand for bodies with point feet on a level floor: no planner is asked."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from wbc.climb import Climber, ClimbScene, ContactMove, ContactPlan, Foothold, machines
from wbc.shapes import Box, PlacedShape
from wbc.validation import Array

#: Limbs of the hexapod that lift together
TRIPODS = ((0, 2, 4), (1, 3, 5))


@functools.cache
def climber(name: str = "hexapod") -> Climber:
    return machines.climber(name)


def standing(machine: Climber) -> tuple[Array, Array]:
    """(q, feet ``[n, 3]``): at rest with all feet on z = 0."""
    places = np.array([machine.contact_pose(machine.rest, k).translation for k in range(len(machine.limbs))])
    q = np.array(machine.rest)
    q[2] -= places[:, 2].mean()
    places[:, 2] = 0.0
    return posture(machine, q[:3], places, q), places


def posture(machine: Climber, body: Array, places: Array, start: Array) -> Array:
    """Body at ``[3]`` and feet at places, from a start, by Newton's method on each limb."""
    robot = machine.robot
    q, model, data = np.array(start), robot.model, robot.model.createData()
    q[:3] = body
    for _ in range(60):
        v, worst = np.zeros(robot.nv), 0.0
        pin.computeJointJacobians(model, data, q)
        for k, place in enumerate(places):
            limb, dofs = machine.limbs[k], machine.joints(k)
            frame = model.getFrameId(limb.frame)
            tip = pin.updateFramePlacement(model, data, frame)
            jacobian = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            arm = tip.rotation @ limb.placement.translation
            linear = (jacobian[:3] - pin.skew(arm) @ jacobian[3:])[:, dofs]
            off = tip.translation + arm - place
            v[dofs], worst = -np.linalg.solve(linear, off), max(worst, float(np.linalg.norm(off)))
        if worst < 1e-12:
            break
        q = pin.integrate(model, q, np.clip(v, -0.3, 0.3))
    return q


def gait(
    steps: Sequence[Sequence[int]] = TRIPODS * 2, stride: float = 0.04, *, machine: Climber | None = None,
    swing: float = 0.6, rest: float = 0.2, lift: float = 0.05,
) -> ContactPlan:  # fmt: skip
    """Limbs of each of ``steps`` go on together by 2 ``stride`` in x, while the body goes on by ``stride``."""
    machine = machine or climber()
    q, places = standing(machine)
    body, rows, known, moves, time = q[:3].copy(), list(range(len(places))), [*places], list[ContactMove](), rest
    knots: list[tuple[float, Array, Array]] = [(0.0, body, places)]
    for limbs in steps:
        after = places.copy()
        after[list(limbs), 0] += 2.0 * stride
        for x in np.linspace(0.0, 1.0, round(swing / 0.02) + 1)[(1 if len(knots) > 1 else 0) :]:
            s = 10 * x**3 - 15 * x**4 + 6 * x**5
            there = places + s * (after - places)
            there[list(limbs), 2] += lift * 64.0 * (x * (1 - x)) ** 3
            knots.append((time + x * swing, body + [s * stride, 0.0, 0.0], there))
        for limb in limbs:
            known.append(after[limb])
            moves.append(ContactMove(limb, rows[limb], len(known) - 1, time, time + swing))
            rows[limb] = len(known) - 1
        body, places, time = body + [stride, 0.0, 0.0], after, time + swing + rest
        knots.append((time, body, places))
    times, found = np.array([t for t, *_ in knots]), []
    for _, at, there in knots:
        q = posture(machine, at, there, q)
        found.append(q)
    model, v = machine.robot.model, np.zeros((len(found), machine.robot.nv))
    for k in range(1, len(found) - 1):
        a, b = times[k] - times[k - 1], times[k + 1] - times[k]
        back, on = pin.difference(model, found[k - 1], found[k]) / a, pin.difference(model, found[k], found[k + 1]) / b
        v[k] = (b * back + a * on) / (a + b)
    for move in moves:
        v[np.isclose(times, move.lift) | np.isclose(times, move.land)] = 0.0
    return ContactPlan(machine, level(known), tuple(range(len(places))), moves, times, np.array(found), v)


def level(places: Sequence[Array]) -> ClimbScene:
    """A level floor with footholds at places."""
    footholds = [Foothold(f"p{k}", pin.SE3(np.eye(3), np.array(place)), on="floor", friction=0.8)
                 for k, place in enumerate(places)]  # fmt: skip
    floor = PlacedShape(Box((6.0, 4.0, 0.2)), pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.1])))
    return ClimbScene(footholds, {"floor": floor}, name="level floor")

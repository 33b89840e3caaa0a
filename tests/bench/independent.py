"""An independent build of a problem's QP, by Pinocchio, Coal and numpy, and how far answers are from its minimiser."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from bench.ours import Ours
from bench.problems import Array
from bench.reference import Referee
from bench.scenery import measured
from tests.judges.quadprog_qp import distance
from wbc.controller import core_of
from wbc.qp import QP

AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def stated(referee: Referee, q: Array, tick: int) -> QP:
    """The QP of the problem at a configuration."""
    referee.update(q)
    case, problem, model, data = referee.case, referee.problem, referee.model, referee.data
    first = 6 if problem.floating else 0
    gain, length = 1.0 / problem.dt, problem.length
    damping = np.full(model.nv, problem.damping)
    damping[: 3 if problem.floating else 0] /= length**2
    joints = np.eye(model.nv)[first:]
    terms = [(joints, (q - case.q0)[-len(joints) :], problem.posture_weight)]
    for frame, pose in zip(referee.frames, case.poses[tick], strict=True):
        found, wanted = data.oMf[frame], pose[:3, :3]
        jacobian = pin.getFrameJacobian(model, data, frame, AXES)
        off = wanted.T @ found.rotation
        turn = wanted @ pin.Jlog3(off) @ found.rotation.T
        terms.append((jacobian[:3], found.translation - pose[:3, 3], length**-2))
        terms.append((turn @ jacobian[3:], wanted @ pin.log3(off), 1.0))
    if problem.com:
        terms.append((data.Jcom, data.com[0] - case.com[tick], length**-2))
    H = np.diag(damping) + sum(weight * J.T @ J for J, _, weight in terms)
    g = sum(weight * gain * J.T @ e for J, e, weight in terms)
    upper = np.minimum(model.upperVelocityLimit, np.inf)
    upper[:first] = np.inf
    lower, here = -upper, q[-len(joints) :]
    upper[first:] = np.minimum(upper[first:], (model.upperPositionLimit[-len(joints) :] - here) * gain)
    lower[first:] = np.maximum(lower[first:], (model.lowerPositionLimit[-len(joints) :] - here) * gain)
    distances, gradients = clearances(referee)
    sides = problem.rate * (problem.margin - distances)
    bounds = np.append(lower, sides), np.append(upper, np.full(len(sides), np.inf))
    return QP(H=H, g=g, A=gradients, lower=bounds[0], upper=bounds[1])


def clearances(referee: Referee) -> tuple[Array, Array]:
    """Distance of each pair [m], and its derivative, pairs x nv, where the referee was updated."""
    distances, gradients = [], []
    problem, model, data = referee.problem, referee.model, referee.data
    for pair, found in zip(problem.pairs, measured(model, data, problem.solids, problem.pairs), strict=True):
        points = [found.getNearestPoint1(), found.getNearestPoint2()]
        first, second = (_moving(referee, problem.solids[k].link, p) for k, p in zip(pair, points, strict=True))
        distances.append(found.min_distance)
        gradients.append(found.normal @ (second - first))
    return np.array(distances), np.array(gradients).reshape(-1, model.nv)


def _moving(referee: Referee, link: str, point: Array) -> Array:
    """Jacobian, 3 x nv, of the velocity of a point in the world that a link carries."""
    if not link:
        return np.zeros((3, referee.model.nv))
    frame = referee.model.getFrameId(link)
    jacobian = pin.getFrameJacobian(referee.model, referee.data, frame, AXES)
    return np.asarray(jacobian[:3] - pin.skew(point - referee.data.oMf[frame].translation) @ jacobian[3:])


def worst_error(ours: Ours, qp_of: Callable[[Array, int], QP] | None = None) -> float:
    """Largest error of the answer along the path, every tenth tick [rad/s, m/s]: from the minimiser of the QP that
    ``qp_of`` states, or that its own tick solves.
    """
    ours.reset()
    errors = []
    for k in range(ours.case.ticks):
        ours.aim(k)
        if k % 10 == 0:
            tick = core_of(ours.controller).tick
            tick.q[:] = ours.q
            qp = tick.qp() if qp_of is None else qp_of(ours.q, k)
            off = distance(qp, ours.controller.step(ours.q).v)
            assert off is not None
            errors.append(off)
        ours.call()
        ours.settle()
    return max(errors)

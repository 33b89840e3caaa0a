"""What holds of a plan between its knots, by Pinocchio and Coal alone."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from tests.distances import coal_distance
from wbc.climb.contacts import PointFoot
from wbc.climb.plan import ContactPlan
from wbc.climb.stance import FREE_LIMB
from wbc.validation import Array


def between(plan: ContactPlan, parts: int) -> tuple[Array, Array]:
    """Times and configurations of the cubics between knots, ``parts`` to an interval."""
    model, times, out = plan.climber.robot.model, list[float](), list[Array]()
    for (t, s), (q, r), (v, w) in zip(pairwise(plan.times), pairwise(plan.q), pairwise(plan.v), strict=True):
        h, step = s - t, pin.difference(model, q, r)
        last = pin.dDifference(model, q, r, pin.ArgumentPosition.ARG1) @ w
        for x in np.arange(parts) / parts:
            moved = x**2 * (3 - 2 * x) * step + h * (x * (1 - x) ** 2 * v - x**2 * (1 - x) * last)
            times.append(t + x * h)
            out.append(pin.integrate(model, q, moved))
    return np.array([*times, plan.times[-1]]), np.array([*out, plan.q[-1]])


def holding(plan: ContactPlan, time: float) -> list[int]:
    """Footholds that limbs hold at a time."""
    out = list(plan.start)
    for move in plan.moves:
        if time > move.lift + 1e-9:
            out[move.limb] = move.lands if time >= move.land - 1e-9 else FREE_LIMB
    return out


def off(plan: ContactPlan, limb: int, row: int, q: Array) -> float:
    """How far a contact frame is from where it holds a foothold [m]: of a ball's centre, its radius over it."""
    contact, foothold = plan.climber.limbs[limb].contact, plan.scene.footholds[row].pose
    over = contact.radius if isinstance(contact, PointFoot) else 0.0
    place = foothold.translation + over * foothold.rotation[:, 2]
    return float(np.linalg.norm(plan.climber.contact_pose(q, limb).translation - place))


def slipped(plan: ContactPlan, times: Array, q: Array) -> float:
    """Farthest that a contact that holds is from its foothold [m]."""
    climber, most = plan.climber, 0.0
    for time, at in zip(times, q, strict=True):
        for limb, row in enumerate(holding(plan, time)):
            if row != FREE_LIMB:
                pose, foothold = climber.contact_pose(at, limb), plan.scene.footholds[row].pose
                most = max(most, off(plan, limb, row, at))
                if climber.fixed(limb) != "position":
                    most = max(most, float(np.linalg.norm(np.cross(pose.rotation[:, 2], foothold.rotation[:, 2]))))
    return most


def fastest_share(plan: ContactPlan, times: Array, q: Array) -> tuple[float, float]:
    """Largest shares of the joints' velocity and acceleration limits that differences between instants have."""
    model, limits = plan.climber.robot.model, plan.climber.robot.limits
    steps = np.array([pin.difference(model, a, b) for a, b in pairwise(q)])
    v = steps / np.diff(times)[:, None]
    a = np.diff(v, axis=0) / (0.5 * (np.diff(times)[1:] + np.diff(times)[:-1]))[:, None]
    joints = slice(6, None)
    return (
        float((np.abs(v[:, joints]) / limits.velocity[joints]).max()),
        float((np.abs(a[:, joints]) / limits.acceleration[joints]).max()),
    )


def body_speeds(plan: ContactPlan, times: Array, q: Array) -> tuple[float, float]:
    """Largest speed [m/s] and turn rate [rad/s] of the body."""
    poses = [plan.climber.body_pose(x) for x in q]
    steps = list(zip(pairwise(poses), np.diff(times), strict=True))
    speeds = [np.linalg.norm(b.translation - a.translation) / h for (a, b), h in steps]
    turns = [np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)) / h for (a, b), h in steps]
    return float(max(speeds)), float(max(turns))


def least_distances(plan: ContactPlan, q: Array) -> tuple[float, float]:
    """Least distances of links that must not touch, and of links but the limbs' last ones from bodies [m]."""
    climber, robot = plan.climber, plan.climber.robot
    model, data = robot.model, robot.model.createData()
    tips = {chain[-1] for chain in climber.chains}
    mine, other = np.inf, np.inf
    for at in q:
        pin.framesForwardKinematics(model, data, at)
        placed = {
            link: [(s.shape, data.oMf[model.getFrameId(link)] * s.placement) for s in group]
            for link, group in robot.shapes.items()
        }
        for a, b in robot.self_pairs or ():
            for (one, there), (two, here) in ((x, y) for x in placed.get(a, ()) for y in placed.get(b, ())):
                mine = min(mine, coal_distance(one, there, two, here))
        for link, group in placed.items():
            if model.frames[model.getFrameId(link)].parentJoint not in tips:
                for body in plan.scene.bodies.values():
                    other = min([other, *(coal_distance(s, x, body.shape, body.placement) for s, x in group)])
    return mine, other

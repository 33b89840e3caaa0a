"""Curvature of loops, found along axes that do not turn, is that of their residuals along motions of closed loops."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.loops.mechanisms import NAMED, random_linkage
from wbc.robot import Robot
from wbc.stack.layout import Layout
from wbc.stack.program import build
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.tracer import Tracer

#: Step of differences along a motion [rad, m], and by how much they may be off
STEP, OFF = 1e-3, 1e-5
#: Linkages of connects, then of welds
SEEDS = (0, 2, 4, 7)
TEXTS = {name: NAMED[name] for name in ("four_bar", "ankle", "delta", "jansen")} | {
    f"linkage{seed}": random_linkage(seed) for seed in SEEDS
}


def kept(robot: Robot) -> ca.Function:
    """e(q) of all loops."""
    tracer = Tracer(Kinematics(robot.tree))
    return ca.Function("e", [tracer.q], [tracer.expand(robot.loops.error(tracer))])


@pytest.mark.parametrize("name", TEXTS)
def test_second_derivative_along_closed_motions(name: str) -> None:
    robot = wbc.robots.load(TEXTS[name], shapes="none")
    rng, error, stack = np.random.default_rng(0), kept(robot), wbc.Stack(robot, 0.01).add(wbc.tasks.Posture())
    layout = Layout(stack)
    curvature = build(stack, layout).curvature
    assert curvature is not None
    force = np.zeros(layout.task_rows + layout.general_rows)
    force[layout.task_rows :] = rng.normal(size=layout.general_rows)
    for q in (robot.random(seed) for seed in range(3)):
        K = np.array(curvature(q, np.zeros(robot.nv), np.zeros(layout.parameters), 0.01, force))
        K += np.triu(K, 1).T
        _, sizes, axes = np.linalg.svd(robot._tied(q))
        free = axes[int((sizes > 1e-9).sum()) :]
        v = free.T @ rng.normal(size=len(free))
        ends = [np.array(error(pin.integrate(robot.model, q, s * STEP * v)))[:, 0] for s in (-1.0, 0.0, 1.0)]
        bend = force[layout.task_rows :] @ (ends[0] - 2.0 * ends[1] + ends[2]) / STEP**2
        assert v @ K @ v == pytest.approx(bend, abs=OFF * (1.0 + v @ v))

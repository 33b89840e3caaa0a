"""Rows that v can hardly move because joints are pinned: a tick that says solved keeps them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.backends import COMPILED, IN_PYTHON, way
from tests.closed_loop.machines import anywhere
from tests.controller.stacks import FRAMES, robot
from wbc.api import Stack
from wbc.controller import Status
from wbc.tasks import CenterOfMass, EndEffector, JointLimits, Limit, Posture


@pytest.mark.parametrize("backend", [COMPILED, IN_PYTHON])
def test_solved_means_held(backend: str) -> None:
    """A limit on the centre of mass far from where it is, joints at speed: most ticks relax, none says it held."""
    bare = replace(robot("panda"), couplings=(), locked_dofs=())
    speed = np.where(np.isfinite(bare.limits.velocity), bare.limits.velocity, 1.0)
    machine = bare.with_limits(velocity=speed, acceleration=10.0)
    stack = Stack(machine, 0.01).add(Limit(CenterOfMass(), upper=0.3, only="z"), name="height")
    stack.add(Posture(), name="rest").add(JointLimits()).add(EndEffector(FRAMES["panda"].tip, kind="position"))
    controller, rng, relaxed = stack.compile(**way(backend)), np.random.default_rng(0), 0
    for _ in range(80 if backend == COMPILED else 25):
        q, v = anywhere(machine, rng), rng.uniform(-0.3, 0.3, machine.nv) * speed
        controller.reset(q)
        controller["height"].set(target=np.zeros(3), upper=rng.uniform(-2, 1, 1), rate=rng.uniform(5, 49))
        step = controller.step(q, v)
        relaxed += step.status is Status.RELAXED
        if step.status is Status.SOLVED:
            assert step.certificate.violation < 1e-6
    assert relaxed > 10

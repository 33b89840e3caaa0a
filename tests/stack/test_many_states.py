"""Expressions at many states: compiled code, the virtual machine and Pinocchio give one answer."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from wbc.native import toolchain
from wbc.stack.evaluation import CHUNK, ManyStates
from wbc.trajectory.least_time.checks import inverse_dynamics


@pytest.mark.parametrize("name", ["panda", "ur5"])
@pytest.mark.parametrize("count", [1, CHUNK, 2 * CHUNK + 3])
def test_inverse_dynamics_are_those_of_pinocchio(name: str, count: int) -> None:
    robot = wbc.robots.load(name)
    rng = np.random.default_rng(count)
    q = np.array([pin.integrate(robot.model, robot.neutral, rng.normal(size=robot.nv)) for _ in range(count)])
    v, a = rng.normal(size=(2, count, robot.nv))
    data = robot.model.createData()
    wanted = np.array([pin.rnea(robot.model, data, *state) for state in zip(q, v, a, strict=True)])
    torques = inverse_dynamics(robot)
    assert torques.compiled == toolchain.available()
    assert np.abs(torques(q, v, a) - wanted).max() <= 1e-12 * np.abs(wanted).max()


def test_without_a_compiler_the_same_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = wbc.robots.load("ur5")
    inverse_dynamics.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(toolchain, "available", lambda: False)
        virtual = inverse_dynamics(robot)
    inverse_dynamics.cache_clear()
    assert not virtual.compiled
    rng = np.random.default_rng(1)
    q, v, a = rng.normal(size=(3, 40, robot.nv))
    compiled = inverse_dynamics(robot)(q, v, a)
    assert np.abs(virtual(q, v, a) - compiled).max() <= 1e-12 * np.abs(compiled).max()


def test_a_failing_compiler_is_said_and_replaced(monkeypatch: pytest.MonkeyPatch, tmp_path: object) -> None:
    import casadi as ca

    monkeypatch.setenv("WBC_CACHE", str(tmp_path))
    monkeypatch.setattr(toolchain, "compiler", lambda: "/bin/false")
    monkeypatch.setattr(toolchain, "available", lambda: True)
    x = ca.SX.sym("x", 2)
    double = ManyStates(ca.Function("double", [x], [2.0 * x]))
    assert not double.compiled
    assert (double(np.ones((3, 2))) == 2.0).all()

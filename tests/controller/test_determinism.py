"""The same inputs give the same bits, whatever else runs; and commands that are integrated reach the target."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, controller, inside, robot
from wbc import Controller, Stack
from wbc.tasks import JointLimits, Posture

BACKENDS = (IN_PYTHON, COMPILED)


def arm(backend: str) -> Controller:
    return controller("arm", "panda", **way(backend))


def ticks(one: Controller, seed: int, count: int = 25) -> Iterator[bytes]:
    """A loop with targets, switches, measured velocities and changing dt; all numbers of each tick."""
    rng, model = np.random.default_rng(seed), robot("panda").model
    q = inside(robot("panda"), rng, 0.4)
    for tick in range(count):
        dt = DT * rng.uniform(0.25, 2.0) if tick % 2 else None
        if tick % 5 == 1:
            one["hand"].target = pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-0.6, 0.6, 3))
            one["hand"].mask = rng.uniform(0.0, 2.0, 6)
            one["ball"].pose = pin.SE3(np.eye(3), rng.uniform(-0.5, 0.5, 3))
        step = one.step(q, one.last_command if tick % 3 == 2 else None, dt)
        q = pin.integrate(model, q, (dt or DT) * step.v)
        yield step._data


@pytest.mark.parametrize("backend", BACKENDS)
def test_two_controllers_of_one_stack_do_not_touch_each_other(backend: str) -> None:
    alone = [list(ticks(arm(backend), seed)) for seed in (1, 2)]
    one, two = arm(backend), arm(backend)
    assert one.stack is two.stack
    in_turn = list(zip(ticks(one, 1), ticks(two, 2), strict=True))
    assert [list(part) for part in zip(*in_turn, strict=True)] == alone
    one["hand"].weight, one["hand"].enabled, one["posture"].target = 0.0, False, np.zeros(7)
    assert two["hand"].weight == 1.0
    assert two["hand"].enabled
    assert two["posture"].target.any()
    assert str(one) != str(two)


def digest(backend: str) -> str:
    return hashlib.sha256(b"".join(ticks(arm(backend), 3))).hexdigest()


PROGRAM = f"from tests.controller.test_determinism import digest; print(*[digest(b) for b in {BACKENDS!r}])"


def test_the_same_inputs_give_the_same_bits_in_any_process() -> None:
    here = [digest(b) for b in BACKENDS]
    assert here == [digest(b) for b in BACKENDS]
    top = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=top, capture_output=True, text=True, check=True)
    assert done.stdout.split() == here


# --- the loop ---------------------------------------------------------------------------------------


def test_a_robot_of_one_joint() -> None:
    """The smallest problem there is, on both back ends."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    bot = wbc.robots.load(model, position_lower=-1.0, position_upper=1.0, velocity=2.0, acceleration=5.0)
    found: list[np.ndarray] = []
    for backend in BACKENDS:
        one = Stack(bot, DT).add(Posture(), name="posture").add(JointLimits(), name="limits").compile(**way(backend))
        q = np.array([0.2])
        one["posture"].target, one["posture"].gain = [3.0], 5.0
        for _ in range(400):
            q = q + DT * one.step(q).v
        found.append(q)
        assert q == pytest.approx([1.0], abs=1e-6)
        assert q[0] <= 1.0 + 1e-12
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)

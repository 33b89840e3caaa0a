"""Targets in, command out: one call does what setting and stepping do, and refuses what they refuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED
from tests.controller.stacks import DT, everything
from wbc import Controller, Policy, WbcError
from wbc.controller import core_of


def pair(name: str, **how: Any) -> tuple[Controller, Controller]:
    stack = everything(name)
    return tuple(stack.compile(backend=COMPILED, **how) for _ in range(2))  # type: ignore[return-value]


def targets(controller: Controller, rng: np.random.Generator) -> dict[str, Any]:
    """A target of every kind that there is, in turns as arrays, lists and poses."""
    robot, out = controller.stack.robot, dict[str, Any]()
    for entry in controller.stack.tasks:
        if "target" not in controller[entry.name].names:
            continue
        value = controller[entry.name].target
        if isinstance(value, pin.SE3):
            pose = value * pin.exp6(0.1 * rng.normal(size=6))
            out[entry.name] = pose if rng.uniform() < 0.5 else pose.homogeneous
        elif np.shape(value) == (3, 3):
            out[entry.name] = value @ pin.exp3(0.1 * rng.normal(size=3))
        elif np.shape(value) == (robot.nq,):
            out[entry.name] = robot.integrate(value, 0.1 * rng.normal(size=robot.nv))
        else:
            given = value + 0.1 * rng.normal(size=np.shape(value))
            out[entry.name] = given if rng.uniform() < 0.8 or not np.shape(value) else list(given)
    return out


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_it_is_what_setting_and_stepping_are(name: str) -> None:
    """Also with a measured velocity, another dt, what relaxes, resets, and without targets."""
    together, apart = pair(name)
    rng, q = np.random.default_rng(3), together.stack.robot.neutral
    for controller in (together, apart):
        controller.step(q)
    for k in range(60):
        given = targets(apart, rng) if k % 3 else {}
        more = {"v": 0.1 * rng.normal(size=together.stack.robot.nv)} if k % 7 == 6 else {}
        more |= {"dt": 1.5 * DT} if k % 5 == 4 else {}
        step = together.step(q, **more, **given)
        apart.set(**given)
        wanted = apart.step(q, **more)
        assert step._data == wanted._data
        q = together.stack.robot.integrate(q, step.v, DT)
        if k == 30:
            together.reset(q)
            apart.reset(q)


@pytest.mark.parametrize("solver", ["daqp", "osqp"])
def test_first_steps_take_targets(solver: str) -> None:
    together, apart = pair("ur5", solver=solver)
    q, pose = together.stack.robot.neutral, np.eye(4)
    pose[:3, 3] = 0.3
    name = next(n for n in targets_of_poses(together))
    apart.set(**{name: pose})
    assert together.step(q, **{name: pose})._data == apart.step(q)._data


def targets_of_poses(controller: Controller) -> list[str]:
    core = core_of(controller)
    return [
        n for n, block in core.layout.blocks.items() if "target" in block.slots and block.slots["target"].size == 12
    ]


def test_what_is_bad_changes_nothing() -> None:
    controller, _ = pair("panda")
    robot = controller.stack.robot
    q = robot.neutral
    (name, *_) = targets_of_poses(controller)
    good, mirrored, endless = (np.eye(4) for _ in range(3))
    good[:3, 3] = 0.4
    mirrored[0, 0] = -1.0
    endless[0, 3] = np.nan
    controller.step(q, **{name: good})
    controller.step(q, **{name: good})
    before = core_of(controller).tick.state.tobytes()
    bad: list[tuple[Any, dict[str, Any]]] = [
        (q, {name: mirrored}), (q, {name: endless}), (q, {name: np.eye(3)}), (q, {name: "there"}),
        (q, {name: np.ones(16)}), (q, {name: np.eye(4, dtype=complex)}), (q, {name: good, "nobody": good}),
        (np.full(robot.nq, np.nan), {name: good}), (q[:-1], {name: good}), ("q", {name: good}), (q[:, None], {}),
        (None, {}), (q + np.inf, {}),
    ]  # fmt: skip
    for configuration, given in bad:
        with pytest.raises(WbcError):
            controller.step(configuration, **given)
        assert core_of(controller).tick.state.tobytes() == before, (configuration, given)
    with pytest.raises(WbcError):
        controller.step(q, dt=1e9, **{name: good})
    assert core_of(controller).tick.state.tobytes() == before


@pytest.mark.parametrize("made", [list, tuple, memoryview, np.ndarray.copy, lambda q: np.repeat(q, 2)[::2]])
def test_what_is_good_gives_the_same_bits(made: Any) -> None:
    controller, other = pair("ur5")
    q = np.linspace(0.1, 0.5, controller.stack.robot.nq)
    for _ in range(3):
        assert controller.step(made(q))._data == other.step(q)._data
    assert controller.step(q.astype(np.float32))._data == other.step(q.astype(np.float32).astype(float))._data
    assert controller.step(np.arange(len(q)))._data == other.step(np.arange(len(q), dtype=float))._data


def test_policies_and_escapes_are_asked() -> None:
    together, apart = pair("panda")
    for controller in (together, apart):
        controller.policy = Policy(escape=True)
        controller.step(controller.stack.robot.neutral)
    rng = np.random.default_rng(0)
    for _ in range(5):
        given = targets(apart, rng)
        apart.set(**given)
        q = together.stack.robot.neutral
        assert together.step(q, **given)._data == apart.step(q)._data

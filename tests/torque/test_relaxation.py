"""States of random torque stacks whose relaxation once went wrong, and torque limits that no motion keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import IN_PYTHON, way
from tests.soak import machines
from tests.soak.torque_stacks import strong, torque_stack
from tests.soak.torques import Needed
from tests.torque.problems import controller
from wbc import Status
from wbc.api import Controller
from wbc.controller import Step, core_of

DATA = Path(__file__).parent / "data"


def drawn(k: int, backend: str, more: bool = False, masses: str = "") -> Controller:
    """A stack of the soak; ``masses``: the file that has those of its bodies, else its own."""
    if masses:
        given = iter(np.load(DATA / masses)["inertias"])
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(machines, "inertia", lambda rng: pin.Inertia.FromDynamicParameters(next(given)))
            return drawn(k, backend, more)
    rng = np.random.default_rng([0, True, k, 2])
    return torque_stack(strong(rng, more), rng, more).compile(**way(backend), command="torque")


def again(tick: Controller, name: str) -> Step:
    """The tick of a file of inputs."""
    core = core_of(tick)
    tick.reset(tick.stack.robot.neutral)
    given = np.load(DATA / name)
    for field in ("q", "v_in", "use_v", "p", "dt", "cap", "plain", "weight", "kept"):
        getattr(core.tick, field)[:] = given[field]
    for item in given["off"]:
        core.tick.enabled[core.layout.blocks[str(item)].span] = 0.0
    core.tick.v_last[:] = core.tick.v_in
    return core.again()


def beyond(tick: Controller, step: Step) -> float:
    """What accelerations and wrenches take beyond the torques that are sent, of the largest of them."""
    core, needed = core_of(tick), Needed(tick)
    needed.begin()
    found = needed.torques(step, core.tick.q.copy(), core.tick.v_in[: tick.stack.robot.nv].copy())
    return float(np.abs(found - step.torque).max() / np.abs(found).max())


def test_strict_levels_begin_where_equality_rows_are_met() -> None:
    """Motors without torque were to give 9e-5 N m: no level moved along the rows that the first search had missed."""
    tick = drawn(9, "vm", more=True)
    step = again(tick, "motors_without_torque.npz")
    assert step.status is Status.SOLVED
    assert beyond(tick, step) <= 1e-12


def test_a_relaxed_tick_needs_the_torques_that_are_sent() -> None:
    """The accelerations took 2.5e-3 N m more: hard rows that nearly depended on each other were missed."""
    tick = drawn(14, "vm", masses="torques_beyond_limits.npz")
    step = again(tick, "torques_beyond_limits.npz")
    assert step.status is Status.RELAXED
    assert beyond(tick, step) <= 1e-9
    assert "motors" not in {slack.item for slack in step.relaxed}


@pytest.mark.parametrize("backend", ["vm", IN_PYTHON])
def test_a_proof_spares_the_search_for_another_answer(backend: str) -> None:
    """Motors that can carry nothing: the tick brakes at once, not at the end of the chain, and says what is lacking."""
    tick = controller("panda", **way(backend)).clone()
    robot = tick.stack.robot
    tick.reset(robot.neutral)
    tick["torque_limits"].scale = 0.01
    step = tick.step(robot.neutral, np.zeros(robot.nv))
    assert step.status is Status.BRAKED
    assert step.answered_by == ""
    assert {slack.item for slack in step.relaxed} == {"torque_limits"}
    tick.policy = wbc.Policy(chain=())
    assert tick.step(robot.neutral, np.zeros(robot.nv)).answered_by == ""

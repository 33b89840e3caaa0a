"""A soak of random stacks, known problems, faults and random torques: short here, long with ``make soak``; and that the
judge sees what is wrong.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from tests.backends import IN_PYTHON
from tests.repeats import repeats
from tests.soak.both import both
from tests.soak.episodes import episode, stack
from tests.soak.faults import one_iteration, plants
from tests.soak.judge import Judge, Outside
from tests.soak.known import problems
from tests.soak.machines import machine
from tests.soak.stacks import random_stack
from tests.soak.torques import torques
from wbc.api import Controller

#: Of a full count of ticks: what is no status of a tick
ASIDE = ("gave way", "loose", "compared")


def wrong(counts: Counter[str]) -> dict[str, int]:
    return {key: n for key, n in counts.items() if key.startswith(("wrong", "raised"))}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_random_stacks_give_safe_certified_commands() -> None:
    found = [run for k in range(repeats(2)) for run in stack(3, k, "vm", 40)]
    found += [run for k in range(repeats(1)) for run in stack(3, k, "vm", 40, levels=True)]
    assert {name: wrong(counts) for name, counts in found if wrong(counts)} == {}
    total = sum((counts for _, counts in found), Counter[str]())
    assert sum(n for key, n in total.items() if not key.startswith(ASIDE)) == 40 * len(found)
    assert total["solved"] >= 20
    assert total["relaxed"] > 20


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_random_stacks_give_torques_within_their_limits() -> None:
    found = [run for k in (0, 2, *range(32, 32 + repeats(1))) for run in torques(11, k, "vm", 20)]
    assert {name: wrong(counts) for name, counts in found if wrong(counts)} == {}
    total = sum((counts for _, counts in found), Counter[str]())
    assert total["solved"] > 5
    assert total["relaxed"] > 5


def test_known_problems_are_solved_as_the_referee_does() -> None:
    for k in range(repeats(2)):
        ((name, counts),) = problems(5, k, "vm", 6)
        assert wrong(counts) == {}, name
        assert counts["solved"] == 6


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_faults_are_survived() -> None:
    for solver, outcomes in ((IN_PYTHON, ("recovered", "braked")), ("daqp", ("capped",))):
        found = [run for k in range(repeats(1)) for run in one_iteration(0, k, "vm", solver)]
        assert {name: wrong(counts) for name, counts in found if wrong(counts)} == {}
        assert sum(n for _, counts in found for key, n in counts.items() if key.startswith(outcomes)) > 0
    for k in range(repeats(1)):
        for name, each in plants(0, 1 + k, "vm"):
            assert wrong(each) == {}, name
            assert sum(n for key, n in each.items() if not key.startswith("gave way")) == 20, name


@pytest.mark.parametrize("levels", [False, True])
def test_both_back_ends_are_within_their_bounds(levels: bool) -> None:
    for k in range(repeats(1)):
        ((name, counts),) = both(0, 1 + k, 12, levels)
        assert wrong(counts) == {}, name
        assert sum(n for key, n in counts.items() if not key.startswith("gave way")) == 12


@pytest.fixture(scope="module")
def controller() -> Controller:
    rng = np.random.default_rng(2)
    return random_stack(machine(rng), rng).compile(backend="vm")


class Broken:
    """A step of a controller with another command."""

    def __init__(self, step: object, v: np.ndarray) -> None:
        self._step, self.v = step, v

    def __getattr__(self, name: str) -> object:
        return getattr(self._step, name)


def test_the_judge_sees_what_is_wrong(controller: Controller) -> None:
    controller, robot = controller.clone(), controller.stack.robot
    for entry in controller.stack.entries:
        controller[entry.name].enabled = entry.is_task or entry.name == "limits"
    judge = Judge(controller)
    controller.reset(robot.neutral)
    step, still = controller.step(robot.neutral), np.zeros(robot.nv)
    assert judge.step(step, still, 0.005) == ""
    far = np.zeros(robot.nv)
    for value, text in ((np.nan, "NaN"), (1e3, "beyond a velocity limit"), (np.inf, "NaN")):
        far[0] = value
        assert judge.step(Broken(step, far), still, 0.005) == text
    far[0] = min(robot.limits.velocity[0], 1.1 * robot.limits.acceleration[0] * 0.005)
    if far[0] > robot.limits.acceleration[0] * 0.005:
        assert judge.step(Broken(step, far), still, 0.005) == "beyond an acceleration limit"
    worse, text = Broken(step, step.v), "a certificate that fails is not reported"
    worse.status = "solved"
    for numbers in ((1e-8, 0.0, 0.0, 2e-3), (0.0, 0.0, 1e-8, 2e-3), (0.0, 2e-6, 0.0, 0.0)):
        worse.certificate = type(step.certificate)(*(x * judge.longest for x in numbers))
        assert judge.step(worse, still, 0.005) == text
    # a bound that tells nothing: the referee does
    worse.certificate = type(step.certificate)(0.0, 0.0, 0.0, 2e-3 * judge.longest)
    assert judge.step(worse, still, 0.005) == ""
    worse.v = step.v + 1e-5 * judge.longest
    worse.v[np.abs(worse.v) > np.abs(step.v)] -= 2e-5 * judge.longest
    assert judge.step(worse, still, 0.005) == "another optimum than the referee's"
    assert (judge.loose, judge.compared) == (2, 2)


def test_a_joint_that_turns_may_not_go_out_again() -> None:
    robot = machine(np.random.default_rng(2))
    watch, at = Outside(robot), int(np.flatnonzero(np.isfinite(robot.limits.position_upper))[0])
    q = robot.neutral.copy()
    k = robot.position_index[at]

    def seen(beyond: float) -> str:
        q[k] = robot.limits.position_upper[at] + beyond
        return watch.look(q)

    q[k] = robot.limits.position_upper[at] + 0.1
    watch.begin(q)
    assert [seen(x) for x in (0.12, 0.11, 0.05)] == ["", "", ""]
    assert seen(0.06) == "a violated position limit is violated more"
    # Across the range and out on the other side: too fast to be stopped
    watch.begin(q)
    span = robot.limits.position_upper[at] - robot.limits.position_lower[at]
    assert [seen(x) for x in (0.05, -0.5 * span, -span - 0.05, -span - 0.06, -span - 0.055)] == [""] * 5
    assert seen(-span - 0.07) == "a violated position limit is violated more"


def test_exceptions_are_counted(controller: Controller) -> None:
    def bad(controller: Controller, q: np.ndarray, v: np.ndarray, tick: int, rng: np.random.Generator) -> object:
        return q, None, -1.0

    counts = episode(controller, Judge(controller), np.random.default_rng(0), bad)
    assert dict(counts) == {"raised: RangeError": 1}

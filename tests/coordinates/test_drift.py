"""Rates without an integral are held and followed along the way; beside a locus the task gives way."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.published.arm_machine import STATE, Machine
from wbc.coordinates import Coordinate, CoordinatePair, PairController, expressions, mode_pairs, parts
from wbc.coordinates.control.conditioning import Conditioning
from wbc.coordinates.control.easing import EASED_STATES, Easing
from wbc.coordinates.rate_matrices import RateMatrices
from wbc.coordinates.samples import states_of
from wbc.robots import DHRow, from_dh

PARTS = parts("ssrms")
ROBOT, ARM = PARTS.robot, PARTS.arms[0]
assert ARM.alpha is not None
ALPHA, XI = ARM.alpha, ARM.tip
BETA, GAMMA = ARM.in_plane
JOINT2 = ARM.locks(1)[0]


@pytest.fixture(scope="module")
def control() -> PairController:
    pairs = [CoordinatePair(ALPHA, XI, "self"), CoordinatePair(JOINT2, XI, "turn")]
    return PairController(ROBOT, [*pairs, *(CoordinatePair(XI, one) for one in (ALPHA, BETA, GAMMA))], limits=False)


def gone(one: Coordinate, way: list[np.ndarray]) -> float:
    """int A dq along ticks by the midpoint rule: nothing of what is tested."""
    function = expressions.rate_function(ROBOT, (one,))
    total = 0.0
    for before, after in pairwise(way):
        step = after - before
        total += float((np.asarray(function(before + 0.5 * step).full()) @ step)[0])
    return total


def test_a_commanded_plane_follows_its_integral_and_the_pose_stays(control: PairController) -> None:
    """40 s: alpha goes 0.5 rad at 0.025 rad/s and back; with the tip held the arm is where it was, within 2e-6 m."""
    control.switch("self", 0.0)
    control.reset(STATE)
    machine, q, way = Machine(ROBOT), STATE, [STATE]
    for k in range(2000):
        control.command([0.025 if k < 1000 else -0.025])
        q = q + control.dt * control.step(q).v
        way.append(q)
    # Half way: the lag of the feedback
    assert abs(gone(ALPHA, way[:1001]) - 0.5) < 2e-6
    for frame in ("tip", "end3"):
        assert np.linalg.norm(machine.place(frame, q) - machine.place(frame, STATE)) < 2e-6


@pytest.mark.parametrize("one", [ALPHA, BETA, GAMMA], ids=str)
def test_held_rates_do_not_drift_along_the_way(control: PairController, one: Coordinate) -> None:
    """The tip is driven round for 12 s, then the robot is pushed: the held rate's integral comes back to zero."""
    control.switch(f"xi | {one}", 0.0)
    control.reset(STATE)
    q, way = STATE, [STATE]
    for k in range(600):
        angle = 2.0 * np.pi * k / 300
        control.command((0.08 * np.sin(angle), 0.08 * np.cos(angle), 0.0, 0.002 * np.cos(angle), 0.0, 0.0))
        q = q + control.dt * control.step(q).v
        way.append(q)
        if k == 300:
            q = q + 1e-3 * np.array((1.0, -1.0, 1.0, 0.5, 1.0, -1.0, 1.0))
            way[-1] = q
            assert abs(gone(one, way)) > 1e-4
    assert abs(gone(one, way)) < 1e-7


def test_a_task_beside_a_locus_gives_way_and_what_is_held_stays(control: PairController) -> None:
    """Joint 2 is wanted further than the held tip lets it: without easing joints ran at 250 rad/s, the tip was lost."""
    control.switch("turn", 0.0)
    control.reset(STATE)
    control.command([0.02])
    machine, q = Machine(ROBOT), STATE
    for _ in range(300):
        step = control.step(q)
        assert step.ended == "solved"
        assert np.abs(step.v).max() < ROBOT.limits.velocity[0] + 1e-9
        q = q + control.dt * step.v
    assert np.linalg.norm(machine.place("tip", q) - machine.place("tip", STATE)) < 2e-5


def test_a_stretched_arm_comes_to_rest(control: PairController) -> None:
    """The tip is driven out of reach with the plane held: joints stop at q4 = 0 and do not swing about it."""
    control.switch("xi | alpha", 0.0)
    q = STATE.copy()
    q[3] = 0.1
    control.reset(q)
    control.command((0.1, 0.0, 0.0, 0.0, 0.0, 0.0))
    for _ in range(500):
        v = control.step(q).v
        q = q + control.dt * v
    assert abs(q[3]) < 1e-3
    assert np.abs(v).max() < 0.01


def test_easing_is_that_of_the_least_singular_value() -> None:
    """A bound answers in place of singular values along a way past loci; at each place it is what they are."""
    pairs = [CoordinatePair(XI, ALPHA), CoordinatePair(ALPHA, XI, "back"), CoordinatePair(XI, [ALPHA, BETA], "tall")]
    exact = Conditioning(ROBOT, [pair.rows for pair in pairs], backend="vm")
    compiled, plain = (RateMatrices(ROBOT, (XI, ALPHA, BETA), native=native) for native in (True, False))
    easings = [Easing(ROBOT, pairs, ROBOT.characteristic_length, compiled) for _ in pairs]
    eased = []
    for x in np.linspace(0.0, 1.0, 301):
        q = STATE + x * np.array((0.2, 1.2, 0.3, -1.3 * STATE[3], 0.1, 0.2, 0.1))
        every = compiled.whole(q)
        np.testing.assert_allclose(every, plain.whole(q), rtol=0.0, atol=1e-13)
        for pair, easing, sigma in zip(pairs, easings, exact.sigmas(q), strict=True):
            found = easing.at(pair.name, every)
            assert found == pytest.approx(easing.weight(pair.name, sigma), rel=1e-6, abs=1e-15)
            eased.append(found > 0.0)
    assert 10 < sum(eased) < 400
    # One that looks at another pair in between answers as one that does not
    for pair, easing in zip(pairs, easings, strict=True):
        assert easings[0].at(pair.name, every) == easing.at(pair.name, every)
    least = easings[0].threshold(pairs[0].name)
    assert 0.005 < least <= 0.01
    assert easings[0].weight(pairs[0].name, 0.0) == pytest.approx((0.5 * least) ** 2)
    assert easings[0].weight(pairs[0].name, 0.5 * least) == pytest.approx((0.5 * least * 0.75) ** 2)
    assert easings[0].weight(pairs[0].name, least) == 0.0


def test_thresholds_of_easing_are_parts_of_what_is_usual() -> None:
    """A tenth of the median singular value of the pair, 0.01 at most: an arm ten times as small has the same ones."""
    numbers = (0.0, 1.4, 0.3), (0.4, 0.3, 0.0), (0.1, -1.2, 0.1), (0.2, 0.5, 0.3)
    rows = [DHRow(a=a, alpha=turn, d=d) for a, turn, d in numbers]
    found = []
    for scale in (1.0, 0.1):
        arm = from_dh([DHRow(a=scale * r.a, alpha=r.alpha, d=scale * r.d) for r in rows])
        pairs = mode_pairs(arm, "M1")
        robot = parts(arm).robot
        control = PairController(robot, pairs, backend="vm")
        found.append([control._easing.threshold(pair.name) for pair in pairs])
        for pair, least in zip(pairs, found[-1], strict=True):
            sigma = Conditioning(robot, [pair.rows], backend="vm").sigmas
            usual = np.median([sigma(q)[0] for q in states_of(robot, EASED_STATES)])
            assert least == pytest.approx(min(0.01, 0.1 * usual), rel=1e-9)
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert min(found[0]) < 0.01

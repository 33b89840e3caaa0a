"""All configurations of a target: the UR5's closed form is the referee; on the Panda they are where wishes rest."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.ik.test_inverse_kinematics import TIPS, arm, outside, solver, stack
from tests.models import free_direction, placement
from tests.repeats import repeats
from wbc.errors import InfeasibleError, RangeError, ShapeError, WbcError
from wbc.ik import InverseKinematics
from wbc.tasks import Damping, Posture
from wbc.validation import Array

#: Denavit-Hartenberg parameters of the UR5 [m]: (a, alpha, d)
TABLE = (
    (0.0, np.pi / 2, 0.089159),
    (-0.425, 0.0, 0.0),
    (-0.39225, 0.0, 0.0),
    (0.0, np.pi / 2, 0.10915),
    (0.0, -np.pi / 2, 0.09465),
    (0.0, 0.0, 0.0823),
)
D4, D6, A2, A3 = TABLE[3][2], TABLE[5][2], TABLE[1][0], TABLE[2][0]


def link(i: int, angle: float) -> Array:
    a, alpha, d = TABLE[i]
    c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1.0]])


def forward(q: Array) -> Array:
    out = np.eye(4)
    for i, angle in enumerate(q):
        out = out @ link(i, float(angle))
    return out


def closed_form(goal: Array) -> list[Array]:
    """Every configuration with the flange at a pose, angles in [-pi, pi)."""
    out: list[Array] = []
    wrist, back = goal @ np.array([0.0, 0.0, -D6, 1.0]), np.linalg.inv(goal)
    away = np.hypot(wrist[0], wrist[1])
    for shoulder, turn, elbow in itertools.product((1.0, -1.0), repeat=3):
        if abs(D4 / away) > 1.0:
            continue
        q1 = np.arctan2(wrist[1], wrist[0]) + shoulder * np.arccos(D4 / away) + np.pi / 2
        s1, c1 = np.sin(q1), np.cos(q1)
        share = (goal[0, 3] * s1 - goal[1, 3] * c1 - D4) / D6
        if abs(share) > 1.0:
            continue
        q5 = turn * np.arccos(share)
        s5 = np.sin(q5)
        q6 = np.arctan2((-back[1, 0] * s1 + back[1, 1] * c1) / s5, (back[0, 0] * s1 - back[0, 1] * c1) / s5)
        plane = np.linalg.inv(link(0, q1)) @ goal @ np.linalg.inv(link(4, q5) @ link(5, q6))
        reach = plane @ np.array([0.0, -D4, 0.0, 1.0])
        length = float(np.linalg.norm(reach[:3]))
        share = (length**2 - A2**2 - A3**2) / (2.0 * A2 * A3)
        if abs(share) > 1.0:
            continue
        q3 = elbow * np.arccos(share)
        q2 = -np.arctan2(reach[1], -reach[0]) + np.arcsin(A3 * np.sin(q3) / length)
        last = np.linalg.inv(link(1, q2) @ link(2, q3)) @ plane
        q = np.array([q1, q2, q3, np.arctan2(last[1, 0], last[0, 0]), q5, q6])
        if np.abs(forward(q) - goal).max() < 1e-9:
            out.append((q + np.pi) % (2.0 * np.pi) - np.pi)
    return out


def turned(way: Array) -> Array:
    """Differences of angles without full turns."""
    return way - 2.0 * np.pi * np.round(way / (2.0 * np.pi))


def flange(q: Array) -> Array:
    """The pose of tool0 in the base frame of the closed form, which is turned half-way round."""
    half = np.diag([-1.0, -1.0, 1.0, 1.0])
    return half @ np.asarray(placement(arm("ur5"), "tool0", q).homogeneous)


def test_all_branches_of_the_ur5_are_found() -> None:
    robot, rng, ik, counts = arm("ur5"), np.random.default_rng(1), solver("ur5"), []
    for _ in range(repeats(5)):
        q = rng.uniform(-np.pi, np.pi, 6)
        ik["hand"].target = placement(robot, "tool0", q)
        found = ik.branches(robot.neutral, budget=None)
        wanted = closed_form(flange(q))
        counts.append(len(wanted))
        assert len(found.solutions) == len(wanted)
        for exact in wanted:
            assert min(np.abs(turned(x - exact)).max() for x in found.q) < 1e-4
        for solution in found.solutions:
            assert solution.solved
            assert placement(robot, "tool0", solution.q).isApprox(placement(robot, "tool0", q), 1e-4)
            assert solution.error <= 1e-5
            # Of the full turns of a joint that its range leaves, the nearest
            for sign in (-1.0, 1.0):
                other = solution.q + sign * 2.0 * np.pi
                allowed = (other >= robot.limits.position_lower) & (other <= robot.limits.position_upper)
                nearer = np.abs(other - robot.neutral) < np.abs(solution.q - robot.neutral)
                assert not (allowed & nearer).any()
        assert found.hits.min() >= 1
        assert found.complete
    assert counts.count(8) >= 2


def test_answers_are_sorted_and_of_one_seed() -> None:
    robot, ik = arm("ur5"), solver("ur5")
    ik["hand"].target = placement(robot, "tool0", robot.random(1))
    one, again = (ik.branches(robot.neutral, budget=None, seed=3, restarts=200) for _ in range(2))
    np.testing.assert_array_equal(one.q, again.q)
    np.testing.assert_array_equal(one.hits, again.hits)
    assert (np.diff(np.linalg.norm(one.q - robot.neutral, axis=1)) >= -1e-6).all()
    other = ik.branches(robot.neutral, budget=None, seed=4, restarts=200)
    np.testing.assert_allclose(other.q, one.q, atol=1e-3)
    assert one.unseen == (one.hits == 1).sum() / one.hits.sum()
    few = ik.branches(robot.neutral, budget=None, most=2)
    assert len(few.solutions) == 2
    assert few.complete
    assert few.descents < 200


@cache
def decided() -> InverseKinematics:
    # Damping decides nothing
    return (
        stack()
        .add(Posture(), name="posture", weight=1e-3)
        .add(Damping(), name="calm", weight=1e-6)
        .inverse_kinematics()
    )


def test_on_a_redundant_arm_they_are_where_the_wishes_rest() -> None:
    robot, name = arm("panda"), TIPS["panda"]
    ik, low, high = decided(), robot.limits.position_lower, robot.limits.position_upper
    ik["posture"].target = robot.neutral
    for seed in range(repeats(2)):
        goal = placement(robot, name, robot.random(seed))
        ik["hand"].target = goal
        found = ik.branches(robot.neutral, budget=None)
        assert len(found.solutions) > 1
        for one, other in itertools.combinations(found.q, 2):
            assert np.abs(one - other).max() > 0.01
        for q in found.q:
            assert outside(robot, q) <= 0.0
            assert goal.isApprox(placement(robot, name, q), 1e-4)
            free = free_direction(robot, name, q)
            pull = float(free @ (q - robot.neutral))
            # At rest, or the way down ends at a limit
            ahead = q - np.sign(pull) * 1e-3 * free
            assert abs(pull) < 1e-3 or (ahead < low).any() or (ahead > high).any()
        best = ik.solve(robot.neutral, budget=None)
        assert min(np.abs(best.q - q).max() for q in found.q) < 0.01


def test_the_row_that_holds_an_answer_is_named() -> None:
    robot, ik = arm("panda"), decided()
    ik["posture"].target = robot.neutral
    at_limit = 0
    for seed in range(4):
        ik["hand"].target = placement(robot, TIPS["panda"], robot.random(seed))
        for solution in ik.branches(robot.neutral, budget=None).solutions:
            free = free_direction(robot, TIPS["panda"], solution.q)
            if abs(float(free @ (solution.q - robot.neutral))) > 0.05:
                at_limit += 1
                assert any(b.item == "limits" for b in solution.binding)
    assert at_limit > 2


def test_free_directions_are_refused() -> None:
    robot, ik = arm("panda"), decided()
    with pytest.raises(RangeError, match="leave 1 of 7 directions free") as caught:
        solver().branches(robot.neutral)
    assert caught.value.field == "goals"
    ik["hand"].target = placement(robot, TIPS["panda"], robot.neutral)
    for name, value, refused in (("weight", 0.0, True), ("enabled", False, True), ("mask", np.eye(7)[1], False)):
        before = getattr(ik["posture"], name)
        setattr(ik["posture"], name, value)
        if refused:
            with pytest.raises(RangeError, match="leave 1 of 7 directions free"):
                ik.branches(robot.neutral)
        else:
            assert ik.branches(robot.neutral, restarts=5, budget=None).solutions
        setattr(ik["posture"], name, before)


def test_out_of_reach_is_an_error_that_says_how_far() -> None:
    robot, ik = arm("ur5"), solver("ur5")
    ik["hand"].target = pin.SE3(np.eye(3), np.array([3.0, 0.0, 0.0]))
    with pytest.raises(InfeasibleError, match=r"in 21 descents; at the nearest hand off by [12]\.") as caught:
        ik.branches(robot.neutral, restarts=20, budget=None)
    assert caught.value.field == "targets"
    assert 1.0 < caught.value.value < 3.0


def test_the_time_is_kept() -> None:
    robot, ik = arm("ur5"), solver("ur5")
    ik["hand"].target = placement(robot, "tool0", robot.random(1))
    ik.branches(robot.neutral, restarts=3)
    # so many restarts would take minutes
    found = ik.branches(robot.neutral, budget=0.01, restarts=100_000)
    assert not found.complete
    assert found.seconds < 5.0
    with pytest.raises(InfeasibleError, match=r"in 0 descents; .*; the time is over"):
        ik.branches(robot.neutral, budget=1e-9)


@pytest.mark.parametrize(
    ("options", "error", "field"),
    [
        ({"q0": np.zeros(7)}, ShapeError, "q0"),
        ({"most": 0}, RangeError, "most"),
        ({"most": 1.5}, ShapeError, "most"),
        ({"budget": 0.0}, RangeError, "budget"),
        ({"seed": -1}, RangeError, "seed"),
        ({"restarts": "x"}, ShapeError, "restarts"),
        ({"tolerance": 0.0}, RangeError, "tolerance"),
    ],
)
def test_bad_input_is_refused(options: dict[str, Any], error: type[WbcError], field: str) -> None:
    with pytest.raises(error) as caught:
        solver("ur5").branches(**{"q0": arm("ur5").neutral, **options})
    assert caught.value.field == field

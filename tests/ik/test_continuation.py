"""Branches of configurations along paths of targets; Pinocchio judges where the frame is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.ik.test_inverse_kinematics import TIPS, arm, solver, stack
from tests.models import free_direction, placement
from wbc.api import Stack
from wbc.errors import (
    ContinuityError,
    InfeasibleError,
    NotFiniteError,
    RangeError,
    ShapeError,
    UnknownNameError,
    WbcError,
)
from wbc.ik import InverseKinematics
from wbc.tasks import EndEffector, JointLimits, Posture

HOME = np.array([0.3, -1.2, 1.5, -0.7, 1.2, 0.4])


def circle(home: pin.SE3, radius: float = 0.1) -> Any:
    """s in radians -> a pose on a circle, which also turns."""

    def pose(s: float) -> pin.SE3:
        move = radius * np.array([0.0, np.sin(s), 1.0 - np.cos(s)])
        return pin.SE3(pin.exp3(np.array([0.0, 0.0, 0.3 * np.sin(s)])) @ home.rotation, home.translation + move)

    return pose


def test_configurations_are_on_the_path_and_on_one_branch() -> None:
    robot, ik = arm("ur5"), solver("ur5")
    pose = circle(placement(robot, "tool0", HOME))
    s = np.linspace(0.0, 2.0 * np.pi, 50)
    found = ik.along({"hand": pose}, s, HOME)
    for place, q in zip(s, found.q, strict=True):
        off = pose(place).actInv(placement(robot, "tool0", q))
        assert np.abs(pin.log6(off).vector).max() < 1e-7
    np.testing.assert_allclose(found.q[[0, -1]], [HOME, HOME], atol=1e-6)
    assert found.moved <= 0.02
    assert found.samples > len(s)
    assert np.abs(found.steps[20].residuals["hand"].values).max() <= 1e-8


def test_the_branch_does_not_depend_on_where_it_is_asked_for() -> None:
    robot, ik = arm("ur5"), solver("ur5")
    pose = circle(placement(robot, "tool0", HOME))
    coarse = ik.along({"hand": pose}, [0.0, 3.0, 6.0], HOME)
    fine = ik.along({"hand": pose}, np.linspace(0.0, 6.0, 601), HOME)
    np.testing.assert_allclose(coarse.q, fine.q[[0, 300, 600]], atol=1e-6)
    back = ik.along({"hand": lambda s: pose(6.0 - s)}, [0.0, 6.0], coarse.q[-1])
    np.testing.assert_allclose(back.q[-1], HOME, atol=1e-6)
    slow = solver("ur5", "vm").along({"hand": pose}, [0.0, 0.1], HOME)
    np.testing.assert_allclose(slow.q, ik.along({"hand": pose}, [0.0, 0.1], HOME).q, atol=1e-7)


def test_what_the_goals_leave_open_is_at_rest() -> None:
    """A redundant arm with a posture: the distance to it cannot fall along the goals' null space."""
    robot = arm("panda")
    ik = stack().add(Posture(), name="posture", weight=1e-3).inverse_kinematics()
    pose = circle(placement(robot, TIPS["panda"], robot.neutral))
    s = np.linspace(0.0, 2.0 * np.pi, 40)
    ik["posture"].target = robot.neutral
    found = ik.along({"hand": pose}, s, robot.neutral)
    np.testing.assert_allclose(found.q[-1], robot.neutral, atol=1e-6)
    assert np.abs(found.q - robot.neutral).max() > 0.2
    for q in found.q:
        free = free_direction(robot, TIPS["panda"], q)
        assert abs(free @ (q - robot.neutral)) < 1e-4


def test_a_closed_path_is_gone_all_the_way_round() -> None:
    """A whole turn about the base: the pose at its end is the first one, the configuration is not."""
    robot, ik = arm("ur5"), solver("ur5")
    start = HOME - np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    home = placement(robot, "tool0", start)

    def turned(s: float) -> pin.SE3:
        return pin.SE3(pin.exp3(np.array([0.0, 0.0, s])), np.zeros(3)) * home

    found = ik.along({"hand": turned}, [0.0, 2.0 * np.pi], start)
    np.testing.assert_allclose(found.q[-1] - start, [2.0 * np.pi, 0, 0, 0, 0, 0], atol=1e-6)
    assert found.samples > 2.0 * np.pi / 0.02
    # A hundred steps, of which the first is the longest
    slowing = ik.along({"hand": lambda s: turned(0.5 * s * (2.0 - s))}, [0.0, 1.0], start)
    assert slowing.moved == pytest.approx(0.5 * (1.0 - 0.99**2), rel=1e-3)


def test_targets_are_also_sequences() -> None:
    robot, ik = arm("ur5"), solver("ur5")
    goal = placement(robot, "tool0", HOME + 0.4)
    first = placement(robot, "tool0", HOME)
    s = [0.0, 2.0, 3.0]
    listed = ik.along({"hand": [first, goal, first]}, s, HOME)

    def screw(at: float) -> pin.SE3:
        share = at / 2.0 if at <= 2.0 else 3.0 - at
        return first * pin.exp6(share * pin.log6(first.actInv(goal)))

    np.testing.assert_allclose(listed.q, ik.along({"hand": screw}, s, HOME).q, atol=1e-6)
    np.testing.assert_allclose(listed.q[1], HOME + 0.4, atol=1e-6)


@pytest.mark.parametrize("kind", ["position", "orientation"])
def test_sequences_of_positions_and_of_rotations(kind: str) -> None:
    robot = arm("ur5")
    ik = stack("ur5", kind).add(Posture(), name="posture", weight=1e-3).inverse_kinematics()
    first, last = placement(robot, "tool0", HOME), placement(robot, "tool0", HOME + 0.3)
    part = "translation" if kind == "position" else "rotation"
    ends = [getattr(first, part), getattr(last, part)]
    s = np.linspace(0.0, 1.0, 5)
    if kind == "position":
        between = [(1.0 - x) * ends[0] + x * ends[1] for x in s]
    else:
        between = [ends[0] @ pin.exp3(x * pin.log3(ends[0].T @ ends[1])) for x in s]
    thin = ik.along({"hand": ends}, [0.0, 1.0], HOME)
    thick = ik.along({"hand": between}, s, HOME)
    np.testing.assert_allclose(thin.q[-1], thick.q[-1], atol=1e-5)
    for x, q in zip(between, thick.q, strict=True):
        np.testing.assert_allclose(getattr(placement(robot, "tool0", q), part), x, atol=1e-7)


def test_the_end_of_reach_is_named() -> None:
    """Straight away from the base; searches with restarts succeed just before the end and fail just behind it."""
    robot, ik = arm("ur5"), solver("ur5", "auto", "position")
    start = np.array([0.0, -1.0, 1.2, -0.3, 0.3, 0.0])
    here = placement(robot, "tool0", start).translation
    away = np.array([here[0], here[1], 0.0]) / np.hypot(here[0], here[1])
    with pytest.raises(InfeasibleError, match=r"not reached: hand off by .*; no row binds") as caught:
        ik.along({"hand": lambda s: here + s * away}, [0.0, 2.0], start)
    reach = caught.value.value
    assert caught.value.field == "s"
    assert 0.1 < reach < 1.5
    for s, status in ((reach - 1e-4, "solved"), (reach + 1e-4, "unreachable")):
        ik["hand"].target = here + s * away
        assert ik.solve(start, budget=None, restarts=300).status == status


def test_the_limit_that_binds_is_named() -> None:
    """The hand turns about the first axis, which ends at 1 rad."""
    robot = arm("ur5")
    upper = robot.limits.position_upper.copy()
    upper[0] = 1.0
    bounded = Stack(robot.with_limits(position_upper=upper), 0.01).add(EndEffector("tool0"), name="hand")
    ik = bounded.add(JointLimits(), name="limits").inverse_kinematics()
    home = placement(robot, "tool0", HOME)

    def turned(s: float) -> pin.SE3:
        return pin.SE3(pin.exp3(np.array([0.0, 0.0, s])), np.zeros(3)) * home

    assert ik.along({"hand": turned}, [0.0, 0.69], HOME).q[-1, 0] == pytest.approx(0.99)
    with pytest.raises(WbcError, match=r"binding: .*limits/shoulder_pan_joint upper") as caught:
        ik.along({"hand": turned}, np.linspace(0.0, 2.0, 5), HOME)
    assert isinstance(caught.value, (InfeasibleError, ContinuityError))
    assert caught.value.value == pytest.approx(0.7, abs=1e-5)


def test_a_jump_is_named() -> None:
    """A random line; before the place that is named there is no jump on it."""
    robot, rng = arm("panda"), np.random.default_rng(0)
    ik = stack().add(Posture(), name="posture", weight=1e-3).inverse_kinematics()
    for _ in range(7):
        start = robot.neutral + rng.uniform(-0.8, 0.8, 7)
        start = np.clip(start, robot.limits.position_lower + 0.1, robot.limits.position_upper - 0.1)
        home, move = placement(robot, TIPS["panda"], start), rng.uniform(-0.4, 0.4, 3)

    def line(s: float) -> pin.SE3:
        return pin.SE3(home.rotation, home.translation + s * move)

    ik["posture"].target = start
    with pytest.raises(ContinuityError, match=r"panda_joint\d jumps by 0\.\d+ rad here; before it, ") as caught:
        ik.along({"hand": line}, [0.0, 1.0], start)
    place = caught.value.value
    before = ik.along({"hand": line}, [0.0, place - 1e-3], start)
    assert before.moved <= 0.02


def test_targets_are_as_before() -> None:
    robot, ik = arm("ur5"), solver("ur5")
    goal = placement(robot, "tool0", robot.random(3))
    ik["hand"].target = goal
    ik.along({"hand": circle(placement(robot, "tool0", HOME))}, [0.0, 0.1], HOME)
    assert ik["hand"].target.isApprox(goal, 1e-12)
    with pytest.raises(InfeasibleError):
        ik.along({"hand": [pin.SE3(np.eye(3), np.array([9.0, 0.0, 0.0]))]}, [0.0], HOME)
    assert ik["hand"].target.isApprox(goal, 1e-12)


def home() -> pin.SE3:
    return placement(arm("ur5"), "tool0", HOME)


@pytest.mark.parametrize(
    ("change", "error", "field"),
    [
        ({"s": [0.0, 0.0]}, RangeError, "s"),
        ({"s": [1.0, 0.0]}, RangeError, "s"),
        ({"s": []}, ShapeError, "s"),
        ({"s": 0.5}, ShapeError, "s"),
        ({"s": [0.0, np.nan]}, NotFiniteError, "s"),
        ({"q0": np.zeros(7)}, ShapeError, "q0"),
        ({"q0": np.full(6, np.nan)}, NotFiniteError, "q0"),
        ({"tolerance": 0.0}, RangeError, "tolerance"),
        ({"targets": {"hnad": [pin.SE3.Identity()] * 2}}, UnknownNameError, "item"),
        ({"targets": {"limits": [0.0, 0.0]}}, UnknownNameError, "limits.target"),
        ({"targets": {"hand": [pin.SE3.Identity()]}}, ShapeError, "targets[hand]"),
        ({"targets": {"hand": 3.0}}, ShapeError, "targets[hand]"),
        ({"targets": {"hand": lambda s: home() if s < 0.05 else np.full(7, np.inf)}}, NotFiniteError, "hand.target"),
        ({"targets": {"hand": [pin.SE3.Identity(), np.zeros(3)]}}, ShapeError, "hand.target"),
    ],
)
def test_bad_input_is_refused(change: dict[str, Any], error: type[WbcError], field: str) -> None:
    ik: InverseKinematics = solver("ur5")
    good = {"targets": {"hand": circle(home())}, "s": [0.0, 0.1], "q0": HOME}
    with pytest.raises(error) as caught:
        ik.along(**{**good, **change})
    assert caught.value.field == field


def test_joints_of_several_coordinates() -> None:
    """Joints without limits are points on circles in q."""
    robot, ik = arm("kinova"), solver("kinova")
    assert robot.nq > robot.nv
    start = np.array(pin.integrate(robot.model, robot.neutral, np.full(robot.nv, 0.2)))
    pose = circle(placement(robot, TIPS["kinova"], start), 0.05)
    found = ik.along({"hand": pose}, [0.0, 1.0, 2.0 * np.pi], start)
    assert pose(1.0).isApprox(placement(robot, TIPS["kinova"], found.q[1]), 1e-7)
    np.testing.assert_allclose(found.q[2], start, atol=1e-6)
    assert all(pin.isNormalized(robot.model, q, 1e-9) for q in found.q)

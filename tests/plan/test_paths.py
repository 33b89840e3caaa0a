"""Paths among obstacles: clear by Coal between their points, within limits, the same for a seed; and refusals."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.plan.scenes import SHELF, CoalJudge, at, base_with_a_body, panda, reaching
from tests.repeats import repeats
from wbc.errors import InfeasibleError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.plan import MotionPlanner, NoPathError
from wbc.shapes import Box, Cylinder, HalfSpace, Sphere

LEFT, RIGHT = reaching(0.6, 0.22, 0.22), reaching(0.6, -0.22, 0.57)
#: What a proof leaves open [m]
OPEN = 1.1e-4


@pytest.fixture(scope="module")
def shelf() -> MotionPlanner:
    return panda(*SHELF).planner()


def test_a_panda_goes_from_one_cell_of_a_shelf_to_another(shelf: MotionPlanner) -> None:
    robot, judge = shelf.stack.robot, CoalJudge(shelf.stack)
    into = shelf.plan(robot.neutral, {"hand": LEFT})
    across = shelf.plan(into.q[-1], {"hand": RIGHT}, seed=1)
    np.testing.assert_array_equal(into.q[0], robot.neutral)
    for path, target in ((into, LEFT), (across, RIGHT)):
        there = robot.pose(path.q[-1], "panda_hand_tcp")
        assert np.linalg.norm(pin.log6(target.actInv(there)).vector) < 1e-6
        assert (path.q >= robot.limits.position_lower - 1e-12).all()
        assert (path.q <= robot.limits.position_upper + 1e-12).all()
        assert judge.least(path) > -OPEN
        assert path.length == pytest.approx(np.linalg.norm(np.diff(path.q, axis=0), axis=1).sum())


def test_a_straight_line_is_not_enough_there(shelf: MotionPlanner) -> None:
    """Else the shelf would show nothing."""
    ends = [shelf.plan(shelf.stack.robot.neutral, {"hand": target}).points[-1] for target in (LEFT, RIGHT)]
    judge = CoalJudge(shelf.stack)
    assert min(judge.margin(ends[0] + share * (ends[1] - ends[0])) for share in np.linspace(0.0, 1.0, 50)) < -0.01


def test_a_path_is_a_function_of_its_seed(shelf: MotionPlanner) -> None:
    first = [shelf.plan(shelf.stack.robot.neutral, {"hand": LEFT}, seed=k).points for k in range(3)]
    again = [panda(*SHELF).plan(shelf.stack.robot.neutral, {"hand": LEFT}, seed=k).points for k in (2, 0)]
    np.testing.assert_array_equal(again[0], first[2])
    np.testing.assert_array_equal(again[1], first[0])
    assert any(one.shape != first[0].shape or (one != first[0]).any() for one in first[1:])


def test_more_paths_are_no_longer(shelf: MotionPlanner) -> None:
    one, many = (
        np.array([shelf.plan(shelf.stack.robot.neutral, {"hand": RIGHT}, seed=s, paths=p).length for s in range(6)])
        for p in (1, 8)
    )
    assert np.median(many) <= np.median(one)


@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_of_any_shapes(seed: int) -> None:
    """UR5 among balls, cylinders and boxes over a floor."""
    rng = np.random.default_rng(seed)
    stack = wbc.Stack(wbc.robots.load("ur5"), dt=0.01)
    stack.add(wbc.tasks.JointLimits())
    stack.add(wbc.tasks.SelfCollision(margin=0.002), name="self")
    shapes = (Sphere(0.12), Cylinder(0.06, 0.5), Box((0.2, 0.1, 0.4)))
    for k in range(5):
        place = pin.SE3(pin.exp3(rng.normal(size=3)), rng.uniform((-0.7, -0.7, 0.1), (0.7, 0.7, 0.8)))
        if np.hypot(*place.translation[:2]) > 0.35:
            stack.add(wbc.tasks.Obstacle(shapes[k % 3], pose=place, margin=0.004), name=f"thing{k}")
    judge = CoalJudge(stack)
    stack.add(wbc.tasks.Obstacle(HalfSpace(), links=("wrist_3_link",), pose=at(0.0, 0.0, -0.1)), name="floor")
    planner, ends = stack.planner(), list[np.ndarray]()
    low, high = np.full(6, -2.5), np.array([2.5, 0.0, 2.5, 2.5, 2.5, 2.5])
    while len(ends) < 4:
        q = rng.uniform(low, high)
        if judge.margin(q) > 0.001 and stack.robot.pose(q, "wrist_3_link").translation[2] > 0.1:
            ends.append(q)
    for start, goal in ((ends[0], ends[1]), (ends[2], ends[3])):
        path = planner.plan(start, goal, seed=seed)
        np.testing.assert_allclose(path.q[[0, -1]], [start, goal], atol=1e-12)
        assert judge.least(path, 0.01) > -OPEN
        assert all(stack.robot.pose(q, "wrist_3_link").translation[2] > -0.1 for q in path.q)


def test_the_nearest_of_several_goals_or_any(shelf: MotionPlanner) -> None:
    robot = shelf.stack.robot
    near = robot.neutral + 0.05
    path = shelf.plan(robot.neutral, [{"hand": RIGHT}, near])
    assert any(np.allclose(path.q[-1], q) for q in (near,)) or np.allclose(
        robot.pose(path.q[-1], "panda_hand_tcp").translation, RIGHT.translation, atol=1e-6
    )
    np.testing.assert_allclose(shelf.plan(robot.neutral, np.array([near, near + 0.01])).q[-1], near, atol=0.02)


def test_obstacles_stand_where_they_are_now() -> None:
    stack = panda(((0.1, 1.0, 0.8), (0.9, 0.0, 0.4)))
    planner, q = stack.planner(), stack.robot.neutral
    goal = q + np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert len(planner.plan(q, goal).points) == 2
    pose = at(0.35, 0.35, 0.4)
    planner["box0"].pose = pin.SE3(pin.exp3(np.array([0.0, 0.0, -0.8])), pose.translation)
    moved = CoalJudge(stack, {"box0": pin.SE3(pin.exp3(np.array([0.0, 0.0, -0.8])), pose.translation)})
    with pytest.raises(InfeasibleError, match="box0"):
        planner.plan(q + np.array([0.7, 0, 0, 0, 0, 0, 0]), goal)
    planner["box0"].enabled = False
    assert len(planner.plan(q, goal).points) == 2
    assert moved.margin(q + np.array([0.7, 0, 0, 0, 0, 0, 0])) < 0.0


def test_a_start_or_goal_that_is_not_free_is_named(shelf: MotionPlanner) -> None:
    robot = shelf.stack.robot
    inside = robot.neutral.copy()
    inside[[1, 3]] = 0.6, -1.2
    with pytest.raises(InfeasibleError, match=r"q0: .*box\d are -\d+\.\d+ mm apart, 3.00 mm required"):
        shelf.plan(inside, robot.neutral)
    with pytest.raises(InfeasibleError, match=r"goal: .*box\d are -\d"):
        shelf.plan(robot.neutral, inside)
    far = robot.neutral.copy()
    far[3] = 1.0
    with pytest.raises(InfeasibleError, match="panda_joint4 is beyond its limit"):
        shelf.plan(robot.neutral, far)
    with pytest.raises(InfeasibleError, match="no configuration that meets hand was found"):
        shelf.plan(robot.neutral, {"hand": reaching(2.0, 0.0, 0.5)})
    with pytest.raises(InfeasibleError, match=r"none of .* is free; of the best .* and box"):
        shelf.plan(robot.neutral, {"hand": reaching(0.6, 0.22, 0.4)})


def test_what_is_not_found_in_the_time_has_the_nearest() -> None:
    """A rod that would have to turn round in a closed tube that is too narrow, through which balls within it go."""
    rod = '<freejoint name="base"/><geom name="rod" type="capsule" size="0.03" fromto="-0.3 0 0 0.3 0 0" mass="1"/>'
    stack = wbc.Stack(
        wbc.robots.load(f'<mujoco><worldbody><body name="rod">{rod}</body></worldbody></mujoco>'), dt=0.01
    )
    for k, (y, z) in enumerate(((0.2, 0.0), (-0.2, 0.0), (0.0, 0.2), (0.0, -0.2))):
        sides = (4.0, 0.1, 0.5) if y else (4.0, 0.5, 0.1)
        stack.add(wbc.tasks.Obstacle(Box(sides), pose=at(0.0, y, z)), name=f"wall{k}")
    for k, x in enumerate((-2.0, 2.0)):
        stack.add(wbc.tasks.Obstacle(Box((0.1, 0.5, 0.5)), pose=at(x, 0.0, 0.0)), name=f"end{k}")
    start, goal = stack.robot.neutral.copy(), stack.robot.neutral.copy()
    goal[3:7] = pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, np.pi)).coeffs()
    goal[0] = 0.5
    with pytest.raises(NoPathError, match=r"no path was found in 0.3 s, with \d+ configurations") as caught:
        stack.planner().plan(start, goal, seconds=0.3)
    assert 0.0 < caught.value.distance < 5.0
    assert CoalJudge(stack).margin(caught.value.nearest) > -OPEN


@pytest.mark.parametrize(
    ("goal", "more", "error", "says"),
    [
        ({"hnd": LEFT}, {}, UnknownNameError, "hand"),
        (np.zeros(5), {}, ShapeError, "goal"),
        ([], {}, RangeError, "at least one"),
        (np.zeros(7), {"seconds": 0.0}, RangeError, "seconds"),
        (np.zeros(7), {"second": 1.0}, UnknownNameError, "seconds"),
        (np.zeros(7), {"options": 3}, ShapeError, "options"),
    ],
)
def test_bad_input_is_named(
    shelf: MotionPlanner, goal: Any, more: dict[str, Any], error: type[WbcError], says: str
) -> None:
    with pytest.raises(error, match=says):
        shelf.plan(shelf.stack.robot.neutral, goal, **more)


def test_a_kept_task_has_to_be_in_the_stack() -> None:
    with pytest.raises(UnknownNameError, match="keep"):
        panda().planner(keep=("cup",))


@pytest.mark.parametrize("seed", range(3))
def test_an_edge_that_is_proven_is_clear_by_coal(seed: int) -> None:
    """And nearly all that have some room are proven, those that slide along a board too."""
    rng = np.random.default_rng(seed)
    stack = panda(*SHELF, margin=0.0)
    planner, judge = stack.planner(), CoalJudge(stack)
    native = planner.native(stack.robot.neutral)
    low, high = stack.robot.limits.position_lower, stack.robot.limits.position_upper
    proven = missed = 0
    for _ in range(repeats(100)):
        one = rng.uniform(low, high)
        other = np.clip(one + rng.normal(size=7) * rng.choice([0.02, 0.1, 0.3, 0.8]), low, high)
        margins = [judge.margin(one + share * (other - one)) for share in np.linspace(0.0, 1.0, 60)]
        assert native.margin(one) == pytest.approx(margins[0], abs=1e-6) or margins[0] < 0.0
        if native.free(one) and native.free(other) and native.edge(one, other):
            proven += 1
            assert min(margins) > -1.1e-4
        else:
            missed += min(margins) > 1e-3
    assert proven > 20
    assert missed == 0


def test_what_a_coordinate_does_for_nothing_is_left_out() -> None:
    """A round base turns to and fro while it drives closely around a wall."""
    stack = wbc.Stack(base_with_a_body(), dt=0.01)
    stack.add(wbc.tasks.Obstacle(Box((1.0, 2.0, 1.0)), pose=at(1.5, 0.0, 0.5)), name="wall")
    planner = stack.planner()
    native = planner.native(stack.robot.neutral)
    points = np.array([[0.0, 0.0, 0.0], [0.6, 1.31, 0.8], [2.4, 1.31, -0.8], [3.0, 0.0, 0.0]])
    assert all(native.edge(x, y) for x, y in pairwise(points))
    shortened = native.shortened(points, cuts=0, rounds=1)
    np.testing.assert_array_equal(shortened[:, 2], 0.0)
    assert all(native.edge(x, y) for x, y in pairwise(shortened))

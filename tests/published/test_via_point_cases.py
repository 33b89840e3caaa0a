"""Straight parts in step with slow rotations: the five cases of the via-point generator, and corners that are passed
more slowly so that a hand can wait for its rotation.

Source: M. R. Patterson's thesis on a three-armed grasping walker, 4.3, (4-46) to (4-48) and the listing ARMPTH.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st

from tests.published.via_walker import place
from wbc.trajectory import Law, via_points
from wbc.trajectory.jerk.via_speeds import SpeedBounds, ViaCorners, corner_speeds

#: In m, s; the rotation of the middle segment in rad
SPEED, ACCELERATION, DEVIATION, TURN = 1.2, 1.0, 0.05, 1.0


def bent(middle: float, falling: bool, bends: tuple[float, float] = (1.2, 0.8)) -> list[np.ndarray]:
    """Four poses in a plane with corners of these changes of direction, a rotation between them; the corner that
    bends less, and is passed faster, is the second, or the first where speeds are falling.
    """
    at, heading, poses = np.zeros(2), 0.0, [place(0.0)]
    turns = bends[::-1] if falling else bends
    for k, length in enumerate((2.0, middle, 2.0)):
        at = at + length * np.array([np.cos(heading), np.sin(heading)])
        poses.append(place(at[0], at[1], turn=TURN if k else 0.0))
        heading += turns[k] if k < 2 else 0.0
    return poses


def law_of(poses: list[np.ndarray], turning: float) -> Law:
    return via_points(poses, speed=SPEED, acceleration=ACCELERATION, deviation=DEVIATION, angular_acceleration=turning)


def corners_of(poses: list[np.ndarray], turns: list[float]) -> ViaCorners:
    steps = np.diff([pose[:3, 3] for pose in poses], axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    return corner_speeds(
        lengths, steps / lengths[:, None], np.array(turns), SpeedBounds(SPEED, ACCELERATION, DEVIATION)
    )


def straight_part(law: Law, poses: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(times, speeds, accelerations) of the middle segment's straight part, which is where the law turns."""
    knots = law.path.knots
    turning = np.flatnonzero(np.abs(law.path.evaluate(knots[:-1], 2)[:, 3:]).max(axis=1) > 0.0)
    begin, end = knots[turning[0]], knots[turning[-1] + 1]
    along = poses[2][:3, 3] - poses[1][:3, 3]
    along /= np.linalg.norm(along)
    times = np.linspace(begin, end, 20001)
    inner = np.clip(times, begin + 1e-9, end - 1e-9)
    state = law.at(inner)
    return times - begin, state.velocity[:, :3] @ along, state.acceleration[:, :3] @ along


def case_of(case: int, falling: bool) -> tuple[list[np.ndarray], float, ViaCorners, float]:
    """(poses, angular acceleration, corners, mean speed) with a rotation that takes as long as the case wants."""
    poses = bent(6.0 if case == 1 else 1.5, falling)
    corners = corners_of(poses, [0.0, 0.0, 0.0])
    slow, fast = float(corners.slow[1]), float(corners.fast[1])
    assert 0.1 < slow < fast - 0.1 < SPEED - 0.2
    mean = {
        1: 0.25 * fast + 0.75 * SPEED,
        2: 0.75 * fast + 0.25 * SPEED,
        3: 0.5 * (slow + fast),
        4: 0.8 * slow,
        5: 0.3 * slow,
    }[case]
    time = (fast - slow) / ACCELERATION + float(corners.free[1]) / mean
    return poses, 4.0 * TURN / time**2, corners, mean


@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("case", [1, 2, 3, 4, 5])
def test_the_five_cases(case: int, falling: bool) -> None:
    poses, turning, corners, mean = case_of(case, falling)
    slow, fast = float(corners.slow[1]), float(corners.fast[1])
    time = 2.0 * np.sqrt(TURN / turning)
    rest = time - (fast - slow) / ACCELERATION
    assert time > corners.least_times(SPEED)[0][1]
    times, speeds, pushes = straight_part(law_of(poses, turning), poses)
    assert times[-1] == pytest.approx(time, rel=1e-9)
    assert [speeds[0], speeds[-1]] == pytest.approx(np.sqrt(corners.squares[1:3]), abs=1e-6)
    assert np.trapezoid(speeds, times) == pytest.approx(corners.straight[1], rel=1e-6)
    assert np.abs(pushes).max() <= ACCELERATION * (1.0 + 1e-9)
    even = times[1] * np.count_nonzero(np.abs(pushes) < 1e-12)
    top, bottom = max(speeds), min(speeds)
    if case == 1:
        ramp = rest * (mean - SPEED) / (fast - SPEED)
        assert (top, bottom, even) == pytest.approx((SPEED, slow, rest - 2.0 * ramp), abs=2e-3)
    elif case == 2:
        assert (top, bottom, even) == pytest.approx((2.0 * mean - fast, slow, 0.0), abs=2e-3)
    elif case == 3:
        assert (top, bottom, even) == pytest.approx((fast, slow, rest), abs=2e-3)
        assert speeds[len(speeds) // 2] == pytest.approx(mean, rel=1e-9)
    elif case == 4:
        assert (top, bottom, even) == pytest.approx((fast, 2.0 * mean - slow, 0.0), abs=2e-3)
    else:
        assert (top, bottom, even) == pytest.approx((fast, 0.0, rest * (1.0 - 2.0 * mean / slow)), abs=2e-3)


def test_a_corner_is_slowed_where_a_hand_must_wait() -> None:
    """(4-46), (4-47): with no room to stop in a segment, both speeds are lowered to v^2 = a d / (1 + U + U')."""
    poses = bent(0.5, False)
    free = corners_of(poses, [0.0, 0.0, 0.0])
    slow, fast, room = float(free.slow[1]), float(free.fast[1]), float(free.free[1])
    least = np.sqrt(slow**2 - ACCELERATION * room)
    longest = (slow + fast - 2.0 * least) / ACCELERATION
    assert free.most_times()[1] == pytest.approx(longest, rel=1e-12)
    kept = corners_of(poses, [0.0, 0.999 * longest, 0.0])
    assert np.array_equal(kept.squares, free.squares)
    slowed = corners_of(poses, [0.0, 1.001 * longest, 0.0])
    bends = free.deflections[1] + free.deflections[2]
    assert slowed.squares[1:3] == pytest.approx(ACCELERATION * 0.5 / (1.0 + bends), rel=1e-12)
    # A stop takes v^2 / a of the straight part; the printed speeds leave room, and these would leave none
    assert slowed.squares[1] / ACCELERATION < slowed.straight[1]
    exact = 2.0 * ACCELERATION * 0.5 / (2.0 + bends)
    assert exact / ACCELERATION == pytest.approx(0.5 - exact * bends / (2.0 * ACCELERATION), rel=1e-12)


def test_segments_are_too_short_for_a_change_of_speed() -> None:
    """(4-31): the higher speed is lowered to what the lower one and the segment allow."""
    poses = bent(0.2, False, bends=(2.6, 0.1))
    corners = corners_of(poses, [0.0, 0.0, 0.0])
    low, high = corners.squares[1:3]
    length, bend = 0.2, corners.deflections[2]
    assert high == pytest.approx((low + 2.0 * ACCELERATION * (length - corners.reaches[1])) / (1.0 + bend), rel=1e-12)
    assert high - low == pytest.approx(2.0 * ACCELERATION * corners.straight[1], rel=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.floats(-1.5, 1.5))
@settings(max_examples=30)
def test_random_poses(seed: int, count: int, slowness: float) -> None:
    """Every segment moves and turns in the same time over the right distance, its speed in the bounds."""
    random = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        pose = np.eye(4)
        pose[:3, :3] = pin.exp3(random.normal(size=3))
        pose[:3, 3] = random.normal(size=3)
        poses.append(pose)
    law = law_of(poses, 10.0**slowness)
    assert law.certificate.satisfied
    inside = law.path.knots[1:-1]
    left = np.arange(len(inside))
    for order in (0, 1):
        gap = law.path.evaluate(inside, order, left) - law.path.evaluate(inside, order, left + 1)
        assert np.abs(gap).max(initial=0.0) < 1e-9
    times = np.linspace(0.0, law.duration, 2001)
    state = law.at(times)
    assert np.linalg.norm(state.velocity[:, :3], axis=1).max() <= SPEED * (1.0 + 1e-9)
    assert np.linalg.norm(state.acceleration[:, :3], axis=1).max() <= ACCELERATION * (1.0 + 1e-9)
    assert np.linalg.norm(state.acceleration[:, 3:], axis=1).max() <= 10.0**slowness * (1.0 + 1e-9)
    for k in (0, -1):
        assert state.position[k] == pytest.approx(poses[k], abs=1e-9)
    for pose in poses:
        near = np.linalg.norm(state.position[:, :3, 3] - pose[:3, 3], axis=1).min()
        assert near <= DEVIATION + 0.5 * SPEED * times[1]

"""Published via-point trajectories: M. R. Patterson's thesis on a three-armed grasping walker, section 4.3 and the
routines ARMPTH and SETPTH of its listing.

The thesis prints formulas and no numbers; the numbers are evaluations of its formulas at stated bounds. Where a printed
rule breaks what it promises, ours is tested and the printed one is shown to fail.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from tests.published.via_walker import INCH, inches, place, rot_z, swing
from wbc.rotations import quaternion
from wbc.trajectory import via_points
from wbc.trajectory.jerk.via_speeds import SpeedBounds, corner_speeds
from wbc.trajectory.paths.turning import turn_between

AXIAL, ROUND = swing((13, 12), (13, 16)), swing((13, 12), (17, 12))


@pytest.mark.parametrize(
    ("poses", "deviation", "reach", "speed"),
    [(AXIAL, 1.0, 1.5, 9.2116), (AXIAL, 0.25, 0.7071, 6.3246), (ROUND, 1.0, 1.5, 8.8501)],
)
def test_blends_begin_at_the_published_distance_and_speed(
    poses: list[np.ndarray], deviation: float, reach: float, speed: float
) -> None:
    law = inches(poses, 20.0, 40.0, deviation)
    top = np.sqrt(40.0 * (3.0 - reach - speed**2 / 80.0) + speed**2)  # (4-33)
    first = (2.0 * top - speed) / 40.0  # (4-34)
    blend = 2.0 * reach / speed  # (4-22)
    for time in (first, first + blend, law.duration - first - blend, law.duration - first):
        assert np.linalg.norm(law.at(time).velocity[:3]) / INCH == pytest.approx(speed, abs=1e-3)
    corner = poses[1][:3, 3]
    assert np.linalg.norm(law.at(first).position[:3, 3] - corner) / INCH == pytest.approx(reach, abs=1e-3)
    assert np.linalg.norm(law.at(first + blend).position[:3, 3] - corner) / INCH == pytest.approx(reach, abs=1e-3)


@pytest.mark.parametrize(
    ("poses", "bounds"),
    [(AXIAL, (20.0, 40.0, 1.0)), (AXIAL, (12.0, 12.0, 1.0)), (AXIAL, (20.0, 40.0, 0.25)), (ROUND, (20.0, 40.0, 1.0))],
)
def test_bounds_hold_every_millisecond(poses: list[np.ndarray], bounds: tuple[float, float, float]) -> None:
    law = inches(poses, *bounds)
    state = law.at(np.arange(0.0, law.duration, 1e-3))
    linear = state.velocity[:, :3]
    assert np.linalg.norm(linear, axis=1).max() <= bounds[0] * INCH * (1.0 + 1e-12)
    assert np.linalg.norm(state.acceleration[:, :3], axis=1).max() <= bounds[1] * INCH * (1.0 + 1e-12)
    assert np.linalg.norm(state.acceleration[:, 3:], axis=1).max() <= 4.0 * (1.0 + 1e-12)
    corners = [pose[:3, 3] for pose in poses]
    off = np.min([_distance(state.position[:, :3, 3], a, b) for a, b in pairwise(corners)], axis=0)
    assert 0.1 * bounds[2] * INCH < off.max() <= bounds[2] * INCH
    # Blends, where the acceleration leaves the line of the velocity, do not turn
    across = np.linalg.norm(np.cross(linear, state.acceleration[:, :3]), axis=1) > 1e-9
    assert across.sum() > 100
    assert not state.velocity[across, 3:].any()


def _distance(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """From points to a line segment."""
    share = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(points - a - share[:, None] * (b - a), axis=1)


def test_the_certificate_is_exact_and_calls_the_jerk_unbounded() -> None:
    certificate = inches(AXIAL, 20.0, 40.0).certificate
    assert certificate.satisfied
    assert {name: w.kind for name, w in certificate.worst.items()} == {
        "velocity": "exact",
        "acceleration": "exact",
        "jerk": "unbounded",
    }
    assert certificate.worst["velocity"].ratio == pytest.approx(1.0, abs=1e-12)


def test_rotations_alone_are_accelerated_over_half_their_time() -> None:
    """T = 2 sqrt(phi / alpha) (4-44), rate and angle as evaluated in the listing."""
    angle, rate = 1.2, 3.0
    law = via_points(
        [place(0.0), place(0.0, turn=angle)], speed=1.0, acceleration=1.0, deviation=0.0, angular_acceleration=rate
    )
    half = np.sqrt(angle / rate)
    assert law.duration == pytest.approx(2.0 * half, rel=1e-12)
    for e in np.linspace(0.0, 2.0 * half, 41):
        if e <= half:
            speed, turned = rate * e, 0.5 * rate * e**2
        else:
            late = e - half
            speed, turned = rate * half - rate * late, 0.5 * rate * half**2 + rate * half * late - 0.5 * rate * late**2
        state = law.at(e)
        assert state.velocity == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, speed], abs=1e-12)
        assert state.position[:3, :3] == pytest.approx(rot_z(turned), abs=1e-12)


def test_a_rotation_with_time_to_spare_is_slowed() -> None:
    """alpha = MAXROA (T_rot / T_trans)^2 (4-45)."""
    angle, rate = 0.4, 3.0
    law = via_points(
        [place(0.0), place(2.0, turn=angle)], speed=1.0, acceleration=1.0, deviation=0.0, angular_acceleration=rate
    )
    assert law.duration == pytest.approx(3.0, rel=1e-12)
    assert law.at(1.0).acceleration[5] == pytest.approx(rate * (2.0 * np.sqrt(angle / rate) / 3.0) ** 2, rel=1e-12)
    assert law.at(1.5).position == pytest.approx(place(1.0, turn=0.5 * angle), abs=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_half_turns_are_about_the_published_axis(seed: int) -> None:
    axis = np.random.default_rng(seed).normal(size=3)
    axis[[[], [0], [1], [2], [0, 1], [0, 2], [1, 2], []][seed]] = 0.0
    axis /= np.linalg.norm(axis)
    half = 2.0 * np.outer(axis, axis) - np.eye(3)
    ours = turn_between(quaternion(np.eye(3)), quaternion(half))
    assert np.linalg.norm(ours) == pytest.approx(np.pi, rel=1e-12)
    printed = _printed_half_turn(half)
    assert min(np.abs(ours / np.pi - printed).max(), np.abs(ours / np.pi + printed).max()) < 1e-12
    end = np.eye(4)
    end[:3, :3] = half
    law = via_points([np.eye(4), end], speed=1.0, acceleration=1.0, deviation=0.0, angular_acceleration=1.0)
    assert law.at(law.duration).position == pytest.approx(end, abs=1e-12)


def _printed_half_turn(r: np.ndarray) -> np.ndarray:
    """The axis that the listing takes from the symmetric part."""
    q = np.array([r[2, 1] + r[1, 2], r[0, 2] + r[2, 0], r[1, 0] + r[0, 1]]) / 2.0
    if abs(q[0]) < 1e-6 and abs(q[1]) < 1e-6:
        if r[2, 2] < -0.9999:
            angle = np.arctan2(q[2], r[0, 0]) / 2.0
            return np.array([np.cos(angle), np.sin(angle), 0.0])
        return np.array([0.0, 0.0, 1.0])
    angle = np.arctan2(q[0], q[1])
    double = q[1] / np.cos(angle) if abs(np.cos(angle)) > 1e-6 else q[0] / np.sin(angle)
    tilt = np.arctan2(double, r[2, 2]) / 2.0
    return np.array([np.cos(angle) * np.sin(tilt), np.sin(angle) * np.sin(tilt), np.cos(tilt)])


@pytest.mark.parametrize("angle", [1e-12, 1e-8, 1e-7, np.pi - 1e-7, np.pi - 1e-12])
def test_turns_that_the_listing_rounds_are_made(angle: float) -> None:
    """It drops those below 1e-6 rad, and makes half turns of those within 1e-6 rad."""
    end = np.eye(4)
    end[:3, :3] = pin.exp3(angle * np.array([0.6, 0.0, 0.8]))
    law = via_points([np.eye(4), end], speed=1.0, acceleration=1.0, deviation=0.0, angular_acceleration=1.0)
    assert law.duration == pytest.approx(2.0 * np.sqrt(angle), rel=1e-3)
    assert np.abs(law.at(law.duration).position - end).max() < 1e-15 + 1e-9 * min(angle, np.pi - angle)


def test_points_on_a_line_are_passed_within_the_speed() -> None:
    """4-28 has no bound for corners without a bend; lowered by 4-31 alone, the hand would pass at twice the speed."""
    points = [place(0.0), place(1.0), place(2.0)]
    law = via_points(points, speed=0.7, acceleration=1.0, deviation=0.1, angular_acceleration=1.0)
    whole = via_points([points[0], points[-1]], speed=0.7, acceleration=1.0, deviation=0.1, angular_acceleration=1.0)
    assert law.duration == pytest.approx(whole.duration, rel=1e-12)
    assert law.certificate.ratio == pytest.approx(1.0, abs=1e-12)
    printed = corner_speeds(np.ones(2), np.array([[1.0, 0.0, 0.0]] * 2), np.zeros(2), SpeedBounds(10.0, 1.0, 0.1))
    assert np.sqrt(printed.squares[1]) == pytest.approx(np.sqrt(2.0))


def test_small_units_do_not_loosen_the_acceleration() -> None:
    """Printed, an excess of 1e-4 is let be, which is everything where accelerations are 1e-5."""
    poses = [place(0.0), place(1.0), place(1.0, 0.01), place(3.0, 0.02)]
    law = via_points(poses, speed=1.0, acceleration=1e-5, deviation=1.0, angular_acceleration=1.0)
    sizes = np.linalg.norm(law.at(np.linspace(0.0, law.duration, 5001)).acceleration[:, :3], axis=1)
    assert sizes.max() <= 1e-5 * (1.0 + 1e-9)

"""The planner of the published walker, piece by piece: grid, reach, margins, holds, swings, grasps.

Source: M. R. Patterson's thesis on a three-armed grasping walker. It prints no numbers of the planner; those here are
evaluations of the formulas of its listing, with the shoulders 12 in off centre and the body 52 in above the cylinder.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.published.three_arms import INCH
from wbc.published.three_arm_walker import WalkerCalibration
from wbc.published.three_arm_walker.gait.gait import Gait, swing_poses
from wbc.published.three_arm_walker.gait.holds import handholds
from wbc.published.three_arm_walker.gait.margin import margins
from wbc.published.three_arm_walker.machine import grid
from wbc.published.three_arm_walker.machine.grid import Place, Terrain, frame
from wbc.published.three_arm_walker.machine.motion import CYCLE, BodyMotion
from wbc.published.three_arm_walker.machine.plant import IdealPlant, body_twist
from wbc.published.three_arm_walker.machine.reach import Shoulders, View, reach_radius

SHOULDERS = Shoulders(12.0, 52.0)
BODY = frame(13, 12, 152.0)
HELD: list[Place] = [(13, 15), (15, 11), (11, 11)]
AHEAD, BACK, ROUND, SPIN = (0.0, 0.1, 0.0), (0.0, -0.1, 0.0), (0.1, 0.0, 0.0), (0.0, 0.0, 0.05)


def values(arm: int, rates: tuple[float, ...], places: list[Place]) -> np.ndarray:
    twist = body_twist(BODY, np.array(rates), 52.0)
    return margins(View(SHOULDERS, BODY), arm, twist, np.array(places, dtype=float))


@pytest.mark.parametrize(
    ("place", "point"),
    [((13, 12), (0.0, 100.0, -111.0)), ((1, 1), (-86.6025, 50.0, -9.25)), ((25, 24), (86.6025, 50.0, -222.0))],
)
def test_06_holds_stand_on_the_cylinder(place: Place, point: tuple[float, ...]) -> None:
    pose = frame(*place)
    assert pose[:3, 3] == pytest.approx(point, abs=1e-4)
    assert pose[:3, 2] == pytest.approx(-np.array([*pose[:2, 3], 0.0]) / 100.0, abs=1e-12)
    assert pose[:3, 0] == pytest.approx([0.0, 0.0, -1.0], abs=1e-12)
    assert grid.coordinates(pose[:3, 3]) == pytest.approx(place, abs=1e-12)


def test_06_euler_angles_come_back() -> None:
    random = np.random.default_rng(6)
    for alpha, beta, gamma in random.uniform([-np.pi, 0.01, -np.pi], [np.pi, np.pi - 0.01, np.pi], (50, 3)):
        assert grid.euler_angles(grid.rotation(alpha, beta, gamma)) == pytest.approx((alpha, beta, gamma), abs=1e-9)
    straight = grid.rotation(0.3, 0.0, 0.4)
    assert grid.rotation(*grid.euler_angles(straight)) == pytest.approx(straight, abs=1e-12)
    assert grid.rotation(-np.pi / 2, np.pi / 2, 0.0) == pytest.approx(
        np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]]), abs=1e-12
    )


@pytest.mark.parametrize(
    ("shoulder", "height", "radius"),
    [
        *((r, 52.0, x) for r, x in ((10, 2.5243), (12, 2.4724), (15, 2.3873), (18, 2.2926), (20, 2.2235))),
        *((r, 52.0, x) for r, x in ((24, 2.0701), (26, 1.9849), (30, 1.7958))),
        *(
            (12, h, x)
            for h, x in ((44, 3.099), (46, 2.964), (48, 2.815), (50, 2.652), (54, 2.273), (56, 2.05), (58, 1.796))
        ),
    ],
)
def test_07_radius_of_the_reach(shoulder: float, height: float, radius: float) -> None:
    assert reach_radius(shoulder, height) == pytest.approx(radius, abs=1e-3)


def test_08_bases_and_margins() -> None:
    view = View(SHOULDERS, BODY)
    expected = [[13.0, 13.2973], [14.1253, 11.3514], [11.8747, 11.3514]]
    assert view.bases == pytest.approx(np.array(expected), abs=1e-4)
    for rates, held in (
        (AHEAD, (0.8378, 1.9612, 1.9612)),
        (BACK, (0.7697, 2.6639, 2.6639)),
        (ROUND, (1.7927, 0.0844, 1.5726)),
        (SPIN, (1.7927, 2.1574, 2.4216)),
    ):
        assert [values(k, rates, HELD[k : k + 1])[0] for k in range(3)] == pytest.approx(held, abs=1e-3)
    others = values(0, AHEAD, [(14, 15), (12, 15), (14, 14), (13, 14)])
    assert others == pytest.approx([3.432, 3.432, 2.432, -0.1622], abs=1e-3)


def test_08_the_text_has_the_outer_circle_only() -> None:
    twist = body_twist(BODY, np.array(AHEAD), 52.0)
    found = margins(View(SHOULDERS, BODY), 0, twist, np.array([HELD[0]], dtype=float), "text")
    assert found == pytest.approx([4.1751], abs=1e-3)


def listed(arm: int, terrain: Terrain) -> list[Place]:
    view = View(SHOULDERS, BODY)
    hand = view.place(frame(*HELD[arm])[:3, 3])
    return [(int(t), int(a)) for t, a in handholds(view, arm, hand, terrain, HELD[arm])]


def test_09_lists_of_holds() -> None:
    terrain = Terrain()
    first = [(11, 12), (11, 13), (11, 14), (12, 14), (12, 15), (14, 14), (14, 15), (15, 12), (15, 13), (15, 14)]
    assert listed(0, terrain) == first
    assert listed(1, terrain) == [(14, 9), (15, 10), (16, 10), (16, 11), (16, 12)]
    assert listed(0, Terrain([(14, 15)])) == [place for place in first if place != (14, 15)]
    assert listed(0, Terrain(first)) == []


@pytest.mark.parametrize(
    ("goal", "bounds", "duration"),
    [
        ((13, 16), (20.0, 40.0, 1.0, 4.0), 3.0483),
        ((13, 16), (12.0, 12.0, 1.0, 4.0), 5.3653),
        ((13, 16), (20.0, 40.0, 0.25, 4.0), 3.2010),
        ((17, 12), (20.0, 40.0, 1.0, 4.0), 3.0252),
        ((17, 12), (20.0, 40.0, 1.0, 1.0), 3.0252),
    ],
)
def test_10_swings(goal: Place, bounds: tuple[float, ...], duration: float) -> None:
    speed, acceleration, deviation, turning = bounds
    known = WalkerCalibration(
        hand_speed=speed * INCH,
        hand_acceleration=acceleration * INCH,
        corner_deviation=deviation * INCH,
        hand_angular_acceleration=turning,
    )
    poses = swing_poses(frame(13, 12), (13, 12), goal)
    motion = BodyMotion(poses, known)
    assert motion.duration == pytest.approx(duration, abs=1e-3)
    assert [round(float(np.hypot(*pose[:2, 3])), 9) for pose in poses] == [100.0, 103.0, 103.0, 100.0]
    cycles = range(int(np.ceil(duration / CYCLE)) + 3)
    states = [motion.at(k) for k in cycles]
    assert states[0][0] == pytest.approx(poses[0], abs=1e-12)
    assert np.array_equal(states[-1][0], poses[-1])
    assert not states[-1][1].any()
    speeds = [np.linalg.norm(twist[:3]) for _, twist in states]
    assert 0.4 * speed < max(speeds) <= speed * (1.0 + 1e-12)
    # Positions are the integral of the velocities: Simpson would need the middles, so bounded by the acceleration
    for (a, va), (b, vb) in pairwise(states[:-1]):
        mean = 0.5 * (va[:3] + vb[:3]) * CYCLE
        assert np.abs(b[:3, 3] - a[:3, 3] - mean).max() <= 0.25 * acceleration * CYCLE**2


@pytest.mark.parametrize(("columns", "clearance"), [(4, 1.44), (5, 0.56), (6, -0.51)])
def test_10_long_swings_dip_below_the_surface(columns: int, clearance: float) -> None:
    _, lifted, above, _ = swing_poses(frame(10, 12), (10, 12), (10 + columns, 12))
    middle = 0.5 * (lifted + above)[:3, 3]
    assert np.hypot(*middle[:2]) - 100.0 == pytest.approx(clearance, abs=5e-3)


def test_11_slow_rotations_stretch_the_swing() -> None:
    """Each straight part lasts as long as its rotation; the generator's five cases are tests of their own."""
    poses = swing_poses(frame(13, 12), (13, 12), (17, 12))
    slow = BodyMotion(poses, WalkerCalibration(hand_angular_acceleration=0.05))
    turn = np.radians(20.0)
    assert slow.duration > 2.0 * np.sqrt(turn / 0.05)
    assert np.array_equal(slow.at(int(slow.duration / CYCLE) + 1)[0], poses[-1])
    rates = [np.linalg.norm(slow.at(k)[1][3:]) for k in range(int(slow.duration / CYCLE) + 1)]
    assert max(rates) == pytest.approx(np.sqrt(turn * 0.05), rel=0.03)


class OffTarget(IdealPlant):
    """Ideal tracking, but for an offset of the hand along the structure [in]."""

    offset = 0.0

    def place(self, arm: int, pose: np.ndarray) -> int | None:
        off = pose.copy()
        off[2, 3] += self.offset
        return super().place(arm, off)


@pytest.mark.parametrize(("offset", "grasps"), [(0.9, True), (1.1, False)])
def test_12_hands_within_an_inch_grasp(offset: float, grasps: bool) -> None:
    plant = OffTarget(SHOULDERS, BODY)
    plant.offset = offset
    gait = Gait(SHOULDERS, Terrain(), WalkerCalibration())
    for k in range(3):
        plant.hands[k] = frame(*HELD[k])
        gait.places[k], gait.supporting[k] = HELD[k], True
    twist = np.zeros(6)
    assert gait.plan(0, plant, twist, None)
    first = gait.replans[0]
    gait.threshold = -10.0
    while gait.in_air is not None and gait.time < first.duration + 1.5:
        plant.move(twist, gait.step(plant, twist))
        gait.cycle += 1
    assert all(gait.supporting) is grasps
    if grasps:
        assert gait.late == []
        assert 0.0 < gait.time - first.duration < 0.2 + 1e-9
        assert plant.hands[0][2, 3] - frame(*first.new)[2, 3] == pytest.approx(0.9)
    else:
        assert 1.0 <= gait.late[0] - first.duration < 1.1
        assert gait.replans[1].time == gait.late[0]
        assert gait.replans[1].new != first.new

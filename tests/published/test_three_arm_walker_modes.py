"""Modes and supervision of the published three-armed walker, its joint rates, and its border in SI units.

Source: M. R. Patterson's thesis, 3.3, 5.2, 6.1 and the listings MAIN and SOLVE.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.published.three_arms import INCH, along, driven, hold_offsets
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.published.three_arm_walker import PublishedWalker, WalkerCalibration
from wbc.published.three_arm_walker.machine.grid import frame
from wbc.published.three_arm_walker.modes import DestinationCommand, Waypoints, joystick


def hands_at(walker: PublishedWalker) -> list[Any]:
    return list(walker.supervisor.gait.places)


def test_19_destinations() -> None:
    turn = np.radians(30.0)
    line = Waypoints(np.array([[13.0, 12.0, 0.0], [17.0, 12.0, turn], [17.0, 20.0, turn]]))
    assert line.times == pytest.approx([0.0, 30.0, 62.0], abs=1e-12)
    assert line.at(10.0)[1] == pytest.approx([0.13333, 0.0, np.radians(1.0)], abs=1e-5)
    assert line.at(40.0)[1] == pytest.approx([0.0, 0.25, 0.0], abs=1e-12)
    walker = PublishedWalker((13, 12))
    outcome = walker.to([(17, 12, turn), (17, 20, turn)])
    assert (outcome.reason, outcome.message) == ("reached", "TERMINAL POSITION REACHED")
    assert outcome.time == pytest.approx(62.0, abs=0.1 + 1e-9)
    assert walker.place == pytest.approx((17.0, 20.0, turn), abs=0.1)
    assert outcome.set_down
    places = walker.log.part(outcome.rows).bodies[:, :3, 3] / INCH
    assert places[300, 2] == pytest.approx(-9.25 * 12.0, abs=1e-6)
    assert np.degrees(np.arctan2(places[300, 1], -places[300, 0])) == pytest.approx(110.0, abs=1e-6)


def test_19_the_end_is_reached_within_a_tenth() -> None:
    command = DestinationCommand([(13.0, 12.0, 0.0)])
    assert command(0.0, np.array([13.0, 12.0, 0.0])) is None
    assert command(0.1, np.array([13.09, 12.0, -0.09])) is None
    off = command(0.2, np.array([13.11, 12.0, 0.0]))
    assert off == pytest.approx([-1.1, 0.0, 0.0])
    strict = DestinationCommand([(13.0, 12.0, 0.0)], end=0.1)
    assert strict(0.0, np.array([13.0, 12.0, 0.0])) is None
    assert strict(0.1, np.array([13.02, 12.0, 0.0])) is not None


def test_20_the_joystick() -> None:
    assert not joystick((639, 0, 640)).any()
    assert joystick((640, -640, 1279)) == pytest.approx([1e-5, 0.0, 0.0])
    full = joystick((32767, -32768, 32767))
    assert full[0] * 9.25 == pytest.approx(2.97, abs=5e-3)
    assert full[1] == pytest.approx(-full[0], rel=1e-3)
    assert full[2] == pytest.approx(0.0492, abs=5e-5)
    walker = PublishedWalker()
    outcome = walker.joystick((0, 32767, 0), 2.0)
    assert walker.place[1] == pytest.approx(12.0 + 2.0 * full[1] * -1.0, abs=1e-3)
    assert outcome.reason == "time"


def test_20_height_and_tangency_come_back_while_walking() -> None:
    walker, outcome = driven((13, 12), (0.0, 1.0, 0.0), duration=3.0, offset=2.0 * INCH, tilt=(0.1, -0.1))
    assert outcome.reason == "time"
    bodies = walker.log.part(outcome.rows).bodies
    radii = np.hypot(bodies[:, 0, 3], bodies[:, 1, 3])
    heights = radii / INCH - 100.0
    assert heights[0] == pytest.approx(54.0)
    assert heights[1:] == pytest.approx(52.0, abs=1e-9)
    cosines = -np.einsum("mi,mi->m", bodies[:, :2, 2], bodies[:, :2, 3]) / radii
    tilts = np.arccos(np.minimum(cosines, 1.0))
    assert tilts[0] > 0.14
    assert tilts[1] < 1e-3
    assert tilts[-1] < 1e-6


def test_20_the_key_sets_all_arms_down() -> None:
    walker = PublishedWalker((13, 12))
    outcome = walker.drive((0.0, 3.0 * INCH, 0.0), key=lambda time: time >= 1.0)
    assert (outcome.reason, outcome.time, outcome.set_down) == ("key", 1.0, True)
    log = walker.log
    assert not log.supporting[outcome.rows][-1].all()
    assert walker.supervisor.gait.in_air is None
    body = log.bodies[outcome.rows.stop :]
    assert len(body) > 5
    assert np.array_equal(body, np.broadcast_to(body[0], body.shape))
    for place, hand in zip(hands_at(walker), walker.supervisor.plant.hands, strict=True):
        assert hand == pytest.approx(frame(*place), abs=1e-9)


def test_20_a_joint_at_its_limit_names_joint_and_arm() -> None:
    walker, outcome = along(4.0, 6, 18)
    assert (outcome.reason, outcome.joint, outcome.arm) == ("limits", 3, 3)
    assert outcome.message == "JOINT 3 OF ARM 3 IS OUT OF LIMITS."
    # Nothing of the cycle that failed was carried out: the next mode goes on from there
    assert walker.drive((0.0, -1.0 * INCH, 0.0), 2.0).reason == "time"


def test_20_no_hold_to_begin_from() -> None:
    everything = [(t, a) for t in range(1, 26) for a in range(1, 25) if (t, a) not in ((13, 15), (16, 11))]
    walker = PublishedWalker((13, 12), removed=everything)
    outcome = walker.drive((0.0, INCH, 0.0), 5.0)
    assert (outcome.reason, outcome.arm, outcome.set_down) == ("no hold", 3, False)
    assert outcome.message == "ARM 3 IS ON NO HANDHOLD."
    assert walker.place == pytest.approx((13.0, 12.0, 0.0), abs=1e-12)


def test_20_one_arm_goes_to_a_hold_while_two_hold() -> None:
    walker = PublishedWalker((13, 12))
    outcome = walker.handhold(1, (14, 15))
    assert outcome.reason == "reached"
    assert hands_at(walker) == [(14, 15), (16, 11), (10, 11)]
    log = walker.log.part(outcome.rows)
    assert np.array_equal(log.supporting[1:], np.tile([False, True, True], (len(log.times) - 1, 1)))
    assert np.linalg.norm(log.bodies[:, :3, 3] - log.bodies[0, :3, 3], axis=1).max() < 0.1 * INCH
    assert hold_offsets(walker.log).max() < 1e-9
    assert walker.supervisor.plant.hands[0] == pytest.approx(frame(14, 15), abs=1e-9)


def test_20_a_hold_out_of_reach_is_refused_on_the_way() -> None:
    walker = PublishedWalker((13, 12))
    outcome = walker.handhold(1, (13, 20))
    assert (outcome.reason, outcome.joint, outcome.arm, outcome.set_down) == ("limits", 3, 1, True)


def test_20_one_arm_is_moved_past_poses_and_by_hand() -> None:
    walker = PublishedWalker((13, 12))
    walker.handhold(1, (13, 15))
    start = walker.log.hands[-1, 0]
    goal = start.copy()
    goal[:3, 3] += [0.0, 4.0 * INCH, -2.0 * INCH]
    outcome = walker.hand_to(1, [goal])
    assert outcome.reason == "reached"
    log = walker.log.part(outcome.rows)
    # The last cycle begins before the end, and arrival is within an inch
    assert log.hands[-1, 0] == pytest.approx(goal, abs=INCH)
    assert not log.supporting[1:, 0].any()
    assert log.supporting[:, 1:].all()
    outcome = walker.hand_at(1, (0.0, INCH, 0.0, 0.0, 0.0, 0.1), 2.0)
    log = walker.log.part(outcome.rows)
    assert log.hands[-1, 0, :3, 3] - log.hands[0, 0, :3, 3] == pytest.approx([0.0, 1.9 * INCH, 0.0], abs=1e-9)
    assert outcome.set_down
    outcome = walker.hand_at(1, (0.0, 0.0, -10.0 * INCH, 0.0, 0.0, 0.0), 5.0)
    assert (outcome.reason, outcome.joint, outcome.arm) == ("limits", 3, 1)


@pytest.mark.parametrize("singular", ["listing", "text"])
@pytest.mark.parametrize(("speed", "time", "arm"), [(1.0, 3.8, 2), (3.0, 3.1, 3)])
def test_joint_rates_break_the_wrist(singular: Any, speed: float, time: float, arm: int) -> None:
    """Known to fail: hands stand on the normal with a fixed yaw, so the wrist passes the alignment of axes 4 and 6."""
    walker, outcome = along(speed, 6, 18, tracking="rates", singular=singular)
    assert (outcome.reason, outcome.joint, outcome.arm, outcome.time) == ("limits", 4, arm, time)
    log = walker.log.part(outcome.rows)
    assert log.bodies[-1, 2, 3] / INCH == pytest.approx(-9.25 * 6.0 - speed * (time - 0.1), abs=0.2)
    assert (log.supporting.sum(axis=1) >= 2).all()


def test_the_log_is_in_metres() -> None:
    walker = PublishedWalker((13, 12), heading=0.2)
    outcome = walker.drive((0.0, 0.05, 0.01), 1.0)
    log = walker.log.part(outcome.rows)
    assert log.bodies[0, :3, 3] == pytest.approx([0.0, 152.0 * INCH, -111.0 * INCH], abs=1e-12)
    assert log.bodies[-1, 2, 3] - log.bodies[0, 2, 3] == pytest.approx(-0.05 * 0.9, abs=1e-9)
    assert np.diff(log.times) == pytest.approx(0.1)
    assert log.commands == pytest.approx(np.tile([0.0, 0.05, 0.01], (10, 1)))
    walker = PublishedWalker((13, 12))
    outcome = walker.drive((0.05, 0.0, 0.0), 0.5)
    assert walker.log.commands[outcome.rows] == pytest.approx(np.tile([0.05, 0.0, 0.0], (5, 1)))


@pytest.mark.parametrize(
    ("options", "error", "field"),
    [
        ({"place": (0, 12)}, RangeError, "place[0]"),
        ({"place": (13, 25)}, RangeError, "place[1]"),
        ({"place": (13,)}, ShapeError, "place"),
        ({"place": (13, np.nan)}, NotFiniteError, "place"),
        ({"height": -1.0}, RangeError, "height"),
        ({"height": 3.0}, RangeError, "height"),
        ({"removed": [(26, 1)]}, RangeError, "removed"),
        ({"removed": [(1.5, 1)]}, RangeError, "removed"),
        ({"tracking": "real"}, UnknownNameError, "tracking"),
        ({"margin": "figure"}, UnknownNameError, "margin"),
        ({"singular": "both"}, UnknownNameError, "singular"),
        ({"tilt": (0.1,)}, ShapeError, "tilt"),
    ],
)
def test_wrong_walkers_are_refused(options: dict[str, Any], error: type[WbcError], field: str) -> None:
    with pytest.raises(error) as caught:
        PublishedWalker(**options)
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("call", "error", "field"),
    [
        (lambda w: w.drive((0.0, 0.1, 0.0)), RangeError, "duration"),
        (lambda w: w.drive((0.0, 0.1), 1.0), ShapeError, "velocity"),
        (lambda w: w.to([]), ShapeError, "points"),
        (lambda w: w.to([(13, 30, 0.0)]), RangeError, "points[0][1]"),
        (lambda w: w.handhold(4, (13, 15)), RangeError, "arm"),
        (lambda w: w.handhold(1, (13, 14)), RangeError, "place"),
        (lambda w: w.hand_to(1, []), ShapeError, "poses"),
        (lambda w: w.hand_to(1, [np.zeros((4, 4))]), WbcError, "poses[0]"),
        (lambda w: w.hand_at(1, (0.0,) * 5, 1.0), ShapeError, "twist"),
    ],
)
def test_wrong_commands_change_nothing(call: Any, error: type[WbcError], field: str) -> None:
    walker = PublishedWalker(removed=[(13, 14)])
    before = walker.place
    with pytest.raises(error) as caught:
        call(walker)
    assert caught.value.field == field
    assert walker.place == before
    assert len(walker.log.times) == 0


@pytest.mark.parametrize(
    ("options", "error", "field"),
    [
        ({"hand_speed": 0.0}, RangeError, "WalkerCalibration.hand_speed"),
        ({"shoulder_radius": np.inf}, NotFiniteError, "WalkerCalibration.shoulder_radius"),
        ({"joint_rates": (1.0,) * 5}, ShapeError, "WalkerCalibration.joint_rates"),
        ({"joint_rates": (1.0, 1.0, 0.0, 1.0, 1.0, 1.0)}, RangeError, "WalkerCalibration.joint_rates[2]"),
    ],
)
def test_wrong_calibrations_are_refused(options: dict[str, Any], error: type[WbcError], field: str) -> None:
    with pytest.raises(error) as caught:
        WalkerCalibration(**options)
    assert caught.value.field == field

"""Walks of the published three-armed walker on ideal tracking: what its thesis claims, and where it fails.

Source: M. R. Patterson's thesis, 6.1: 3 in/s, 0.05 rad/s, trenches of four fifths of the diameter of an arm's reach,
a new plan for a swing that is 1 s late. It prints no tables or times. Those here are of this planner with the numbers
of ``Calibration``, which were chosen so that the first claim holds; an independent program gave the same ones.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.published.three_arms import INCH, along, driven, hold_offsets, rows, shared
from wbc.published.three_arm_walker import PublishedOutcome, PublishedWalker
from wbc.published.three_arm_walker.machine.reach import reach_radius


def check_held(walker: PublishedWalker, outcome: PublishedOutcome) -> None:
    """Two arms hold in every cycle, within the tolerance."""
    log = walker.log.part(outcome.rows)
    assert len(log.times) > 10
    assert (log.supporting.sum(axis=1) >= 2).all()
    assert hold_offsets(log).max() <= 1.0


def least(walker: PublishedWalker) -> float:
    return min(walker.supervisor.gait.least)


def test_13_three_inches_a_second_along_the_cylinder() -> None:
    walker, outcome = along(3.0, 6, 18)
    assert (outcome.reason, outcome.joint) == ("key", None)
    assert outcome.time == pytest.approx(37.0, abs=1e-9)
    check_held(walker, outcome)
    gait = walker.supervisor.gait
    assert len(gait.lifts) == 13
    assert least(walker) == pytest.approx(-0.33, abs=5e-3)
    first, second, third, fourth = gait.lifts[:4]
    # An exact tie of two holds
    assert first.new in ((12, 9), (14, 9))
    got = [(x.time, x.arm, x.old, round(x.margin_after, 3), round(x.duration, 2)) for x in (first, second, third)]
    assert got == [
        (0.0, 1, (13, 9), 3.432, 1.65),
        (1.7, 2, (16, 5), 4.41, 2.66),
        (4.4, 3, (10, 5), 4.534, 3.1),
    ]
    assert [x.margin_before for x in (first, second, third)] == pytest.approx([0.838, 0.709, -0.166], abs=5e-4)
    assert (second.new, third.new) == ((15, 8), (11, 9))
    assert (fourth.time, fourth.arm) == (7.6, 1)


@pytest.mark.parametrize(("speed", "time", "lifts", "taken"), [(3.0, 57.5, 17, 154), (4.0, 43.2, 16, 0)])
def test_walks_round_the_cylinder_share_holds(speed: float, time: float, lifts: int, taken: int) -> None:
    """Known to fail: nothing keeps two arms from one hold."""
    walker, outcome = driven((6, 12), (speed, 0.0, 0.0), lambda place: place[0] >= 19.0)
    assert (outcome.reason, outcome.time) == ("key", time)
    assert len(outcome.lifts) == lifts
    assert shared(walker.log.part(outcome.rows)).sum() == taken


@pytest.mark.parametrize(("rate", "margin"), [(0.05, 0.96), (0.1, 0.56)])
def test_14_turning_on_the_spot(rate: float, margin: float) -> None:
    turn = 2.0 * np.pi / rate
    walker, outcome = driven((13, 12), (0.0, 0.0, rate), duration=turn)
    assert outcome.reason == "time"
    assert outcome.time == pytest.approx(turn, abs=0.1)
    log = walker.log.part(outcome.rows)
    assert np.linalg.norm(log.bodies[:, :3, 3] - log.bodies[0, :3, 3], axis=1).max() < 0.1 * INCH
    check_held(walker, outcome)
    lifts = [lift.arm for lift in outcome.lifts]
    assert [lifts.count(arm) for arm in (1, 2, 3)] == [8, 8, 8]
    assert least(walker) == pytest.approx(margin, abs=5e-3)
    heading = outcome.time * rate - 2.0 * np.pi
    assert walker.place[2] == pytest.approx(heading, abs=1e-6)


@pytest.mark.parametrize(("start", "goal", "time"), [(6, 18, 3.8), (18, 6, 5.4)])
def test_15_too_fast_ends_out_of_reach(start: int, goal: int, time: float) -> None:
    """Known to fail: at 4 in/s the body is not slowed; the walker stops, and says at which joint."""
    walker, outcome = along(4.0, start, goal)
    assert (outcome.reason, outcome.time) == ("limits", time)
    assert outcome.message == f"JOINT 3 OF ARM {outcome.arm} IS OUT OF LIMITS."
    check_held(walker, outcome)


def test_16_a_trench_of_four_fifths_of_the_reach_is_crossed() -> None:
    walker, outcome = along(1.0, 6, 20, rows(12, 13, 14))
    assert (outcome.reason, outcome.time) == ("key", 129.6)
    assert len(outcome.lifts) == 20
    assert 4.0 / (2.0 * reach_radius(12.0, 52.0)) == pytest.approx(0.81, abs=5e-3)
    check_held(walker, outcome)
    assert not np.isin(walker.log.places[..., 1], (12, 13, 14)).any()


def test_16_a_wider_trench_is_not_crossed() -> None:
    """Known to fail: without a hold to go to the body goes on until an arm is straight."""
    walker, outcome = along(1.0, 6, 20, rows(12, 13, 14, 15))
    assert (outcome.reason, outcome.time, outcome.joint) == ("limits", 61.5, 3)
    assert walker.place[1] == pytest.approx(6.0 + 61.5 / 9.25, abs=1e-6)
    assert 5.0 / (2.0 * reach_radius(12.0, 52.0)) > 1.0
    check_held(walker, outcome)


def reversal(time: float) -> tuple[PublishedWalker, PublishedOutcome]:
    return driven((13, 6), lambda t: (0.0, 3.0 if t < time - 1e-9 else -3.0, 0.0), duration=20.0)


def test_17_a_reversal_ends_out_of_reach() -> None:
    """Known to fail: the late swing is planned again, but the body is not slowed meanwhile."""
    walker, outcome = reversal(5.0)
    gait = walker.supervisor.gait
    late = gait.lifts[2]
    assert late.time + late.duration == pytest.approx(7.5, abs=0.01)
    assert [(x.time, x.arm) for x in gait.replans] == [(8.6, 3)]
    assert 1.0 <= gait.late[0] - late.time - late.duration < 1.1
    assert outcome.reason == "limits"
    # The tie of the first lift decides between both
    assert outcome.time in (10.4, 10.6)
    check_held(walker, outcome)


def test_18_higher_thresholds_take_more_steps() -> None:
    lifts = [len(along(1.0, 6, 18, threshold=x)[0].supervisor.gait.lifts) for x in (0.25, 0.5, 1.5, 2.0)]
    assert lifts == [12, 13, 19, 30]


def test_a_command_to_stand_still_steps_all_the_same() -> None:
    """Known to fail: without a velocity, margins are those of a motion along +T."""
    _, outcome = driven((13, 12), (0.0, 0.0, 0.0), duration=10.0)
    assert outcome.reason == "time"
    assert [(x.time, x.arm, x.old, x.new) for x in outcome.lifts] == [(0.0, 3, (10, 11), (13, 10))]

"""Hands turn upright as they come down: from the axes that they have to those of the hold, and nothing jumps."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pinocchio as pin
import pytest

from wbc.robots import WalkerData
from wbc.walking.loop.hand_command import BENT, HandLanding, axis_part
from wbc.walking.loop.hand_pace import at_rest
from wbc.walking.loop.state import Axes, Swinging
from wbc.walking.planner.swings.law import Aim

DT = 0.01
#: Place and axes of the hold; lean of the hand where its wrist is let go [rad]; its heights from tick to tick [m]
PLACE, FRAME = np.array([1.0, 2.0, 3.0]), pin.exp3(np.array([0.3, -0.2, 0.9]))
LEAN = np.array([0.1, -0.06, 0.2])
HEIGHTS = 0.05 * np.linspace(1.0, 0.0, 21) ** 2


def come_down(rolls: bool, heights: np.ndarray = HEIGHTS) -> tuple[Swinging, list[Axes]]:
    """A hand that follows its axes without error."""
    still = cast("Any", SimpleNamespace(at=lambda _time: Aim(PLACE, np.zeros(3), 1.0, 1.0)))
    hand = FRAME @ pin.exp3(LEAN)
    swinging = Swinging(0, 0, 0, still, 0.0, axis=hand[:, 2], x_axis=hand[:, 0], x=FRAME[:, 0] if rolls else None)
    landing, out = HandLanding(DT), []
    for height in heights:
        swinging.aim = Aim(PLACE + height * FRAME[:, 2], np.zeros(3), 0.99, 0.9)
        axes = landing.go(swinging, (PLACE, FRAME[:, 2]), True)
        assert axes is not None
        out.append(axes)
    return swinging, out


@pytest.mark.parametrize("rolls", [True, False])
def test_it_begins_with_the_axes_of_the_hand_and_ends_with_those_of_the_hold(rolls: bool) -> None:
    swinging, found = come_down(rolls)
    assert np.allclose(found[0].z, swinging.axis, atol=1e-12)
    assert np.allclose(found[-1].z + found[-1].z_rate * DT, FRAME[:, 2], atol=1e-12)
    for before, after in pairwise(found):
        assert np.allclose(before.z + before.z_rate * DT, after.z, atol=1e-12)
    # Its lean goes with its height
    whole = np.arccos(swinging.axis @ FRAME[:, 2])
    leans = [np.arccos(np.clip(axes.z @ FRAME[:, 2], -1.0, 1.0)) for axes in found[1:]]
    assert np.allclose(leans, whole * HEIGHTS[:-1] / HEIGHTS[0], atol=2e-2 * whole if rolls else 1e-7)
    if not rolls:
        assert all(axes.x is None and axes.x_rate is None for axes in found)
        return
    assert np.allclose(found[0].x, swinging.x_axis, atol=1e-12)
    last = found[-1]
    assert last.x is not None
    assert last.x_rate is not None
    assert np.allclose(last.x + last.x_rate * DT, FRAME[:, 0], atol=1e-12)
    assert np.allclose([axes.x @ axes.z for axes in found if axes.x is not None], 0.0, atol=1e-12)


def test_a_hand_whose_aim_goes_up_again_does_not_lean_again_and_one_that_is_there_turns_at_once() -> None:
    _, found = come_down(False, np.array([0.05, 0.02, 0.04, 0.02]))
    assert np.allclose(found[2].z_rate, 0.0)
    assert np.allclose(found[3].z, found[2].z)
    _, (there,) = come_down(False, np.array([1e-4]))
    assert np.allclose(there.z, FRAME[:, 2])
    assert np.allclose(there.z_rate, 0.0)


def test_on_the_way_it_has_none_and_the_next_time_it_begins_anew() -> None:
    swinging, _ = come_down(False)
    landing = HandLanding(DT)
    hold = PLACE, FRAME[:, 2]
    swinging.aim = Aim(PLACE + 0.04 * FRAME[:, 2], np.zeros(3), 0.99, 0.9)
    assert landing.go(swinging, hold, True) is not None
    assert landing.go(swinging, hold, False) is None
    swinging.axis, swinging.aim = FRAME[:, 0], Aim(PLACE + 0.03 * FRAME[:, 2], np.zeros(3), 0.99, 0.9)
    again = landing.go(swinging, hold, True)
    assert again is not None
    assert np.allclose(again.z, FRAME[:, 0], atol=1e-12)


@pytest.mark.parametrize("rolls", [True, False])
def test_it_goes_on_to_turn_as_the_hand_turned(rolls: bool) -> None:
    turns = np.array([0.4, -0.3, 0.0])
    aim = Aim(PLACE + 0.05 * FRAME[:, 2], -0.3 * FRAME[:, 2], 0.99, 0.9)
    still = cast("Any", SimpleNamespace(at=lambda _time: aim))
    hand = FRAME @ pin.exp3(LEAN)
    swinging = Swinging(0, 0, 0, still, 0.0, pace=1.0, x=FRAME[:, 0] if rolls else None)
    swinging.aim, hold = aim, (PLACE, FRAME[:, 2])
    begun = []
    for lag in (0.0, 0.05):
        landing = HandLanding(DT)
        for k, near in ((-1, False), (0, True)):
            now = pin.exp3(k * DT * turns) @ hand
            swinging.axis, swinging.x_axis = now[:, 2], now[:, 0]
            landing.go(swinging, hold, near, lag)
        swinging.aim = Aim(PLACE + (0.05 - 0.3 * DT) * FRAME[:, 2], -0.3 * FRAME[:, 2], 0.99, 0.9)
        axes = landing.go(swinging, hold, True, lag)
        assert axes is not None
        begun.append(axes.z_rate)
        swinging.aim = aim
    turned = np.cross(turns, hand[:, 2])
    assert np.linalg.norm(begun[0] - turned) < 0.25 * np.linalg.norm(turned)
    # Of joints that lag it is seen too late: their lean goes with the height alone
    assert np.linalg.norm(begun[1] - turned) > 2.0 * np.linalg.norm(turned)


def test_the_axis_of_a_hand_counts_less_against_its_place_where_joint_4_hardly_turns_it() -> None:
    assert axis_part(1.0) == axis_part(BENT) == 1.0
    assert axis_part(0.1 * BENT) == pytest.approx(0.01)
    assert axis_part(0.0) == 0.0


def test_a_hand_that_leans_and_turns_back_is_not_at_rest() -> None:
    data, z, x = WalkerData.read(), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])

    def rests(*leans: float, known: bool = True) -> bool:
        """Of the last three ticks [rad]."""
        earlier, before, now = (np.array([np.sin(lean), 0.0, np.cos(lean)]) for lean in leans)
        hands = (np.zeros(3), before, x), (np.zeros(3), now, x)
        return at_rest(*hands, (np.zeros(3), z), None, 0.05, data, DT, earlier if known else None)

    # At the turning point it is slow, and it would be faster in the next tick
    assert not rests(1.7e-3, 1.8e-3, 1.8e-3)
    assert rests(1.7e-3, 1.8e-3, 1.8e-3, known=False)
    assert rests(1.8e-3, 1.8e-3, 1.8e-3)
    assert not rests(1.9e-3, 1.86e-3, 1.82e-3)
    # Upright it cannot become faster than its gain makes it
    assert rests(0.28e-3, 0.24e-3, 0.2e-3)

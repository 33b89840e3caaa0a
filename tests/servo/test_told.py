"""What was found is checked by what follows before it is trusted, and what is told as well; doubt says so."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from tests.repeats import repeats
from tests.servo.plants import DT, Drives
from tests.servo.random_servos import told_beside_untold
from tests.servo.test_following import follow
from wbc.api import Controller
from wbc.servo import Following, Response, Servo
from wbc.servo.servo import DOUBTFUL, LONGEST_DELAY
from wbc.simulation import CommandKind

#: In the short mode those that fell or stopped when they were told a delay that was too short
FIRST = (88, 20, 4)
SEEDS = [*FIRST, *(seed for seed in range(100) if seed not in FIRST)][: min(repeats(1), 100)]


@pytest.mark.parametrize("seed", SEEDS)
def test_told_what_was_found_is_no_worse_than_told_nothing(seed: int) -> None:
    untold, told = told_beside_untold(seed, 4.0)
    # Reference and joints, and as near as told nothing but for 1 mm or a tenth
    assert max(untold.reference, told.reference) <= 1.05
    assert max(untold.top, told.top) <= 1.2
    assert told.off <= max(1.1 * untold.off, untold.off + 1.0)
    # A hand that is away from its path was stopped, and said so
    assert told.off < 100.0 or told.following is Following.STOPPED


@pytest.mark.parametrize(
    ("kind", "truth", "told"),
    [
        ("position", {"lag": 0.03, "delay": 5}, Response(lag=0.15)),
        ("position", {"lag": 0.03, "delay": 12}, Response(lag=0.03)),
        ("position", {"lag": 0.05}, Response(delay=0.04)),
        ("velocity", {"lag": 0.01, "delay": 15}, Response(lag=0.01)),
        ("torque", {"delay": 8, "friction": 0.2}, Response()),
        ("torque", {"friction": 0.2}, Response(damping=5.0)),
    ],
)
def test_a_response_told_wrongly_is_let_go_with_words(
    control: Controller, caplog: pytest.LogCaptureFixture, kind: str, truth: dict[str, float], told: Response
) -> None:
    drives = Drives(control.stack.robot, CommandKind(kind), **truth)
    servo = Servo(control, kind, response=told)
    with caplog.at_level(logging.WARNING, "wbc"):
        off, _, seen, how = follow(servo, drives)
    assert "the response told" in servo.doubt
    assert caplog.text.count("the response told") == 1
    assert Following.STOPPED not in how
    # Friction under torques is not made up for at once, see docs/servos.md
    assert np.median(off[500:]) < (15.0 if kind == "torque" else 3.0)
    # A command takes hold a period after it was sent; and velocities are late by a part of one
    late, found = DT * (drives.delay + 1), servo.response
    assert found.delay - 2 * DT <= late <= found.delay + found.doubt + 2 * DT
    if kind != "position":
        assert np.abs(seen).max() <= 1.2 * 2.0


@pytest.mark.parametrize("kind", ["position", "velocity"])
def test_a_response_told_rightly_is_kept(control: Controller, caplog: pytest.LogCaptureFixture, kind: str) -> None:
    told = Response(lag=0.04, delay=5 * DT, sag=2e-3, friction=1e-3)
    drives = Drives(control.stack.robot, CommandKind(kind), lag=0.04, delay=4, sag=2e-3, friction=1e-3)
    servo = Servo(control, kind, response=told)
    with caplog.at_level(logging.WARNING, "wbc"):
        follow(servo, drives)
    assert servo.response is told
    assert not servo.doubt
    assert not caplog.text


def test_a_servo_that_changes_is_noticed(control: Controller) -> None:
    drives = Drives(control.stack.robot, CommandKind.POSITION, lag=0.03)
    servo = Servo(control, "position", response=Response(lag=0.03, delay=DT))
    follow(servo, drives)
    assert not servo.doubt
    drives.lag = 0.15
    follow(servo, drives)
    assert "the response told, lag 30 ms" in servo.doubt
    assert servo.response.lag == pytest.approx(np.full(3, 0.15), rel=0.2)


def test_numbers_that_are_not_to_be_learned_stay_and_are_doubted(control: Controller) -> None:
    told = Response(lag=0.15)
    servo = Servo(control, "position", response=told, learn=False)
    follow(servo, Drives(control.stack.robot, CommandKind.POSITION, lag=0.03, delay=5))
    assert "the response told" in servo.doubt
    assert (servo.response.lag, servo.response.delay, servo.response.doubt) == (0.15, 0.0, LONGEST_DELAY)


def test_what_little_motion_shows_is_told_with_all_doubt_and_found_anew(control: Controller) -> None:
    drives = Drives(control.stack.robot, CommandKind.POSITION, lag=0.08)
    servo = Servo(control, "position")
    follow(servo, drives, 200)
    assert "not confirmed" in servo.doubt
    assert servo.response.delay + servo.response.doubt == pytest.approx(LONGEST_DELAY)
    told = Servo(control, "position", response=servo.response)
    assert "not confirmed" in told.doubt
    follow(told, drives, 1500)
    assert not told.doubt
    assert told.response.doubt < DOUBTFUL
    assert told.response.lag == pytest.approx(np.full(3, 0.08), rel=0.15)

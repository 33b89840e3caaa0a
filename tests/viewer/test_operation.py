"""What messages do to a controller, and the stop."""

from __future__ import annotations

import time

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings, strategies as st

from tests.viewer.arms import ACCELERATION, DT, fresh
from wbc.api import Controller
from wbc.errors import WbcError
from wbc.viewer.messages import RATE_LASTS
from wbc.viewer.operation import FASTEST, Operation, turned


def driven(controller: Controller, operation: Operation, q: np.ndarray, ticks: int) -> tuple[np.ndarray, list]:
    steps = []
    for _ in range(ticks):
        steps.append(controller.step(q))
        q = controller.stack.robot.integrate(q, steps[-1].v, DT)
        operation.advance(DT)
    return q, steps


def away(controller: Controller, offset: list[float]) -> list[float]:
    pose = controller["hand"].target
    return [float(x) for x in pin.SE3ToXYZQUAT(pin.SE3(pose.rotation, pose.translation + offset))]


@settings(max_examples=4)
@given(st.tuples(*[st.floats(-0.3, 0.3)] * 3), st.integers(1, 25))
def test_a_stop_brakes_within_the_limits_and_stays(offset: tuple[float, float, float], after: int) -> None:
    controller = fresh()
    operation, q = Operation(controller), controller.stack.robot.neutral
    operation.obey({"type": "set", "item": "hand", "values": {"target": away(controller, list(offset))}})
    q, steps = driven(controller, operation, q, after)
    operation.obey({"type": "stop"})
    fastest = float(np.abs(steps[-1].v).max())
    ticks = int(np.ceil(fastest / ACCELERATION / DT)) + 2
    q, braking = driven(controller, operation, q, ticks)
    rates = np.array([step.v for step in [steps[-1], *braking]])
    assert np.abs(np.diff(rates, axis=0)).max() <= ACCELERATION * DT * (1 + 1e-6)
    assert np.abs(rates[-1]).max() < 1e-6
    assert all(step.margins["ball"].min() > -1e-6 for step in braking)
    # The targets are where the robot stands when it goes on
    operation.obey({"type": "resume"})
    _, later = driven(controller, operation, q, 5)
    assert np.abs(later[-1].v).max() < 1e-6
    assert not operation.stopped


def test_a_stop_keeps_what_was_off_off() -> None:
    controller = fresh()
    operation = Operation(controller)
    controller["posture"].enabled = False
    operation.stop("because")
    operation.stop("again")
    assert operation.stopped == "because"
    operation.resume()
    operation.resume()
    assert (controller["posture"].enabled, controller["hand"].enabled) == (False, True)


def test_a_stopped_robot_takes_no_targets_but_obstacles_move() -> None:
    controller = fresh()
    operation = Operation(controller)
    controller.step(controller.stack.robot.neutral)
    operation.stop("because")
    before = controller["hand"].target
    for message in (
        {"type": "set", "item": "hand", "values": {"target": away(controller, [0.1, 0.0, 0.0])}},
        {"type": "rate", "item": "hand", "rate": [0.1, 0, 0, 0, 0, 0]},
    ):
        with pytest.raises(WbcError, match="resume"):
            operation.obey(message)
    assert controller["hand"].target == before
    operation.obey({"type": "set", "item": "ball", "values": {"pose": [1.0, 0.0, 0.5, 0, 0, 0, 1]}})
    operation.advance(DT)
    assert controller["ball"].pose.translation[0] > 0.45


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ({"type": "set", "item": "hnd", "values": {}}, "hand"),
        ({"type": "set", "item": "hand", "values": {"targt": 1}}, "target"),
        ({"type": "set", "item": "hand", "values": {"target": [1, 2, 3]}}, "hand.target"),
        ({"type": "set", "item": "hand", "values": {"target": [1, 2, None, 0, 0, 0, 1]}}, "hand.target"),
        ({"type": "set", "item": "hand", "values": {"target": [0, 0, 0, 0, 0, 0, 3]}}, "hand.target"),
        ({"type": "set", "item": "hand", "values": {"weight": -1}}, "weight"),
        ({"type": "set", "item": "hand", "values": {"enabled": "yes"}}, "enabled"),
        ({"type": "set", "item": "hand", "values": {"mask": [1, 1, 1, 1, 1, 1]}}, "mask"),
        ({"type": "set", "item": "hand", "values": {"weight": 2.0, "gain": -3}}, "gain"),
        ({"type": "rate", "item": "limits", "rate": [1]}, "limits"),
        ({"type": "rate", "item": "hand", "rate": [1, 2]}, "hand"),
        ({"type": "set", "item": 3, "values": {}}, "item"),
    ],
)
def test_what_does_not_fit_is_refused_and_changes_nothing(message: dict, said: str) -> None:
    controller = fresh()
    operation = Operation(controller)
    controller.step(controller.stack.robot.neutral)
    before = str(controller), str(controller["hand"].target)
    for act in (operation.check, operation.obey):
        with pytest.raises(WbcError, match=said):
            act(message)
    assert (str(controller), str(controller["hand"].target)) == before


def test_a_rate_moves_the_target_until_it_is_not_renewed(monkeypatch: pytest.MonkeyPatch) -> None:
    controller = fresh()
    operation, q = Operation(controller), controller.stack.robot.neutral
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    start = controller["hand"].target.translation.copy()
    operation.obey({"type": "rate", "item": "hand", "rate": [0.2, 0.0, 0.0, 0.0, 0.0, 0.5]})
    for k in range(1, 60):
        controller.step(q)
        operation.advance(DT)
        now[0] += DT
        if k == 10:
            assert controller["hand"].feedforward == pytest.approx([0.2, 0.0, 0.0, 0.0, 0.0, 0.5])
    moved = controller["hand"].target.translation - start
    assert moved == pytest.approx([0.2 * RATE_LASTS, 0.0, 0.0], abs=0.2 * 2 * DT)
    assert np.abs(controller["hand"].feedforward).max() == 0.0
    assert not operation.moving


@settings(max_examples=10)
@given(st.tuples(*[st.floats(-0.6, 0.6)] * 3))
def test_a_dragged_obstacle_goes_there_at_a_speed_that_it_tells(goal: tuple[float, float, float]) -> None:
    controller = fresh()
    operation = Operation(controller)
    controller["hand"].enabled = False
    sent = [*np.array([0.45, 0.4, 0.5]) + goal, 0.0, 0.0, 0.0, 1.0]
    operation.obey({"type": "set", "item": "ball", "values": {"pose": [float(x) for x in sent]}})
    places = [controller["ball"].pose.translation.copy()]
    for _ in range(130):
        operation.advance(DT)
        places.append(controller["ball"].pose.translation.copy())
        speed = float(np.linalg.norm(controller["ball"].velocity[:3]))
        assert speed <= FASTEST[0] * (1 + 1e-6)
        assert np.linalg.norm(places[-1] - places[-2]) <= FASTEST[0] * DT * (1 + 1e-6)
    assert places[-1] == pytest.approx(sent[:3], abs=1e-5)
    assert not operation.moving
    assert np.abs(controller["ball"].velocity).max() == 0.0


def test_a_target_that_turns_for_long_stays_a_rotation() -> None:
    turn, step = np.eye(3), np.array([1e-3, -2e-3, 5e-4])
    for _ in range(2000):
        turn = turned(turn, step)
    assert np.abs(turn.T @ turn - np.eye(3)).max() < 1e-14
    assert np.allclose(turn, pin.exp3(2000 * step), atol=1e-11)

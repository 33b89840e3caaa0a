"""An arm that a page drives by pairs of coordinates: rates, swaps, stops, and the warning before a locus."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from wbc.controller.step import state_of
from wbc.errors import WbcError
from wbc.robots import load
from wbc.teleop import Teleoperation
from wbc.validation import Array
from wbc.viewer import MessageError
from wbc.viewer.link import SharedTick
from wbc.viewer.operating import OPERATED_SPEED, PairOperation, pairing_of
from wbc.viewer.pairing import PairWatch
from wbc.viewer.tick import Tick


@pytest.fixture(scope="module")
def session() -> Teleoperation:
    return Teleoperation("ssrms", backend="vm")


@pytest.fixture
def begun(session: Teleoperation) -> tuple[PairOperation, Array]:
    session.control.switch("xi | alpha", 0.0)
    q = session.start()
    session.reset(q)
    return PairOperation(session, pairing_of(session)), q


def driven(operation: PairOperation, q: Array, message: dict | None, count: int) -> tuple[Array, list]:
    session, seen = operation.session, []
    for _ in range(count):
        if message is not None:
            operation.obey(message)
        seen.append(session.step(q, operation.take()))
        q = session.robot.integrate(q, seen[-1].step.v, session.control.dt)
    return q, seen


def test_what_is_commanded_moves_and_a_swap_holds_it(begun: tuple[PairOperation, Array]) -> None:
    operation, q = begun
    robot, tip = operation.session.robot, operation.session.robot.frames["tip"]
    start = robot.pose(q, tip).translation
    q, seen = driven(operation, q, {"type": "drive", "rates": [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]}, 60)
    # Joints that start within their accelerations are not there at once
    assert seen[-1].met == pytest.approx([0, 0, 0.5 * OPERATED_SPEED[0], 0, 0, 0], abs=1e-6)
    moved = robot.pose(q, tip).translation - start
    assert moved[2] > 0.02
    # Nobody renews it: it comes to rest
    q, seen = driven(operation, q, None, 120)
    assert np.abs(seen[-1].step.v).max() < 1e-6
    place = robot.pose(q, tip)
    operation.obey({"type": "swap"})
    q, seen = driven(operation, q, None, 1)
    assert seen[-1].active == "alpha | xi"
    q, seen = driven(operation, q, {"type": "drive", "rates": [1.0]}, 60)
    assert np.abs(seen[-1].step.v).max() > 1e-3
    assert np.linalg.norm((place.inverse() * robot.pose(q, tip)).translation) < 1e-3
    operation.obey({"type": "swap"})
    assert driven(operation, q, None, 1)[1][-1].active == "xi | alpha"


def test_a_stop_in_the_middle_of_a_switch_brakes_within_the_limits(begun: tuple[PairOperation, Array]) -> None:
    operation, q = begun
    session = operation.session
    q, _ = driven(operation, q, {"type": "drive", "rates": [1.0, -1.0, 1.0, 0.0, 0.0, 0.0]}, 50)
    operation.obey({"type": "pair", "name": "xi | beta"})
    q, between = driven(operation, q, None, 2)
    assert between[-1].blending
    operation.obey({"type": "stop"})
    limit = session.robot.limits.acceleration * session.control.dt
    fastest = float(np.abs(between[-1].step.v / limit).max())
    q, braking = driven(operation, q, None, int(np.ceil(fastest)) + 10)
    rates = np.array([one.step.v for one in (between[-1], *braking)])
    assert (np.abs(np.diff(rates, axis=0)) <= limit * (1 + 1e-6)).all()
    assert np.abs(rates[-1]).max() < 1e-5
    with pytest.raises(MessageError, match="resume first"):
        operation.obey({"type": "drive", "rates": [0.0] * 6})
    operation.obey({"type": "resume"})
    assert np.abs(driven(operation, q, None, 3)[1][-1].step.v).max() < 1e-5


@pytest.mark.parametrize(
    "message",
    [
        {"type": "pair", "name": "xi | alpa"},
        {"type": "drive", "rates": [0.1]},
        {"type": "drive", "rates": [2.0, 0, 0, 0, 0, 0]},
        {"type": "drive", "rates": [float("nan")] * 6},
        {"type": "set", "item": "x", "values": {}},
        {"type": "go", "hold": "1,1"},
    ],
)
def test_what_does_not_fit_is_refused(begun: tuple[PairOperation, Array], message: dict) -> None:
    operation, _ = begun
    with pytest.raises(WbcError):
        operation.obey(message)
    assert operation.take() is None


def test_a_page_is_told_the_pair_and_warned_before_its_locus(begun: tuple[PairOperation, Array]) -> None:
    operation, q = begun
    session = operation.session
    pairing = pickle.loads(pickle.dumps(operation.pairing))
    watch = PairWatch(session.robot, pairing)
    for name in ("gamma | xi", "xi | alpha"):
        operation.obey({"type": "pair", "name": name})
        q, seen = driven(operation, q, None, 1)
        told = watch.told(Tick(session.control.controller, SharedTick(1, 0.0, state_of(seen[-1].step))))
        assert told["pair"] == name
        assert told["sigma"] == pytest.approx(seen[-1].sigma, rel=1e-6)
        assert not told["warning"]
    # The straight elbow, whatever is held, is reached in two seconds
    v = np.zeros(7)
    v[3] = -0.5
    q[3] = 1.0
    sigma, warning = watch.ahead(0, q, v)
    assert sigma > 5 * pairing.pairs[0].least
    assert warning.startswith("xi | alpha is near a locus in 2.0 s")
    # The pair that is named there does keep its rank
    named = next(k for k, one in enumerate(pairing.pairs) if warning.endswith(f" {one.pair.name} is not."))
    assert watch.ahead(named, q + 2.0 * v, 0 * v)[0] > pairing.pairs[named].least
    assert watch.ahead(0, q, -v)[1] == ""
    assert watch.ahead(0, q, 0 * v)[1] == ""


def test_pairs_that_swap_command_what_the_other_holds() -> None:
    session = Teleoperation(load("panda"), ["M1", "M2"], backend="vm")
    abouts = {one.pair.name: one for one in pairing_of(session).pairs}
    assert all(one.swapped for one in abouts.values())
    for one in abouts.values():
        assert set(abouts[one.swapped].pair.task) <= set(one.pair.constraint)
        assert abouts[one.swapped].swapped == one.pair.name

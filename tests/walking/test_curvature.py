"""What a hand does in a tick beside what its Jacobian says, and that held hands are told so."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

from wbc.robots import Walker
from wbc.walking import Structure
from wbc.walking.loop.curvature import Curvature
from wbc.walking.loop.stack import DT, WalkStack


@pytest.fixture
def moving(machine: Walker) -> tuple[np.ndarray, np.ndarray]:
    rng, model = np.random.default_rng(4), machine.robot.model
    q = pin.neutral(model)
    q[7:] = rng.uniform(-1.0, 1.0, model.nq - 7)
    return pin.integrate(model, q, np.r_[0.3, -0.2, 1.0, 0.4, 0.1, -0.3, np.zeros(model.nv - 6)]), rng.uniform(
        -1.0, 1.0, model.nv
    )


def test_rates_that_last_for_a_tick_take_a_hand_by_this_off_its_tangent(
    machine: Walker, moving: tuple[np.ndarray, np.ndarray]
) -> None:
    (q, v), model = moving, machine.robot.model
    data, curvature = model.createData(), Curvature(machine, DT)
    curvature.go(q, v)

    def places(of: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(model, data, of)
        return np.array([data.oMf[model.getFrameId(arm.hand)].translation for arm in machine.arms])

    begin, end = places(q), places(pin.integrate(model, q, v * DT))
    for k, arm in enumerate(machine.arms):
        jacobian = pin.computeFrameJacobian(model, data, q, model.getFrameId(arm.hand), pin.LOCAL_WORLD_ALIGNED)
        off = end[k] - begin[k] - DT * jacobian[:3] @ v
        assert np.linalg.norm(off) > 1e-5
        assert off == pytest.approx(DT * curvature.drift(k), abs=0.05 * np.linalg.norm(off))


def test_held_hands_are_told_to_move_against_it(
    machine: Walker, structure: Structure, stack: WalkStack, moving: tuple[np.ndarray, np.ndarray]
) -> None:
    q, v = moving
    stack.structure = structure
    stack.begin(q)
    stack.hold(0, 7)
    told = SimpleNamespace(write=lambda place: told.__dict__.update(place=place), place=None)
    place = stack._holds._at[0][1]
    stack._holds._at[0] = told, place  # type: ignore[assignment]
    stack.lead(q, v, {0: 7})
    # As it closes it has no gain, and nothing that is ahead of it counts
    assert told.place is None
    for part in (0.5, 1.0):
        stack._rise(0, part)
        stack.lead(q, v, {0: 7})
        ahead = stack._hold_gain(part) * (told.place - place)
        assert ahead == pytest.approx(-stack._curvature.drift(0), rel=1e-9)
    stack.release(0)

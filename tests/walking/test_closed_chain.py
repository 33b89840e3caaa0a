"""Where the held hands put the body, against scipy's solution of Wahba's problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import wbc
from wbc.errors import RangeError
from wbc.walking import cylinder
from wbc.walking.loop.closed_chain import AXIS_LENGTH, ClosedChain


@pytest.mark.parametrize("roll", ["free", "fixed"])
@pytest.mark.parametrize("held", [{0: 3, 1: 5}, {2: 9, 0: 44}, {0: 100, 1: 130, 2: 77}])
def test_the_body_is_where_its_hands_fit_best(held: dict[int, int], roll: str) -> None:
    machine, whole = wbc.robots.walker(), cylinder(rigid=True)
    structure = replace(whole, holds=tuple(replace(hold, roll=roll) for hold in whole.holds))
    model, generator = machine.robot.model, np.random.default_rng(0)
    data, chain = model.createData(), ClosedChain(machine, structure)
    for _ in range(5):
        q = np.array(machine.robot.neutral)
        q[7:] = generator.uniform(-1.0, 1.0, len(q) - 7)
        out, slip = chain.settle(q, held)
        pin.framesForwardKinematics(model, data, q)
        hands = [data.oMf[model.getFrameId(machine.arms[arm].hand)] for arm in held]
        holds = list(held.values())
        ours, theirs = np.array([hand.translation for hand in hands]), structure.positions[holds]
        mine = [
            ours - ours.mean(axis=0),
            *(AXIS_LENGTH * np.array([hand.rotation[:, k] for hand in hands]) for k in (2, 0)),
        ]
        wanted = [
            theirs - theirs.mean(axis=0),
            AXIS_LENGTH * structure.axes[holds],
            AXIS_LENGTH * structure.references[holds],
        ]
        kinds = 3 if roll == "fixed" else 2
        best = Rotation.align_vectors(np.concatenate(wanted[:kinds]), np.concatenate(mine[:kinds]))[0]
        assert np.allclose(pin.Quaternion(out[3:7]).matrix(), best.as_matrix(), atol=1e-9)
        assert np.allclose(out[:3], theirs.mean(axis=0) - best.apply(ours.mean(axis=0)), atol=1e-9)
        places = best.apply(ours) + out[:3]
        assert slip == pytest.approx(np.linalg.norm(places - theirs, axis=1).max())
        assert np.allclose(chain.origins[list(held)], places, atol=1e-9)
        assert np.allclose(chain.axes[list(held)], best.apply([hand.rotation[:, 2] for hand in hands]), atol=1e-9)


def test_a_hand_that_may_roll_does_not_say_where_the_body_is() -> None:
    chain = ClosedChain(wbc.robots.walker(), cylinder())
    for held in ({}, {0: 3}):
        with pytest.raises(RangeError, match="the body's pose needs two hands"):
            chain.settle(np.array(chain.walker.robot.neutral), held)

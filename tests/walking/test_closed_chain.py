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
from wbc.walking.body_path import grid_path
from wbc.walking.loop.closed_chain import AXIS_LENGTH, NEAR, QUICKLY, ClosedChain
from wbc.walking.loop.walk import Walk
from wbc.walking.planner.planner import plan_walk


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


def test_a_body_goes_on_from_where_it_is_when_a_hand_that_leaned_lets_go() -> None:
    """Two hands that lean leave its turn about the line between them to springs: it comes to rest there slowly."""
    machine, structure = wbc.robots.walker(), cylinder()
    plan = plan_walk(machine, structure, grid_path([(13, 6), (13, 7)], 0.05))
    walk = Walk(machine, structure, plan, foresees=False)
    first, two, ease = walk.q.copy(), {arm: walk.held[arm] for arm in (0, 2)}, 20
    # The body turns about the line between two hands, which keep their places
    line = structure.positions[list(two.values())]
    along = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    turn = pin.SE3(pin.exp3(0.008 * along), line[0] - pin.exp3(0.008 * along) @ line[0])
    q = first.copy()
    q[:7] = pin.SE3ToXYZQUAT(turn * pin.XYZQUATToSE3(first[:7]))
    fit, _ = ClosedChain(machine, structure).settle(q, two)
    jump = float(np.linalg.norm(q[:3] - fit[:3]))
    assert jump > NEAR[0]
    chain, places, slips = ClosedChain(machine, structure, ease), [q[:3]], list[float]()
    away, now = list[float](), q
    while not away or away[-1] > 0.0:
        now, slip = chain.settle(now, two)
        places.append(now[:3])
        slips.append(slip)
        assert chain.away is not None
        away.append(float(np.linalg.norm(pin.log3(chain.away))))
    assert len(away) == np.ceil(ease * jump / QUICKLY[0])
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 15 / 8 * QUICKLY[0] / ease * 1.01
    assert max(slips) < 1e-5
    assert np.allclose(now, fit, atol=1e-9)
    chain.settle(now, two)
    assert chain.away is None


def test_a_body_whose_hands_are_off_their_holds_is_put_there_at_once() -> None:
    machine, structure = wbc.robots.walker(), cylinder()
    plan = plan_walk(machine, structure, grid_path([(13, 6), (13, 7)], 0.05))
    walk = Walk(machine, structure, plan, foresees=False)
    q = walk.q.copy()
    q[0] += 0.01
    found, _ = ClosedChain(machine, structure, 20).settle(q, walk.held)
    assert np.allclose(found, walk.q, atol=1e-6)

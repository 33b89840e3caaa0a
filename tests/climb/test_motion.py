"""Motions through stances, drawn from seeds: contacts, limits, speeds and clearances between knots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.climb.referee import between, body_speeds, fastest_share, least_distances, slipped
from tests.climb.stones import on_stones
from wbc.climb import motion
from wbc.climb.balance import Equilibrium
from wbc.climb.clear import Clearances
from wbc.climb.closure import Closure
from wbc.climb.machines import climber
from wbc.climb.motion import MotionOptions, MoveError, Mover, carry_out
from wbc.climb.move_path import SwingShape, move_path
from wbc.climb.plan import ContactPlan
from wbc.climb.scene import ClimbScene, SceneBody
from wbc.climb.stance import FREE_LIMB, Stance, StancePath
from wbc.climb.time_law import MotionSpeeds, PathTiming, fastest
from wbc.errors import InfeasibleError, RangeError, ShapeError
from wbc.shapes import Box
from wbc.trajectory.least_time.reachability import SpeedProgram
from wbc.trajectory.least_time.rows import PathRows
from wbc.validation import Array

#: Robots, how far they step [m] and how many limbs at once: legs, grips that roll, three joints, six joints
CASES = {
    "hexapod": (0.06, 3),
    "octopod": (0.06, 2),
    "a1": (0.06, 1),
    "walker": (0.2, 1),
    "truss_climber": (0.06, 1),
    "wall_climber": (0.06, 1),
    "hexapod_grips": (0.05, 2),
}


#: Instants of a plan at which Coal looks
INSTANTS = 50


def _plan(name: str, seed: int, options: MotionOptions | None = None) -> ContactPlan:
    step, together = CASES[name]
    robot = climber(name)
    scene, stances = on_stones(robot, np.random.default_rng(seed), step, together)
    return carry_out(robot, scene, stances, options)


@pytest.mark.parametrize("name", CASES)
def test_contacts_limits_and_clearances_hold_between_knots(name: str) -> None:
    plan = _plan(name, 1)
    assert np.diff(plan.times).min() > 0.0
    assert np.diff(plan.times).max() <= 0.02 + 1e-9
    times, q = between(plan, 10)
    assert slipped(plan, times, q) < 1e-4
    velocity, acceleration = fastest_share(plan, times, q)
    assert velocity < 0.9 * (1 + 1e-4)
    assert acceleration < 0.7 * (1 + 1e-3)
    assert max(velocity / 0.9, acceleration / 0.7) > 0.95, "least time uses a limit"
    mine, other = least_distances(plan, q[:: len(q) // INSTANTS])
    assert mine > -1e-4
    assert other > 0.01 - 1e-4
    assert [move.land > move.lift for move in plan.moves] == [True] * len(plan.moves)


@pytest.mark.parametrize("speeds", [MotionSpeeds(speed=0.03), MotionSpeeds(turn_rate=0.08)], ids=["speed", "turn"])
def test_speeds_of_the_body_hold_on_every_move(speeds: MotionSpeeds) -> None:
    plan = _plan("hexapod", 0, MotionOptions(speeds=speeds))
    speed, turn = body_speeds(plan, *between(plan, 5))
    assert speed <= speeds.speed * (1 + 1e-4)
    assert turn <= speeds.turn_rate * (1 + 1e-4)
    assert max(speed / speeds.speed, turn / speeds.turn_rate) > 0.95


def test_knots_are_where_the_stances_are() -> None:
    robot = climber("hexapod")
    scene, stances = on_stones(robot, np.random.default_rng(3), 0.06, 2)
    plan = carry_out(robot, scene, stances, MotionOptions(speeds=MotionSpeeds(dwell=0.5)))
    lands = sorted({move.land for move in plan.moves})
    for stance, land in zip(stances.stances[1:], lands, strict=True):
        k = int(np.searchsorted(plan.times, land - 1e-9))
        np.testing.assert_allclose(plan.q[k], stance.q, atol=1e-9)
        assert not plan.v[k].any()
    lifts = sorted({move.lift for move in plan.moves})
    assert np.allclose(np.array(lifts[1:]) - lands[:-1], 0.5)


def test_motions_that_were_found_are_kept() -> None:
    robot = climber("hexapod")
    scene, stances = on_stones(robot, np.random.default_rng(3), 0.06, 2)
    mover = Mover(robot, scene)
    first, again = (carry_out(robot, scene, stances, mover=mover) for _ in range(2))
    one, other = stances.stances[:2]
    assert mover.moved(one, other) is mover.moved(replace(one), replace(other))
    np.testing.assert_array_equal(first.q, again.q)
    np.testing.assert_array_equal(first.q, carry_out(robot, scene, stances).q)


def test_limbs_in_the_air_at_the_end_or_the_beginning() -> None:
    robot = climber("hexapod")
    scene, stances = on_stones(robot, np.random.default_rng(2), 0.05)
    first = stances.stances[0]
    tucked = robot.with_limb(first.q, 0, robot.angles(first.q, 0) + [0.0, -0.5, 0.2])
    contacts = (FREE_LIMB, *first.contacts[1:])
    path = StancePath([first, Stance(contacts, tucked), first], np.zeros(2))
    plan = carry_out(robot, scene, path)
    assert [(m.leaves, m.lands) for m in plan.moves] == [(0, FREE_LIMB), (FREE_LIMB, 0)]
    assert slipped(plan, *between(plan, 3)) < 1e-4


def test_a_swing_goes_over_what_is_in_the_way_or_is_refused_with_the_pair() -> None:
    robot = climber("hexapod")
    scene, stances = on_stones(robot, np.random.default_rng(1), 0.06)
    one, other = stances.stances[:2]
    at, to = (scene.footholds[s.contacts[0]].pose.translation for s in (one, other))
    for height, passes in ((0.03, True), (0.8, False)):
        middle = (at + to) / 2 + [0.0, 0.0, height / 2]
        along = np.array([*(to - at)[:2], 0.0]) / np.linalg.norm((to - at)[:2])
        turn = np.column_stack([along, np.cross([0.0, 0.0, 1.0], along), [0.0, 0.0, 1.0]])
        wall = SceneBody(Box((0.01, 0.3, height)), pin.SE3(turn, middle))
        blocked = replace(scene, bodies={**scene.bodies, "wall": wall})
        mover = Mover(robot, blocked)
        if passes:
            assert mover.moved(one, other)[0].times[-1] > 0.0
        else:
            with pytest.raises(MoveError, match=r"wall.*apart, and .* required") as refused:
                mover.moved(one, other)
            assert refused.value.nearest is not None
            assert "wall" in (refused.value.nearest.first, refused.value.nearest.second)


def test_what_a_stance_lacks_is_said() -> None:
    robot = climber("hexapod")
    too_high = on_stones(robot, np.random.default_rng(1), 0.05)
    with pytest.raises(MoveError, match="move 1: contact of limb") as refused:
        Mover(robot, too_high[0], MotionOptions(lift=9.0)).moved(*too_high[1].stances[:2])
    assert str(refused.value).count("(got") == 1
    scene, stances = on_stones(robot, np.random.default_rng(1), 0.05)
    one, other = stances.stances[:2]
    low = other.q.copy()
    low[2] -= 1e-3
    with pytest.raises(MoveError, match=r"in stance 2 limb1 is .* off foothold"):
        carry_out(robot, scene, StancePath([one, replace(other, q=low)], np.zeros(1)))
    beyond = robot.with_limb(one.q, 0, robot.limits[0][1] + 0.1)
    free = (FREE_LIMB, *one.contacts[1:])
    with pytest.raises(MoveError, match=r"limb1_joint\d is 0.1 rad or m beyond its limit") as refused:
        carry_out(robot, scene, StancePath([one, Stance(free, beyond)], np.zeros(1)))
    assert refused.value.standing
    with pytest.raises(ShapeError, match="two or more"):
        carry_out(robot, scene, StancePath([one], np.zeros(0)))
    with pytest.raises(RangeError, match="rows from 0"):
        carry_out(robot, scene, StancePath([one, replace(other, contacts=(99,) * 6)], np.zeros(1)))
    endless = replace(robot, robot=robot.robot.with_limits(acceleration=np.inf))
    with pytest.raises(RangeError, match=r"limit of acceleration of limb1_joint1"):
        PathTiming(endless, MotionSpeeds())


class _Never(Equilibrium):
    def margin(self, contacts: Sequence[int], q: Array, *, motors: bool = False, effort: float = 1.0) -> float:
        return -0.25 if FREE_LIMB in contacts else 0.5


def test_moves_that_nothing_bears_are_refused() -> None:
    robot = climber("hexapod")
    scene, stances = on_stones(robot, np.random.default_rng(1), 0.05)
    with pytest.raises(MoveError, match=r"do not bear the robot .* lack 0.25 of its weight"):
        carry_out(robot, scene, stances, balance=_Never(robot, scene))


def test_a_proof_that_stays_open_at_few_instants_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = climber("truss_climber")
    scene, stances = on_stones(robot, np.random.default_rng(1), 0.06)
    monkeypatch.setattr(Mover, "_shapes", lambda mover, *_: iter([SwingShape(mover.lift)]))
    assert Mover(robot, scene).moved(*stances.stances[:2])[0].times[-1] > 0.0
    monkeypatch.setattr(motion, "PARTS", (1,))
    with pytest.raises(MoveError) as open_:
        Mover(robot, scene).moved(*stances.stances[:2])
    assert open_.value.nearest is not None
    assert open_.value.nearest.distance > open_.value.nearest.required


@pytest.mark.parametrize(("share", "passes"), [(0.5, True), (1.5, False)])
def test_links_that_lack_less_than_is_known_of_the_base_between_instants_are_looked_at_with_more(
    monkeypatch: pytest.MonkeyPatch, share: float, passes: bool
) -> None:
    robot, proven = climber("hexapod"), Clearances.moving
    scene, stances = on_stones(robot, np.random.default_rng(1), 0.06)

    def moving(clear: Clearances, contacts: Any, times: Array, q: Array, v: Array | None, within: Any = None) -> Any:
        if v is None or len(times) != looks[0]:
            return proven(clear, contacts, times, q, v, within)
        blur = clear.blur(times, q, v)
        assert blur > 0.0
        return SimpleNamespace(first="link", second="stone", distance=0.01 - share * blur, required=0.01, time=0.5)

    looks = [len(move_path(Closure(robot), *stances.stances[:2], SwingShape(0.02), dict(enumerate(scene.normals))).s)]
    monkeypatch.setattr(Clearances, "moving", moving)
    monkeypatch.setattr(Mover, "_shapes", lambda *_: iter([SwingShape(0.02)]))
    if passes:
        assert Mover(robot, scene).moved(*stances.stances[:2])[0].times[-1] > 0.0
    else:
        with pytest.raises(MoveError, match="link and stone"):
            Mover(robot, scene).moved(*stances.stances[:2])


def test_a_tip_is_near_its_own_stone_only() -> None:
    robot = climber("hexapod")
    scene, stances = on_stones(robot, np.random.default_rng(1), 0.05)
    stance = stances.stances[0]
    assert Clearances(robot, scene).standing(stance.contacts, stance.q) is None
    at = scene.footholds[stance.contacts[0]].pose
    beside = SceneBody(Box((0.02, 0.02, 0.02)), at * pin.SE3(np.eye(3), np.array([0.025, 0.0, 0.02])))
    near = ClimbScene(scene.footholds, {**scene.bodies, "near": beside})
    nearest = Clearances(robot, near).standing(stance.contacts, stance.q)
    assert nearest is not None
    assert (nearest.first, nearest.second) == ("limb1_link3", "near")


@pytest.mark.parametrize("count", [1, 3, 12])
def test_least_time_is_that_of_linear_programs(count: int) -> None:
    from scipy.interpolate import CubicSpline

    rng = np.random.default_rng(count)
    for _ in range(5):
        q = CubicSpline(np.linspace(0.0, 1.0, 7), rng.normal(size=(7, count)))
        s = (1 - np.cos(np.linspace(0, np.pi, 41))) / 2
        a, b = q(s, 1) / 20.0, q(s, 2) / 20.0
        squared = 1.0 / np.maximum((np.abs(q(s, 1)) / 3.0).max(axis=1), 1e-9) ** 2
        ends = [np.stack([x[:-1], x[1:]], axis=1) for x in (a, b)]
        wanted = SpeedProgram(s, [PathRows(*ends, np.zeros_like(ends[0]))], squared).fastest().speed
        np.testing.assert_allclose(fastest(s, a, b, squared), wanted, rtol=1e-6, atol=1e-7)


def test_nothing_that_moves_has_no_time() -> None:
    robot = climber("hexapod")
    scene, stances = on_stones(robot, np.random.default_rng(1), 0.05)
    one = stances.stances[0]
    with pytest.raises(InfeasibleError, match="no joint moves"):
        carry_out(robot, scene, StancePath([one, one], np.zeros(1)))

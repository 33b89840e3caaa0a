"""Elastic bands: slopes of their rows by differences, and moves over edges and past legs that no straight way makes."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pinocchio as pin
import pytest

from tests.climb.referee import between, least_distances, slipped
from tests.repeats import ALL, MORE
from wbc.climb import BodyPlace, first_stance
from wbc.climb.balance import Equilibrium
from wbc.climb.elastic_band import BandRows, ElasticBand
from wbc.climb.machines import climber
from wbc.climb.motion import MotionOptions, Mover, carry_out
from wbc.climb.move_path import SwingShape
from wbc.climb.scene import SceneBody, size_of
from wbc.climb.scenes import draw, placed
from wbc.climb.search import StanceOptions, find_stances
from wbc.climb.stance import StancePath
from wbc.climb.world import ClimbWorld, SampleAims
from wbc.errors import InfeasibleError
from wbc.shapes import Sphere
from wbc.symbolic.joint_steps import place

#: Step of differences [m, rad]
STEP = 1e-6
#: Instants of a plan at which Coal looks
INSTANTS = 60


@pytest.mark.parametrize("name", ["anymal_c", "talos", "truss_climber"])
def test_rows_are_the_slopes_of_what_they_cost(name: str) -> None:
    robot, rng = climber(name), np.random.default_rng(0)
    scene = draw("stairs", size_of(robot)).scene
    world, limbs = ClimbWorld(robot, scene), len(robot.limbs)
    state = world.state_of(robot.rest)
    state[9:12] = [0.0, 0.0, state[11] - 0.1 * world.length]
    state[12:] += rng.uniform(-0.1, 0.1, len(state) - 12)
    bounds = np.array([[0.0, 1.0, 0.3, 0.1], [0.1, -0.5, 1.0, 0.0]])
    near, closed = np.zeros((1, limbs), dtype=np.int32), np.ones((1, limbs), dtype=bool)

    def looked(at: np.ndarray) -> tuple[np.ndarray, float]:
        _, g, cost, *_ = world.band(SampleAims(near, closed, world.places[None, :limbs]), bounds, 1.0, 0.2, at[None])
        return g[0], cost

    def moved(k: int, by: float) -> np.ndarray:
        out = state.copy()
        if k < 3:
            out[9 + k] += by
        elif k < 6:
            out[:9] = (pin.exp3(by * np.eye(3)[k - 3]) @ out[:9].reshape(3, 3)).ravel()
        else:
            out[6 + k] += by
        return out

    g, _ = looked(state)
    slopes = [(looked(moved(k, STEP))[1] - looked(moved(k, -STEP))[1]) / (2.0 * STEP) for k in range(len(g))]
    np.testing.assert_allclose(g, -0.5 * np.array(slopes), rtol=2e-3, atol=2e-3 * np.abs(g).max())


@pytest.mark.parametrize("name", ["a1", "talos"])
def test_every_move_over_stairs_has_a_motion(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = climber(name)
    course = draw("stairs", size_of(robot))
    start = first_stance(robot, course.scene, placed(robot, course.start))
    goal = BodyPlace(robot.body_pose(placed(robot, course.goal)).translation)
    stances = find_stances(robot, course.scene, start, goal, StanceOptions(apart=0.001))
    balance = Equilibrium(robot, course.scene)
    monkeypatch.setattr(Mover, "_shapes", lambda mover, *_: iter([SwingShape(mover.lift)]))
    refused, straight = list[int](), Mover(robot, course.scene, balance=balance)
    for row, (one, other) in enumerate(itertools.pairwise(stances.stances)):
        try:
            straight.moved(one, other)
        except InfeasibleError:
            refused.append(row)
    monkeypatch.undo()
    assert len(refused) > 5, "else nothing is asked"
    mover = Mover(robot, course.scene, MotionOptions(), balance)
    for row in refused[:: 1 if MORE >= ALL else 2]:
        path = StancePath(stances.stances[row : row + 2], np.zeros(2))
        plan = carry_out(robot, course.scene, path, mover=mover)
        times, q = between(plan, 2)
        assert slipped(plan, times, q) < 1e-4
        assert plan.margin is not None
        assert plan.margin >= 0.0
        # Hulls of a humanoid take Coal a second a stance
        if name != "talos" and row in refused[:3]:
            mine, other_links = least_distances(plan, q[:: max(1, len(q) // INSTANTS)])
            assert mine > 0.001 - 1e-4
            assert other_links > 0.01 - 1e-4


@pytest.mark.parametrize("still", [True, False])
def test_a_body_that_stays_is_not_moved_by_what_its_limb_goes_round(still: bool) -> None:
    robot = climber("hexapod")
    size, x = size_of(robot), np.linspace(0.0, 1.0, 11)[:, None]
    course = draw("stairs", size)
    q = first_stance(robot, course.scene, placed(robot, course.start)).q
    tip = robot.contact_pose(robot.with_limb(q, 0, robot.angles(q, 0) + [0.0, -0.3, 0.0]), 0)
    ball = SceneBody(Sphere(0.05 * size), tip)
    world = ClimbWorld(
        robot, dataclasses.replace(course.scene, bodies={**course.scene.bodies, "ball": ball}), clear=0.01
    )
    states = np.tile(world.state_of(q), (11, 1))
    states[:, 12:15] += [0.0, -0.3, 0.0] + (2.0 * x - 1.0) * [0.5, 0.0, 0.0]
    poses = np.tile([place(robot.contact_pose(q, limb)) for limb in range(6)], (11, 1, 1))
    closed = np.tile(np.arange(6) > 0, (11, 1))
    rows = BandRows(np.zeros((11, 6), dtype=np.int32), poses, closed, np.zeros(6, dtype=np.int32))
    band = ElasticBand(world, still=still).relaxed(states, rows)
    moved = np.abs(band[:, :12] - states[:, :12]).max()
    assert np.abs(band[:, 12:] - states[:, 12:]).max() > 0.01
    assert moved == 0.0 if still else moved > 1e-5

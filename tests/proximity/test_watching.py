"""What is not measured in a tick could not have been chosen: against all pairs measured in every tick."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import random_configuration
from tests.models import robot as bare
from tests.proximity.world import NAMES, all_pairs, place, robot, sensor, set_pose
from tests.repeats import covering
from wbc.proximity import Body, native
from wbc.robot import Robot
from wbc.shapes import Box, HalfSpace, Sphere


def kept(distance: np.ndarray, rows: list[int], count: int, slack: float) -> list[int]:
    """The rows of the next tick by the rule alone, from all distances: whose score is among the best stays."""
    score = distance.copy()
    held = [k for k in rows if k >= 0]
    score[held] -= native.KEEP_SHARE * np.maximum(distance[held], 0.0) + slack
    best = np.argsort(score, kind="stable")[:count].tolist()
    fresh = [k for k in best if k not in held]
    return [k if k in best else fresh.pop(0) for k in rows]


def steps(bot: Robot, rng: np.random.Generator, ticks: int) -> np.ndarray:
    """Velocities times dt: at rest, slow, fast, and a leap now and then."""
    size = np.repeat(rng.choice([0.0, 1e-3, 1e-2, 0.05], ticks // 25), 25)
    size[rng.integers(ticks, size=3)] = 1.0
    wander = rng.normal(size=(ticks // 25, bot.nv)).repeat(25, axis=0)
    return np.asarray(size[:, None] * (wander + 0.3 * rng.normal(size=(len(size), bot.nv))))


@pytest.mark.parametrize(("name", "seed"), covering(NAMES, [1, 2]))
def test_rows_are_those_of_measuring_everything(name: str, seed: int) -> None:
    """Tick by tick the rule applied to the distances of all pairs gives the same pairs in the same rows."""
    bot, rng, count = robot(name), np.random.default_rng([20, seed]), 6
    pairs, pose = all_pairs(bot, rng), place(rng, 0.4)
    sensing, numbers = sensor(bot, pairs, count, pose)
    everything, every = sensor(bot, pairs, len(pairs), pose)
    slack = native.KEEP_LENGTH * bot.characteristic_length
    q, rows, watched, changes = random_configuration(bot, rng), [-1] * count, 0, 0
    for k, step in enumerate(steps(bot, rng, 250)):
        q = pin.integrate(bot.model, q, step)
        if k % 3 == 0 and k > 100:
            moved = place(rng, 0.02 if k % 50 else 0.5)
            pose = pin.SE3(pin.exp3(0.05 * rng.normal(size=3)) @ pose.rotation, pose.translation + moved.translation)
            for values in (numbers, every):
                set_pose(values, pose)
        sensing.sense(q)
        everything.sense(q)
        expected = kept(every["distance"], rows, count, slack)
        changes += expected != rows
        rows = expected
        assert sensing._sensing.pairs.tolist() == rows, k
        assert np.array_equal(numbers["distance"], every["distance"][rows])
        watched += sensing.measured
    assert 5 < changes < 200
    assert watched < 0.6 * 250 * len(pairs)


def planar() -> Robot:
    """A body that turns and slides freely."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.addFrame(pin.Frame("plate", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return bare("free", model)


def test_a_half_space_that_turns_reaches_far() -> None:
    """A turn of 1e-3 rad lifts a plane by 5 cm in 50 m: a ball out there is measured in time."""
    bot = planar()
    plate = Body("plate", "plate", pin.SE3.Identity(), HalfSpace())
    balls = [(0.5, 0.03), (-0.5, 0.3), (50.0, 0.2)]
    pairs = [(plate, Body(f"{x}", "world", pin.SE3(np.eye(3), np.array([x, 0.0, z])), Sphere(0.01))) for x, z in balls]
    sensing, _ = sensor(bot, pairs, 1)
    seen = []
    for k in range(9):
        q = np.array(bot.neutral)
        q[3:7] = pin.Quaternion(pin.exp3(np.array([0.0, -1e-3 * k, 0.0]))).coeffs()
        sensing.sense(q)
        seen.append(sensing.pairs()[0][1])
    assert seen[:4] == ["0.5"] * 4
    assert seen[4:] == ["50.0"] * 5


def test_at_rest_nothing_but_the_nearest_is_measured() -> None:
    bot, rng = robot("panda"), np.random.default_rng(21)
    hand = Body("hand", "panda_hand", pin.SE3.Identity(), Box((0.1, 0.1, 0.1)))
    cloud = [Body(f"{k}", "world", place(rng, 2.0), Box((0.05, 0.05, 0.05))) for k in range(300)]
    sensing, numbers = sensor(bot, [(hand, body) for body in cloud], 4)
    sensing.sense(bot.neutral)
    before = numbers["distance"].copy()
    sensing.sense(bot.neutral)
    assert np.array_equal(before, numbers["distance"])
    assert sensing.measured < 20

"""Rows against central differences of Coal's distance itself, and drifts against moved obstacles."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import random_configuration
from tests.proximity.world import NAMES, Referee, all_pairs, place, robot, rows_of, sensor, set_pose
from wbc.proximity import Body, PairSensor
from wbc.shapes import Box, Cylinder

#: Step of the differences [rad, m], and how far two one-sided differences may be apart: more is a tie within the step
STEP, BEND = 2e-5, 1e-3


def differences(referee: Referee, pair: tuple[Body, Body], q: np.ndarray, pose: pin.SE3) -> tuple[np.ndarray, float]:
    """Central differences of the distance along every degree of freedom, and how far the sides disagree."""
    bot = referee.bot
    here = referee(pair, q, pose)[0]
    out, bend = np.zeros(bot.nv), 0.0
    for k, axis in enumerate(np.eye(bot.nv)):
        after = referee(pair, pin.integrate(bot.model, q, STEP * axis), pose)[0]
        before = referee(pair, pin.integrate(bot.model, q, -STEP * axis), pose)[0]
        out[k] = (after - before) / (2 * STEP)
        bend = max(bend, abs(after - 2 * here + before) / STEP)
    return out, bend


@pytest.mark.parametrize("name", NAMES)
def test_rows_are_the_derivative_of_the_distance(name: str) -> None:
    bot, rng = robot(name), np.random.default_rng(6)
    pairs, referee = all_pairs(bot, rng), Referee(bot, 1e-10)
    sensing, numbers = sensor(bot, pairs, len(pairs))
    checked = {True: 0, False: 0}
    for k in range(2 if name == "talos" else 5):
        q = random_configuration(bot, rng)
        pin.framesForwardKinematics(bot.model, referee.data, q)
        # Within the reach of one link, which overlaps it or nearly
        pose = pin.SE3(place(rng).rotation, referee.pose(pairs[k][0], pin.SE3.Identity()).translation + 0.02)
        set_pose(numbers, pose)
        sensing.sense(q)
        rows = rows_of(bot, numbers, q)
        inside = numbers["distance"] < 0
        for k in rng.permutation(len(pairs))[:30].tolist() + np.flatnonzero(inside)[:10].tolist():
            overlapping = bool(inside[k])
            if sensing.doubtful[k] or (overlapping and any(isinstance(b.shape, Cylinder) for b in pairs[k])):
                continue
            numeric, bend = differences(referee, pairs[k], q, pose)
            if bend < BEND:
                # Coal's normals of curved shapes are as good as the root of GJK's tolerance over their radius
                tolerance = 2e-3 if any(isinstance(b.shape, Cylinder) for b in pairs[k]) else 2e-5
                assert rows[k] == pytest.approx(numeric, abs=tolerance), (pairs[k][0].name, pairs[k][1].name)
                checked[overlapping] += 1
    assert checked[True] >= 3, "overlapping pairs are among the tests"
    assert checked[False] >= 50, "few pairs have a tie within a step"


@pytest.mark.parametrize("name", NAMES)
def test_drift_is_the_rate_of_the_distance_to_a_moved_obstacle(name: str) -> None:
    bot, rng = robot(name), np.random.default_rng(8)
    pairs, referee, pose = all_pairs(bot, rng), Referee(bot, 1e-10), place(rng, 0.6)
    sensing, numbers = sensor(bot, pairs, len(pairs), pose)
    q, twist = random_configuration(bot, rng), rng.normal(size=6)
    numbers["velocity"][:] = twist
    sensing.sense(q)
    moved = 0
    for k, pair in enumerate(pairs):
        sides = [
            pin.SE3(pin.exp3(s * STEP * twist[3:]) @ pose.rotation, pose.translation + s * STEP * twist[:3])
            for s in (-1, 0, 1)
        ]
        before, here, after = (referee(pair, q, at)[0] for at in sides)
        if abs(after - 2 * here + before) / STEP < BEND and not sensing.doubtful[k] and here > 0:
            assert numbers["drift"][k] == pytest.approx((after - before) / (2 * STEP), abs=5e-3)
            moved += abs(numbers["drift"][k]) > 0.05
    assert moved >= 5, "obstacles that move are among the tests"
    numbers["velocity"][:] = 0.0
    sensing.sense(q)
    assert not numbers["drift"].any()


def test_sides_tell_who_is_moved() -> None:
    """Of two fingers only their own joints count; of a finger and the world, all joints above it."""
    bot = robot("panda")
    link, hand = (
        Body("a", "panda_link3", pin.SE3.Identity(), Box((0.1,) * 3)),
        Body("b", "panda_link7", pin.SE3.Identity(), Box((0.1,) * 3)),
    )
    block = Body("c", "world", pin.SE3(np.eye(3), np.array([0.9, 0.0, 0.0])), Box((0.1,) * 3))
    _, numbers = made = sensor(bot, [(link, hand), (hand, link), (hand, block), (block, link)], 5)
    made[0].sense(bot.neutral)
    expected = [[0, 0, 0, 1, 1, 1, 1], [0, 0, 0, -1, -1, -1, -1], [-1] * 7, [1, 1, 1, 0, 0, 0, 0], [0] * 7]
    assert numbers["side"].reshape(5, 7) == pytest.approx(np.array(expected))
    assert numbers["distance"][4] == 1e3, "the row without a pair is far"
    assert not numbers["line"][24:].any()


def test_another_name_for_what_moves() -> None:
    bot, rng = robot("panda"), np.random.default_rng(10)
    pair = (
        Body("a", "panda_link7", place(rng), Box((0.1,) * 3)),
        Body("b", "tray", place(rng), Box((0.1,) * 3)),
    )
    _, numbers = sensor(bot, [(pair[0], Body("b", "obstacle", pair[1].placement, pair[1].shape))], 1, place(rng, 0.4))
    first = {k: v.copy() for k, v in numbers.items()}
    PairSensor(bot, [pair], 1, first, moving="tray").sense(bot.neutral)
    second = {k: v.copy() for k, v in numbers.items()}
    PairSensor(bot, [(pair[0], Body("b", "obstacle", pair[1].placement, pair[1].shape))], 1, second).sense(bot.neutral)
    assert np.array_equal(first["distance"], second["distance"])

"""Pairs without a row at a command: each that closes faster than its row would let it is found."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import random_configuration
from tests.proximity.world import NAMES, all_pairs, buffers, place, robot, rows_of
from tests.repeats import repeats
from wbc.proximity import PairSensor
from wbc.proximity.missing import ALL, HALF, LITTLE, TOO_MUCH
from wbc.robot import Robot

DT, MARGIN, RATE = 0.01, 0.02, 3.0


def numbers_of(bot: Robot, count: int, pose: pin.SE3, twist: np.ndarray) -> dict[str, np.ndarray]:
    made = buffers(bot, count, pose) | {"margin": np.array([MARGIN]), "rate": np.array([RATE])}
    return made | {"velocity": twist}


def allowed(h: np.ndarray, drift: np.ndarray, a: np.ndarray) -> np.ndarray:
    """How fast pairs may close by the robot's motion: docs/reach.md, with a the deceleration of the pair."""
    out = RATE * h + drift
    counts = (h > 0.0) & np.isfinite(a) & (a > 0.0)
    closing = np.maximum(-drift[counts], 0.0)
    # v dt + v^2 / (2 a) + closing v / a = h
    b, c = DT + closing / a[counts], h[counts]
    speed = a[counts] * (np.sqrt(b * b + 2.0 * c / a[counts]) - b)
    out[counts] = np.minimum(out[counts], speed + np.maximum(drift[counts], 0.0))
    return out


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("limited", [False, True])
def test_what_has_no_row_is_found_where_it_needs_one(name: str, limited: bool) -> None:
    """Against the rows of all pairs, at commands from rest to full speed; only the bounds let pairs go unmeasured."""
    bot, rng = robot(name), np.random.default_rng(21)
    pairs, count = all_pairs(bot, rng), 5
    braking = np.full(bot.nv, np.inf)
    if limited:
        braking[bot.base_nv :] = rng.uniform(0.5, 5.0, bot.nv - bot.base_nv)
    checked = 0
    for turn in range(repeats(6)):
        q, pose = random_configuration(bot, rng), place(rng, 0.4)
        twist = rng.uniform(-0.3, 0.3, 6) * (turn % 3 > 0)
        v = rng.uniform(-1.0, 1.0, bot.nv) * 10.0 ** rng.uniform(-1.0, 1.5)
        every, some = (numbers_of(bot, n, pose, twist) for n in (len(pairs), count))
        PairSensor(bot, pairs, len(pairs), every).sense(q)
        sensing = PairSensor(bot, pairs, count, some)
        sensing.sense(q)
        rows, drift, h = rows_of(bot, every, q), every["drift"], every["distance"] - MARGIN
        weighed = np.where(rows != 0.0, np.abs(rows) * np.where(rows != 0.0, braking, 0.0), 0.0).sum(axis=1)
        over = -rows @ v - allowed(h, drift, weighed)
        without = np.ones(len(pairs), dtype=bool)
        without[sensing._sensing.pairs] = False
        screws = pin.computeJointJacobians(bot.model, bot.model.createData(), q).T
        worst, urgent = sensing.missing(screws, v, DT, braking), np.array(sensing._sensing.urgent)
        assert (worst >= TOO_MUCH) == bool((over[without] > 1e-8).any())
        clear = np.abs(over) > 1e-6
        assert (urgent[without & clear & (over > 0.0)] == ALL).all()
        assert (urgent[without & clear & (over < 0.0)] <= HALF).all()
        checked += int((without & (over > 1e-8)).sum())
        if worst >= TOO_MUCH:
            sensing.sense(q)
            kept = set(sensing._sensing.pairs.tolist())
            wanting = set(np.flatnonzero(urgent == ALL).tolist())
            assert len(kept & wanting) == min(count, len(wanting)), "what needs a row has one"
    assert checked > 3


def test_a_sensor_that_measured_nothing_or_has_all_pairs_misses_none() -> None:
    bot, rng = robot("panda"), np.random.default_rng(23)
    pairs, pose = all_pairs(bot, rng), place(rng, 0.4)
    sensing = PairSensor(bot, pairs, 3, numbers_of(bot, 3, pose, np.zeros(6)))
    screws, v, braking = np.ones((bot.nv, 6)), np.full(bot.nv, 2.0), np.full(bot.nv, np.inf)
    assert sensing.missing(screws, v, DT, braking) == LITTLE
    everything = PairSensor(bot, pairs, len(pairs), numbers_of(bot, len(pairs), pose, np.zeros(6)))
    everything.sense(bot.neutral)
    assert everything.missing(screws, v, DT, braking) == LITTLE

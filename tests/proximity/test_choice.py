"""Which pairs have rows: the closest, found by bounds; rows that stay; the same every time."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import random_configuration
from tests.models import placement, spherical_seven
from tests.proximity.world import NAMES, all_pairs, place, robot, sensor, set_pose
from wbc.proximity import Body, distances, native
from wbc.shapes import Sphere


def row_pairs(sensing: object) -> list[tuple[str, str]]:
    return [found[:2] for found in sensing.pairs()]  # type: ignore[attr-defined]


def ball_at(name: str, x: float) -> Body:
    return Body(name, "obstacle", pin.SE3(np.eye(3), np.array([x, 0.0, 0.0])), Sphere(0.01))


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("count", [1, 7, 40])
def test_the_closest_pairs_have_rows(name: str, count: int) -> None:
    """From scratch at every configuration: then no pair has a row to keep."""
    bot, rng = robot(name), np.random.default_rng(11)
    pairs, pose = all_pairs(bot, rng), place(rng, 0.4)
    sensing, numbers = sensor(bot, pairs, count, pose)
    everything, every = sensor(bot, pairs, len(pairs), pose)
    for _ in range(15):
        q = random_configuration(bot, rng)
        sensing.reset()
        assert sensing.pairs() == ()
        assert set(numbers["distance"]) == {1e3}
        sensing.sense(q)
        everything.sense(q)
        assert numbers["distance"] == pytest.approx(np.sort(every["distance"])[:count], abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_a_walk_keeps_what_is_close_enough(name: str) -> None:
    """Whatever was chosen before: no pair outside is closer than a pair with a row by more than what is stated."""
    bot, rng = robot(name), np.random.default_rng(12)
    pairs, pose, count = all_pairs(bot, rng), place(rng, 0.4), 8
    sensing, numbers = sensor(bot, pairs, count, pose)
    everything, every = sensor(bot, pairs, len(pairs), pose)
    q, slack = random_configuration(bot, rng), native.KEEP_LENGTH * bot.characteristic_length
    names, changes, before = [(a.name, b.name) for a, b in pairs], 0, []
    for k in range(120):
        # Now and then a leap, over which no bound from before holds
        q = pin.integrate(bot.model, q, rng.normal(size=bot.nv) * (1.0 if k % 40 == 39 else 0.1))
        sensing.sense(q)
        everything.sense(q)
        rows = row_pairs(sensing)
        assert len(set(rows)) == count
        chosen = [names.index(pair) for pair in rows]
        assert numbers["distance"] == pytest.approx(every["distance"][chosen], abs=1e-12)
        outside = np.delete(every["distance"], chosen).min()
        worst = numbers["distance"].max()
        assert outside >= worst - native.KEEP_SHARE * max(worst, 0.0) - slack - 1e-12
        stays = [pair for pair in before if pair in rows]
        assert all(before.index(pair) == rows.index(pair) for pair in stays), "who stays, stays in its row"
        changes += len(stays) < len(before)
        before = rows
    assert 3 < changes < 100


def test_noise_does_not_swap_rows() -> None:
    """Two balls at nearly the same distance, one row: 1 mm of noise moves the row once per 200 ticks at most."""
    bot, rng = robot("panda"), np.random.default_rng(13)
    hand = Body("hand", "panda_hand", pin.SE3.Identity(), Sphere(0.05))
    pairs = [(hand, ball_at("left", 0.9)), (hand, ball_at("right", 0.9004)), (hand, ball_at("far", 2.0))]
    sensing, numbers = sensor(bot, pairs, 1)
    seen = []
    for _ in range(400):
        set_pose(numbers, pin.SE3(pin.exp3(rng.normal(size=3) * 1e-3), rng.normal(size=3) * 1e-3))
        sensing.sense(bot.neutral)
        seen.append(sensing.pairs()[0][1])
    assert sum(a != b for a, b in itertools.pairwise(seen)) <= 2
    assert "far" not in seen


@pytest.mark.parametrize("nearer", [1e-6, -1e-6])
def test_a_closer_pair_takes_the_row_by_the_stated_margin(nearer: float) -> None:
    """Two balls before a resting hand: the second takes the row where it is closer by the stated margin, not before."""
    bot = spherical_seven()
    tip = np.array(placement(bot, "tip", bot.neutral).translation)
    hand = Body("hand", "tip", pin.SE3.Identity(), Sphere(0.02))
    rests = Body("rests", "world", pin.SE3(np.eye(3), tip + [0.53, 0.0, 0.0]), Sphere(0.01))
    comes = Body("comes", "obstacle", pin.SE3.Identity(), Sphere(0.01))
    sensing, numbers = sensor(bot, [(hand, comes), (hand, rests)], 1, pin.SE3(np.eye(3), tip + [0.0, 2.0, 0.0]))
    sensing.sense(bot.neutral)
    assert sensing.pairs() == (("hand", "rests", pytest.approx(0.5)),)
    edge = (1 - native.KEEP_SHARE) * 0.5 - native.KEEP_LENGTH * bot.characteristic_length
    set_pose(numbers, pin.SE3(np.eye(3), tip + [0.0, edge - nearer + 0.03, 0.0]))
    sensing.sense(bot.neutral)
    assert sensing.pairs()[0][:2] == ("hand", "comes" if nearer > 0 else "rests")


def test_two_sensors_write_the_same_numbers() -> None:
    bot, rng = robot("talos"), np.random.default_rng(14)
    pairs, pose = all_pairs(bot, rng), place(rng, 0.4)
    made = [sensor(bot, pairs, 12, pose) for _ in range(2)]
    path = [random_configuration(bot, rng) for _ in range(10)]
    made[1][0].sense(path[-1])
    made[1][0].reset()
    for q in path:
        for sensing, _ in made:
            sensing.sense(q)
        for key, value in made[0][1].items():
            assert value.tobytes() == made[1][1][key].tobytes(), key


def test_thousands_of_pairs() -> None:
    """A cloud of balls round a robot: 5000 pairs, of which bounds leave few to measure."""
    bot, rng = robot("panda"), np.random.default_rng(15)
    cloud = [Body(f"ball{k}", "world", place(rng, 3.0), Sphere(0.02)) for k in range(1000)]
    links = [Body(f, f, pin.SE3.Identity(), Sphere(0.05)) for f in ("panda_link3", "panda_link4", "panda_link5")]
    links += [Body(f, f, pin.SE3.Identity(), Sphere(0.05)) for f in ("panda_link6", "panda_link7")]
    pairs = [(a, b) for a in links for b in cloud]
    sensing, numbers = sensor(bot, pairs, 10)
    q = random_configuration(bot, rng)
    for _ in range(3):
        q = pin.integrate(bot.model, q, 0.01 * rng.normal(size=bot.nv))
        sensing.sense(q)
    sensing.reset()
    sensing.sense(q)
    assert numbers["distance"] == pytest.approx(np.sort(distances(bot, pairs, q))[:10], abs=1e-12)
    sensing.sense(q)
    assert sensing.measured < 100

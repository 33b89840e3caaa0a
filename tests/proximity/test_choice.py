"""Which pairs have rows: the closest, found by bounds; rows that stay; the same every time."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import random_configuration
from tests.proximity.world import NAMES, all_pairs, place, robot, sensor
from wbc.proximity import Body, distances
from wbc.shapes import Sphere


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

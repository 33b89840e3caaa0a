"""Every item with a value in a loop with an ideal robot, judged by values and distances that are not ours."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import numpy as np
import pytest

from tests.closed_loop import collisions
from tests.closed_loop.eyes import Array
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import CONSTRAINT_ROBOTS, TASK_ROBOTS, anywhere, machine, near
from tests.evaluation import numbers, sample
from tests.items import ITEMS
from tests.repeats import covering, repeats
from tests.values import VALUES
from wbc import tasks
from wbc.robot import Robot
from wbc.tasks import Item, JointLimits, Posture

DT, GAIN, TICKS = 0.02, 5.0, 90
#: Least singular value of rows at starts and targets [m or rad per rad]
REGULAR = 0.1
#: Margins at starts, and how far beyond their limit goals are, at least [m, rad]
ROOM = 0.02
#: Without an error that decays: rates, and velocities
FOLLOWED = [
    name for name in VALUES if issubclass(getattr(tasks, name), tasks.Task) and name not in ("Damping", "Momentum")
]
BOUNDED = ["WorkspaceBox", "WorkspacePolyhedron", "AxisCone", "GazeCone"]


def drawn(name: str, where: str) -> tuple[Robot, list[tuple[Item, dict[str, Any]]], np.random.Generator]:
    rng = np.random.default_rng(zlib.crc32(f"{name} {where}".encode()))
    return machine(where), ITEMS[name](machine(where)), rng


def still(item: Item, robot: Robot) -> dict[str, Any]:
    """Inputs at their defaults, as far as they have some."""
    return {d.name: d.default for d in item.inputs(robot) if d.default is not None}


@pytest.mark.parametrize(("name", "where"), covering(FOLLOWED, TASK_ROBOTS))
def test_errors_fall_by_gain_dt_a_tick(name: str, where: str) -> None:
    """Alone, towards where the item is in a configuration nearby, but for what the robot's curvature bends."""
    robot, declared, rng = drawn(name, where)
    powers = (1 - GAIN * DT) ** np.arange(0, TICKS + 1, 10)
    for item, given in declared[:: len(declared) - 1 or 1][:2]:
        loop, found, starts = Loop(robot, {"it": item}, DT, "vm"), numbers(item, robot), 0
        for _ in range(200):
            q = anywhere(robot, rng)
            goal = near(robot, rng, q, 0.15)
            values = still(item, robot) | given | item.initial(robot, goal) | {"gain": GAIN}
            rows = [np.linalg.svd(found(x, values)["jacobian"], compute_uv=False)[-1] for x in (q, goal)]
            if min(rows) < REGULAR and name != "Manipulability":
                continue
            starts += 1
            loop["it"].set(**values)
            run = loop.run(q, TICKS)
            sizes = np.array([np.linalg.norm(VALUES[name](item, robot, x, values)) for x in run.q[::10]])
            assert run.unsolved == 0
            assert np.abs(sizes - powers * sizes[0]).max() < 0.03 * max(sizes[0], 0.02)
            assert sizes[-1] < 1e-3 * max(sizes[0], 0.02)
            if starts == repeats(2):
                break
        assert starts == repeats(2)


@pytest.mark.parametrize(("name", "where"), covering(BOUNDED, CONSTRAINT_ROBOTS))
def test_margins_stay_while_joints_are_pulled_beyond_them(name: str, where: str) -> None:
    """None falls below zero by more than 2 mm or mrad, which is what a tick bends by here; most runs end at a limit."""
    robot, declared, rng = drawn(name, where)
    for item, given in declared:
        caps = JointLimits(acceleration=False)
        loop = Loop(robot, {"it": item, "rest": Posture(joints=robot.joint_names), "caps": caps}, 0.01, "vm")
        loop["caps"].velocity_scale, loop["rest"].gain = 0.5, 5.0
        ends = 0
        for _ in range(repeats(2)):
            q, goal, values = beyond(name, item, robot, given, rng)
            loop["it"].set(**values)
            loop["rest"].target = goal
            run = loop.run(q, 60)
            assert run.unsolved == 0
            margins = np.array([VALUES[name](item, robot, x, values).min() for x in run.q])
            assert margins.min() > -2e-3
            ends += bool(margins[-1] < 3e-3)
        assert ends


def beyond(
    name: str, item: Item, robot: Robot, given: Mapping[str, Any], rng: np.random.Generator
) -> tuple[Array, Array, dict[str, Any]]:
    """A start within a limit, a goal beyond it, and values of inputs that stand still."""
    for _ in range(20_000):
        q = anywhere(robot, rng)
        goal = near(robot, rng, q, 0.8)
        values = {d.name: sample(robot, d, rng) for d in item.inputs(robot) if d.rate is not None}
        if "lower" in values and "upper" in values:
            values |= {"lower": np.minimum(values["lower"], values["upper"]), "upper": values["lower"] + 2.0}
        values = still(item, robot) | values | given
        margins = [VALUES[name](item, robot, x, values).min() for x in (q, goal)]
        if margins[0] > ROOM and margins[1] < -ROOM:
            return q, goal, values
    raise AssertionError(f"{name}: hardly any start and goal of use")


#: Check -> what is measured of it
COLLISIONS: dict[str, Callable[[Loop], Mapping[str, float]]] = {
    **{name: partial(collisions.pressed, name=name) for name in collisions.THINGS},
    **{name: partial(collisions.folded, name=name) for name in collisions.SELF},
}


@cache
def collision_loop(where: str) -> Loop:
    return collisions.build(where)


@pytest.mark.parametrize(("name", "where"), covering(COLLISIONS, CONSTRAINT_ROBOTS))
def test_distances_stay_while_the_hand_is_pulled_into_things(name: str, where: str) -> None:
    COLLISIONS[name](collision_loop(where))


def test_rows_for_corners_keep_arms_from_rocking() -> None:
    """With one row a sensed pair two arms side by side roll over each other, deeper than the whole margin."""
    with pytest.raises(AssertionError, match=r"\{'deepest': (np.float64\()?-0.0[1-9]"):
        collisions.folded(collisions.one_row_a_pair(), "self, sensed", 8)

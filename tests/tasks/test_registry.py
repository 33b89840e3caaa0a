"""One walk over the registry: every derivative of every shipped class against finite differences, on four robots.

Values are those that Pinocchio and numpy find. Rows that are not the derivative of a value (damping, velocity limits,
holds, the rate of a pitch plane) are held to Pinocchio's velocities. A class without a factory, or without its check,
fails.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import Numbers, later, numbers, sample, slope
from tests.items import ITEMS, NO_VELOCITIES
from tests.repeats import covering, repeats
from tests.tasks.robots import NAMES, random_configuration, robot
from tests.values import ELSEWHERE, VALUES, has_value
from wbc.robot import Robot
from wbc.tasks import Item, PitchPlane, Task, registry

#: States of an item on each of four robots
STATES = repeats(1)
DIRECTIONS = 2
SHIPPED = sorted(name for name, cls in registry().items() if cls.__module__.startswith("wbc.tasks."))


def close(found: np.ndarray, wanted: np.ndarray, tolerance: float = 1e-7) -> None:
    """Equal within ``tolerance`` of the largest entry, or of 1."""
    assert found.shape == wanted.shape
    scale = max(1.0, float(np.abs(wanted).max(initial=0.0)))
    assert float(np.abs(found - wanted).max(initial=0.0)) <= tolerance * scale


def draw(
    robot: Robot, item: Item, given: dict[str, Any], rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """A state and run-time values."""
    values = {d.name: sample(robot, d, rng) for d in item.inputs(robot)} | given
    return random_configuration(robot, rng), rng.uniform(-1.0, 1.0, robot.nv), values


def check_derivatives(found: Numbers, q: np.ndarray, values: dict[str, Any]) -> None:
    """Value against its Jacobian along random directions, in which every column counts, and its drift in time."""
    robot, here = found.robot, found(q, values)
    directions = np.random.default_rng(0).uniform(-1.0, 1.0, (DIRECTIONS, robot.nv))
    columns = [
        slope(lambda t, d=direction: found(pin.integrate(robot.model, q, t * d), values)["value"])
        for direction in directions
    ]
    close(here["jacobian"] @ directions.T, np.column_stack(columns))
    close(here["drift"], slope(lambda t: found(q, later(robot, found.item, values, t))["value"]))


def test_every_shipped_class_has_a_factory_and_is_exported() -> None:
    import wbc.tasks

    assert set(SHIPPED) == set(ITEMS)
    assert set(SHIPPED) <= set(wbc.tasks.__all__)


def own_rows(item: Item) -> bool:
    """Whether a task gives its own rows (damping and pointing always, a pitch plane in one of its forms)."""
    return ITEMS[type(item).__name__].own_rows or (isinstance(item, PitchPlane) and item.commands_rate)


@pytest.mark.parametrize(("class_name", "robot_name"), covering(SHIPPED, NAMES))
def test_rows_are_what_the_class_says(class_name: str, robot_name: str) -> None:
    machine, rate = robot(robot_name), ITEMS[class_name].rate
    rng = np.random.default_rng(zlib.crc32(f"{class_name} {robot_name}".encode()))
    for item, given in ITEMS[class_name](machine):
        if item.refusal(machine, "velocity"):
            # torques and forces have no rows on velocities: tests/torque
            assert class_name in NO_VELOCITIES
            continue
        found = numbers(item, machine)
        for _ in range(STATES):
            q, v, values = draw(machine, item, given, rng)
            here = found(q, values, v)
            assert all(np.isfinite(x).all() or name in ("lower", "upper") for name, x in here.items())
            if has_value(item):
                wanted = VALUES[class_name](item, machine, q, values)
                at_rest = found(q, values)
                close(here["value"] if "value" in here else -at_rest["lower"] / values["gain"], wanted, 1e-10)
            else:
                assert {
                    class_name,
                    type(getattr(item, "task", item)).__name__,
                } & ELSEWHERE.keys() or "value" not in here
            if isinstance(item, Task) and own_rows(item):
                assert rate is not None
                close(here["jacobian"] @ v, rate(item, machine, q, v))
            elif "value" in here:
                check_derivatives(found, q, values)
            elif "matrix" in here:
                assert rate is not None
                close(here["matrix"] @ v, rate(item, machine, q, v), 1e-12)
                assert (here["lower"] <= here["upper"]).all()
            else:
                assert here["lower"].shape == here["upper"].shape == (machine.nv,)
                assert (here["lower"] <= here["upper"]).all()


@pytest.mark.parametrize("class_name", SHIPPED)
def test_declaration_is_plain_deterministic_and_tells_items_apart(class_name: str) -> None:
    machine = robot("panda")
    keys = [repr(item.declaration(machine)) for item, _ in ITEMS[class_name](machine)]
    assert keys == [repr(item.declaration(machine)) for item, _ in ITEMS[class_name](machine)]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("class_name", SHIPPED)
def test_first_value_of_an_input_without_default_is_where_the_robot_is(class_name: str) -> None:
    machine = robot("kinova")
    q = random_configuration(machine, np.random.default_rng(3))
    for item, _ in ITEMS[class_name](machine):
        if item.refusal(machine, "velocity"):
            continue
        initial = item.initial(machine, q)
        values = {d.name: initial[d.name] if d.default is None else d.default for d in item.inputs(machine)}
        here = numbers(item, machine)(q, values)
        if isinstance(item, Task) and any(d.default is None for d in item.inputs(machine)):
            assert np.abs(here["value"]).max() < 1e-12


#: Inputs that values depend on and that have no rate: what is kept from things, the point of an object, and planes that
#: are worked out anew
STANDING = {("Obstacle", "margin"), ("SelfCollision", "margin"), ("RelativePose", "at")}
STANDING |= {("SupportRegion", "normals"), ("SupportRegion", "offsets")}


@pytest.mark.parametrize("class_name", SHIPPED)
def test_what_moves_a_value_has_a_rate_and_weights_are_those_declared(class_name: str) -> None:
    """A tick feeds the motion of inputs forward by these rates."""
    machine, rng = robot("panda"), np.random.default_rng(7)
    for item, given in ITEMS[class_name](machine):
        weights = getattr(item, "weights", None)
        if weights is not None and class_name != "Momentum":
            assert item.row_weights(machine).tolist() == list(weights)
        if item.refusal(machine, "velocity"):
            continue
        found, (q, _, values) = numbers(item, machine), draw(machine, item, given, rng)
        for d in item.inputs(machine):
            other = found(q, values | {d.name: sample(machine, d, rng)})
            if d.rate is None and "value" in other and (class_name, d.name) not in STANDING:
                np.testing.assert_array_equal(other["value"], found(q, values)["value"], d.name)

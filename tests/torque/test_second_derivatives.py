"""Every class of the registry in a stack that commands accelerations: its rows against finite differences in time.

Robot and inputs move along v and their rates, which the accelerations of the inputs change; joints do not accelerate.
What the rows then ask for is made of the value, its rate and the rate of that, both by differences of what
tests/tasks/test_registry.py holds to Pinocchio.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import Numbers, later, numbers, sample, slope
from tests.items import ITEMS, NO_VELOCITIES
from tests.repeats import ALL, MORE
from tests.tasks.robots import NAMES, random_configuration, robot
from wbc.api import Stack
from wbc.errors import CommandError
from wbc.robot import Robot
from wbc.stack.layout import Block, Layout
from wbc.stack.program import build
from wbc.tasks import Constraint, Task, inputs as run_time

DT = 0.003


def every_item(machine: Robot) -> tuple[Stack, dict[str, Numbers], list[str]]:
    """A stack of items that have rows on accelerations, what they are alone, and classes that refuse.

    Declarations are shared out among the arms, whose expressions are small; the humanoid has the first of every class,
    and with ``REPEATS=3`` so has every arm.
    """
    stack, alone, refused, turn = Stack(machine, dt=DT), {}, [], NAMES.index(machine.name)
    for class_name, factory in ITEMS.items():
        for k, (item, _) in enumerate(factory(machine)):
            mine = (k + zlib.crc32(class_name.encode())) % (len(NAMES) - 1) == turn
            if not (mine or (k == 0 and (machine.name == NAMES[-1] or MORE >= ALL))):
                continue
            if item.refusal(machine, "acceleration"):
                refused.append(class_name)
            elif (isinstance(item, Constraint) and item.form == "bounds") or class_name == "Mechanism":
                continue
            else:
                name = f"{class_name} {k}"
                stack.add(item, name=name)
                alone[name] = numbers(item, machine)
    return stack, alone, refused


def draw(machine: Robot, block: Block, given: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Values of all inputs; rates of what may not leave its range are small."""
    values = {name: sample(machine, slot.input, rng) for name, slot in block.slots.items()} | given
    for name, slot in block.slots.items():
        if slot.input.direction and slot.input.rate is not None:
            # the derivative of a unit vector is across it
            values[slot.input.rate] = np.cross(values[name], values[slot.input.rate])
    return values | {"rate": 7.0} if "rate" in block.slots and block.form != "task" else values


def moved(found: Numbers, block: Block, values: dict[str, Any], time: float) -> dict[str, Any]:
    """The inputs at another time, and their rates with the accelerations that the stack has for them."""
    out = later(found.robot, found.item, values, time)
    for slot in block.slots.values():
        acceleration = slot.input.rate
        rates = {d.rate for d in found.declared}
        if slot.input.name in rates and acceleration is not None:
            change = np.asarray(values[acceleration])
            for d in found.declared:
                if d.direction and d.rate == slot.input.name:
                    change = change - np.sum(np.square(values[d.rate])) * np.asarray(values[d.name])
            out[slot.input.name] = values[slot.input.name] + time * change
    return out


def check(found: Numbers, block: Block, values: dict[str, Any], q: np.ndarray, v: np.ndarray, got: Any) -> None:
    """Rows of one block."""

    def at(time: float) -> dict[str, np.ndarray]:
        here = pin.integrate(found.robot.model, q, time * v)
        return found(here, {d.name: value for d in found.declared for value in [there(time)[d.name]]}, v)

    def there(time: float) -> dict[str, Any]:
        return moved(found, block, values, time)

    here = at(0.0)
    if "value" in here:
        rate = here["jacobian"] @ v + here["drift"]
        second = slope(lambda t: at(t)["jacobian"] @ v + at(t)["drift"], 3e-4)
        value, matrix = here["value"], here["jacobian"]
    else:
        matrix, ends = here["matrix"], (here["lower"], here["upper"])
    if block.form == "task" and "omega" in values:
        omega, gain = values["omega"], values["gain"]
        wanted = [omega * (values["feedforward"] - gain * (value + rate / omega) - rate) - second]
    elif block.form == "task":
        wanted = [-values["stiffness"] * value - values["damping"] * rate - second]
    elif block.form == "margins":
        k = values["rate"]
        wanted = [-second - k * (2 * rate + k * value) / (1 + 0.5 * k * DT)]
    else:
        k, speed = values["rate"], slope(lambda t: at(t)["matrix"] @ v, 3e-4)
        moving = [slope(lambda t, name=name: at(t)[name], 3e-4) for name in ("lower", "upper")]
        wanted = [m - speed - k * (matrix @ v - end) for m, end in zip(moving, ends, strict=True)]
    for a, b in zip(got, [matrix, *wanted], strict=True):
        finite = np.isfinite(b)
        assert (np.isfinite(a) == finite).all(), block.entry.name
        scale = max(1.0, float(np.abs(b[finite]).max(initial=0.0)))
        assert float(np.abs(a[finite] - b[finite]).max(initial=0.0)) <= 2e-6 * scale, block.entry.name


@pytest.mark.parametrize("robot_name", NAMES)
def test_rows_of_every_class(robot_name: str) -> None:
    machine = robot(robot_name)
    stack, alone, refused = every_item(machine)
    declared = stack.commanding("acceleration")
    layout = Layout(declared)
    rows = build(declared, layout).rows
    rng = np.random.default_rng(zlib.crc32(robot_name.encode()))
    given = {f"{c} {k}": extra for c, f in ITEMS.items() for k, (_, extra) in enumerate(f(machine))}
    q, v = random_configuration(machine, rng), rng.uniform(-1.0, 1.0, machine.nv)
    p, drawn = np.zeros(layout.parameters), {}
    for name in alone:
        block = layout.blocks[name]
        values = drawn[name] = draw(machine, block, given[name], rng)
        for key, slot in block.slots.items():
            p[slot.span] = run_time.flat(machine, key, slot.input, values[key])
    out = {n: np.array(m) for n, m in zip(rows.name_out(), rows(q, v, p, DT), strict=True)}
    for name, found in alone.items():
        block = layout.blocks[name]
        if block.form == "task":
            got = out["jt"].T[block.span], out["desired"][block.span, 0]
        elif block.form == "margins":
            got = out["at"].T[block.span], out["low"][block.span, 0]
        else:
            got = out["at"].T[block.span], out["low"][block.span, 0], out["high"][block.span, 0]
        check(found, block, drawn[name], q, v, got)
    assert len(alone) > (20 if robot_name == "talos" else 25)
    # nothing that is left out is left out silently
    assert set(refused) <= {"SelfCollision", "Obstacle"} | NO_VELOCITIES - {"DivergentComponent"}


def test_what_has_no_second_derivative_says_so() -> None:
    machine = robot("panda")
    for class_name, factory in ITEMS.items():
        for item, _ in factory(machine):
            stack = Stack(machine, dt=DT).add(item, name="it")
            for command in ("acceleration", "torque"):
                reason = item.refusal(machine, command)
                if reason:
                    with pytest.raises(CommandError, match=reason[:20]):
                        stack.commanding(command)
                elif class_name != "WrenchSum":
                    assert stack.commanding(command).command == command, class_name
    tracked = Stack(machine, dt=DT).add(ITEMS["EndEffector"](machine)[0][0], scaled=True)
    with pytest.raises(CommandError, match="direction"):
        tracked.commanding("acceleration")


def test_tasks_of_the_registry_are_all_there() -> None:
    machine = robot("panda")
    for factory in ITEMS.values():
        item = factory(machine)[0][0]
        if isinstance(item, Task):
            assert not item.refusal(machine, "acceleration")
            assert not item.refusal(machine, "torque")

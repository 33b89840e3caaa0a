"""The seam to a robot: what fits a loop, what is refused, bad readings, and that only plants integrate."""

from __future__ import annotations

import ast
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.project.layout import ROOT, nodes, relative, sources
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.robot import Robot
from wbc.simulation import (
    Command,
    CommandKind,
    Connection,
    KinematicPlant,
    PinocchioPlant,
    Plant,
    PlantError,
    PlantState,
    VelocityDrive,
)


@pytest.fixture(scope="module", params=["panda", "talos"])
def robot(request: pytest.FixtureRequest) -> Robot:
    return wbc.robots.load(request.param)


def test_a_kinematic_plant_integrates_on_the_manifold(robot: Robot) -> None:
    plant: Plant = KinematicPlant(robot)
    connection, generator = Connection(plant, robot, 0.01), np.random.default_rng(0)
    state = connection.reset(robot.neutral, 3.0)
    q = robot.neutral.copy()
    assert (state.q == q).all()
    assert not state.v.any()
    for k in range(20):
        v = generator.uniform(-1.0, 1.0, robot.nv)
        state = connection.drive(v)
        q = pin.integrate(robot.model, q, v * 0.01)
        assert (state.q == q).all()
        assert (state.v == v).all()
        assert state.time == pytest.approx(3.0 + 0.01 * (k + 1))
    connection.rest()
    assert (plant.read().q == q).all()
    plant.advance(0.01)
    assert (plant.read().q == q).all()


@pytest.mark.parametrize(
    "make", [KinematicPlant, PinocchioPlant, lambda robot: VelocityDrive(robot, PinocchioPlant(robot))]
)
def test_what_a_plant_cannot_do_is_refused_and_changes_nothing(make: Callable[[Robot], Plant]) -> None:
    arm = wbc.robots.load("panda")
    plants = [make(arm), make(arm)]
    good, other = plants[0].commands, set(CommandKind).difference(plants[0].commands)
    for plant in plants:
        plant.reset(arm.neutral, 0.0)
        plant.apply(Command(next(iter(good)), np.full(arm.nv, 0.1)))
    refused = [
        (np.zeros(arm.nv), ShapeError, "command"),
        *((Command(kind, np.ones(arm.nv)), UnknownNameError, "command.kind") for kind in other),
        (Command(next(iter(good)), np.full(arm.nv, np.nan)), NotFiniteError, "command.values"),
        (Command(next(iter(good)), np.zeros(3)), ShapeError, "command.values"),
    ]
    for command, error, field in refused:
        with pytest.raises(error) as caught:
            plants[0].apply(command)  # type: ignore[arg-type]  # an array is none
        assert caught.value.field == field
    for plant in plants:
        plant.advance(0.01)
    assert np.array_equal(plants[0].read().q, plants[1].read().q)


@pytest.mark.parametrize(
    ("change", "error", "match"),
    [
        ({"nq": 3}, ShapeError, "plant.nq"),
        ({"nv": 3}, ShapeError, "plant.nv"),
        ({"time_step": 0.003}, RangeError, "divides the control period of 0.01 s"),
        ({"time_step": 0.02}, RangeError, "plant.time_step"),
        ({"time_step": -1.0}, RangeError, "plant.time_step"),
        ({"commands": (CommandKind.TORQUE,)}, RangeError, "takes|velocities"),
    ],
)
def test_a_plant_that_does_not_fit_is_refused_by_name(change: dict, error: type[WbcError], match: str) -> None:  # type: ignore[type-arg]
    robot = wbc.robots.load("panda")
    plant = KinematicPlant(robot)
    for name, value in change.items():
        setattr(plant, name, value)
    with pytest.raises(error, match=match):
        Connection(plant, robot, 0.01)


class Always(KinematicPlant):
    """A class that has all members itself."""

    nq, nv = 9, 9


def test_what_is_no_plant_is_refused() -> None:
    robot = wbc.robots.load("panda")
    with pytest.raises(ShapeError, match="it has no nq, nv"):
        Connection(object(), robot, 0.01)  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="not the class"):
        Connection(Always, robot, 0.01)  # type: ignore[arg-type]


@pytest.mark.parametrize("step", [0.0, 0.01, 0.0005, 1.0 / 3000.0])
def test_steps_that_divide_the_period_fit(step: float) -> None:
    robot = wbc.robots.load("panda")
    plant = KinematicPlant(robot)
    plant.time_step = step
    Connection(plant, robot, 0.01)


class Broken(KinematicPlant):
    """Says what it is told to say."""

    def __init__(self, robot: Robot, said: object) -> None:
        super().__init__(robot)
        self.said, self.last = said, np.ones(robot.nv)

    def read(self) -> PlantState:
        if isinstance(self.said, Exception):
            raise self.said
        return self.said  # type: ignore[return-value]

    def apply(self, command: Command) -> None:
        self.last = command.values


@pytest.mark.parametrize("what", ["invalid", "nan", "short", "list", "time", "back", "none"])
def test_a_reading_that_is_none_commands_rest(what: str) -> None:
    robot = wbc.robots.load("panda")
    q, v = robot.neutral, np.zeros(robot.nv)
    said = {
        "invalid": PlantState(q, v, 0.0, valid=False),
        "nan": PlantState(q, np.full(robot.nv, np.nan), 0.0),
        "short": PlantState(q[:-1], v, 0.0),
        "list": PlantState(q.tolist(), v, 0.0),  # type: ignore[arg-type]
        "time": PlantState(q, v, np.inf),
        "back": PlantState(q, v, -0.01),
        "none": None,
    }[what]
    plant = Broken(robot, PlantState(q, v, 0.0))
    connection = Connection(plant, robot, 0.01)
    connection.reset(q)
    plant.said = said
    with pytest.raises(PlantError, match=r"plant\.state"):
        connection.drive(np.ones(robot.nv))
    assert not plant.last.any()
    plant.said = OSError("the line is dead")
    with pytest.raises(PlantError, match="the line is dead"):
        connection.drive(np.ones(robot.nv))


def test_a_plant_that_writes_into_its_arrays_does_not_change_what_was_read() -> None:
    robot = wbc.robots.load("panda")
    plant = Broken(robot, PlantState(robot.neutral.copy(), np.zeros(robot.nv), 0.0))
    state = Connection(plant, robot, 0.01).reset(robot.neutral)
    plant.said.q[:] = 7.0  # type: ignore[attr-defined]
    assert (state.q == robot.neutral).all()


LOOPS = ("wbc/track", "wbc/teleop")


@pytest.mark.parametrize("folder", LOOPS)
def test_no_loop_integrates_rates(folder: str) -> None:
    files = [path for path in sources("wbc") if relative(path).startswith(f"{folder}/")]
    assert files, ROOT
    found = [
        f"{relative(path)}:{node.lineno}"
        for path in files
        for node in nodes(path)
        if isinstance(node, ast.Attribute) and node.attr in ("integrate", "difference")
    ]
    assert found == []

"""One walk over the registry: every derivative of every shipped class against finite differences, on four robots.

Rows that are not the derivative of a value (damping, velocity limits, holds, the rate of a pitch plane) are
held to Pinocchio's velocities instead. A class without a factory, or without its check, fails.
"""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.constraints.items_forces import NO_VELOCITIES, TILTED
from tests.evaluation import Numbers, later, numbers, sample, slope
from tests.repeats import repeats
from tests.tasks.items import FACTORIES
from tests.tasks.items_coordination import RATES as COORDINATION
from tests.tasks.items_pointing import RATES as POINTING
from tests.tasks.robots import NAMES, placement, random_configuration, robot, velocity
from wbc.robot import Robot
from wbc.tasks import (
    Damping,
    FrameVelocityLimit,
    Hold,
    Item,
    LineContact,
    Mechanism,
    PitchPlane,
    PointContact,
    RigidGrasp,
    RollingContact,
    SlidingContact,
    SurfaceContact,
    Task,
    registry,
)
from wbc.tasks.rolling import FLAT

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


def relative_twist(robot: Robot, frame: str, base: str, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Twist of a frame as seen from a moving base, at the frame's origin, world axes."""
    own, carrier = velocity(robot, frame, q, v), velocity(robot, base, q, v)
    arm = placement(robot, frame, q).translation - placement(robot, base, q).translation
    return own - np.concatenate([carrier[:3] + np.cross(carrier[3:], arm), carrier[3:]])


def damping(item: Damping, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return v


def frame_velocity(item: FrameVelocityLimit, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    twist = relative_twist(robot, item.frame, item.relative_to, q, v)
    turn = placement(robot, item.axes, q).rotation.T
    seen = np.concatenate([turn @ twist[:3], turn @ twist[3:]])
    labels = ("x", "y", "z", "rx", "ry", "rz")
    return np.array([seen[labels.index(row.label)] for row in item.rows(robot)])


def hold(item: Hold, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    twist = velocity(robot, item.frame, q, v)
    if item.kind == "axis":
        return np.concatenate([twist[:3], (placement(robot, item.frame, q).rotation.T @ twist[3:])[:2]])
    return {"pose": twist, "position": twist[:3], "orientation": twist[3:]}[item.kind]


def line(item: LineContact, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    twist = velocity(robot, item.frame, q, v)
    return np.concatenate([twist[:3], (placement(robot, item.frame, q).rotation.T @ twist[3:])[1:]])


def sliding(item: SlidingContact, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.array([TILTED.rotation[:, 2] @ velocity(robot, item.frame, q, v)[:3]])


def rolling(item: RollingContact, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Velocity of the wheel's material at the point of its rim that is nearest to the ground's plane, downwards."""
    pose, twist, normal = placement(robot, item.frame, q), velocity(robot, item.frame, q, v), TILTED.rotation[:, 2]
    axis = pose.rotation @ np.array(item.axis)
    ends = np.linalg.svd(axis[None])[2][1:]
    angle = np.arctan2(ends[1] @ normal, ends[0] @ normal)
    length = np.hypot(ends[0] @ normal, ends[1] @ normal)
    up = (np.cos(angle) * ends[0] + np.sin(angle) * ends[1]) * length / np.hypot(length, FLAT)
    slip = twist[:3] + np.cross(twist[3:], -item.radius * up)
    along = np.cross(axis, up)
    return np.array([along @ slip, np.cross(normal, along) @ slip, normal @ slip])


def contact(item: RigidGrasp, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return velocity(robot, item.frame, q, v)[: item.components]


def mechanism(item: Mechanism, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    mimics = [v[c.follower] - c.ratio * v[c.leader] for c in robot.couplings]
    return np.array(mimics + [v[i] for i in robot.locked_dofs])


def plane_rate(item: PitchPlane, robot: Robot, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Angular velocity of the body that carries the axis, along the line between the offset pitch axes."""
    model, data = robot.model, robot.model.createData()
    pin.forwardKinematics(model, data, q, v)
    joint = model.getJointId(item.axis)
    local = np.array(pin.getJointJacobian(model, pin_jacobians(model, q), joint, pin.WORLD))[3:, robot.dofs(item.axis)]
    axis = local[:, 0]
    spin = pin.getVelocity(model, data, model.parents[joint], pin.WORLD).angular
    line = placement(robot, item.wrist, q).translation - placement(robot, item.shoulder, q).translation
    line = line - axis * (axis @ line)
    return np.array([spin @ line / np.linalg.norm(line)])


def pin_jacobians(model: pin.Model, q: np.ndarray) -> pin.Data:
    data = model.createData()
    pin.computeJointJacobians(model, data, q)
    return data


#: What the rows times v are, where they are not the derivative of a value.
RATES = {
    Damping: damping,
    FrameVelocityLimit: frame_velocity,
    Hold: hold,
    RigidGrasp: contact,
    PointContact: contact,
    LineContact: line,
    SlidingContact: sliding,
    RollingContact: rolling,
    SurfaceContact: contact,
    Mechanism: mechanism,
    PitchPlane: plane_rate,
    **POINTING,
    **COORDINATION,
}


def test_every_shipped_class_has_a_factory_and_is_exported() -> None:
    import wbc.tasks

    assert set(SHIPPED) == set(FACTORIES)
    assert set(SHIPPED) <= set(wbc.tasks.__all__)


def own_rows(item: Item) -> bool:
    """Whether a task gives its own rows (damping and pointing always, a pitch plane in one of its forms)."""
    return isinstance(item, (Damping, *POINTING)) or (isinstance(item, PitchPlane) and item.commands_rate)


@pytest.mark.parametrize("robot_name", NAMES)
@pytest.mark.parametrize("class_name", SHIPPED)
def test_rows_are_what_the_class_says(class_name: str, robot_name: str) -> None:
    machine = robot(robot_name)
    rng = np.random.default_rng(zlib.crc32(f"{class_name} {robot_name}".encode()))
    for item, given in FACTORIES[class_name](machine):
        if item.refusal(machine, "velocity"):
            # torques and forces have no rows on velocities: tests/torque
            assert class_name in NO_VELOCITIES
            continue
        found = numbers(item, machine)
        for _ in range(STATES):
            q, v, values = draw(machine, item, given, rng)
            here = found(q, values, v)
            assert all(np.isfinite(x).all() or name in ("lower", "upper") for name, x in here.items())
            if isinstance(item, Task) and own_rows(item):
                close(here["jacobian"] @ v, RATES[type(item)](item, machine, q, v))
            elif "value" in here:
                check_derivatives(found, q, values)
            elif "matrix" in here:
                close(here["matrix"] @ v, RATES[type(item)](item, machine, q, v), 1e-12)
                assert (here["lower"] <= here["upper"]).all()
            else:
                assert here["lower"].shape == here["upper"].shape == (machine.nv,)
                assert (here["lower"] <= here["upper"]).all()


@pytest.mark.parametrize("class_name", SHIPPED)
def test_declaration_is_plain_deterministic_and_tells_items_apart(class_name: str) -> None:
    machine = robot("panda")
    keys = [repr(item.declaration(machine)) for item, _ in FACTORIES[class_name](machine)]
    assert keys == [repr(item.declaration(machine)) for item, _ in FACTORIES[class_name](machine)]
    assert len(set(keys)) == len(keys)


@pytest.mark.parametrize("class_name", SHIPPED)
def test_first_value_of_an_input_without_default_is_where_the_robot_is(class_name: str) -> None:
    machine = robot("kinova")
    q = random_configuration(machine, np.random.default_rng(3))
    for item, _ in FACTORIES[class_name](machine):
        if item.refusal(machine, "velocity"):
            continue
        initial = item.initial(machine, q)
        values = {d.name: initial[d.name] if d.default is None else d.default for d in item.inputs(machine)}
        here = numbers(item, machine)(q, values)
        if isinstance(item, Task) and any(d.default is None for d in item.inputs(machine)):
            assert np.abs(here["value"]).max() < 1e-12

"""Each task's error at random states, computed again with Pinocchio and numpy and not with our expressions."""

from __future__ import annotations

import zlib

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

from tests.evaluation import numbers, slope
from tests.models import placement
from tests.tasks.robots import FRAMES, random_configuration, robot
from wbc.robot import Robot
from wbc.symbolic import Kinematics, Tracer
from wbc.tasks import EndEffector, Posture, inputs as run_time

STATES = 2


def states(name: str) -> tuple[Robot, list[np.ndarray], np.random.Generator]:
    machine, rng = robot(name), np.random.default_rng(zlib.crc32(name.encode()))
    return machine, [random_configuration(machine, rng) for _ in range(STATES)], rng


@pytest.mark.parametrize("short", [0.0, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("axes", ["world", "frame"])
@pytest.mark.parametrize("name", ["panda", "talos"])
def test_end_effector_at_and_near_half_a_turn(name: str, axes: str, short: float) -> None:
    machine, configurations, rng = states(name)
    frame = FRAMES[name].tip
    found = numbers(EndEffector(frame, kind="orientation", axes=axes), machine)
    for q in configurations:
        rotation = placement(machine, frame, q).rotation
        for axis in [*np.eye(3), *-np.eye(3), *rng.normal(size=(3, 3))]:
            unit = axis / np.linalg.norm(axis)
            target = pin.exp3(-(np.pi - short) * unit) @ rotation
            here = found(q, {"target": target, "feedforward": np.zeros(3)})
            error = here["value"] if axes == "world" else rotation @ here["value"]
            assert np.isfinite(here["jacobian"]).all()
            # A rotation matrix stores the angle to half a turn no better than rounding allows
            np.testing.assert_allclose(np.linalg.norm(error), np.pi - short, rtol=0, atol=1e-7)
            np.testing.assert_allclose(pin.exp3(error) @ target, rotation, rtol=0, atol=1e-12)
            if short >= 1e-6:
                np.testing.assert_allclose(error, (np.pi - short) * unit, rtol=0, atol=1e-8)


def test_end_effector_derivative_holds_up_to_half_a_turn() -> None:
    machine, frame = robot("panda"), FRAMES["panda"].tip
    found = numbers(EndEffector(frame), machine)
    rng = np.random.default_rng(5)
    for angle in (0.0, 1e-9, 1e-5, 1e-2, 1.0, 3.0, np.pi - 1e-2):
        q = random_configuration(machine, rng)
        pose = placement(machine, frame, q)
        axis = rng.normal(size=3)
        away = pin.SE3(pin.exp3(angle * axis / np.linalg.norm(axis)), rng.normal(size=3))
        values = {"target": pin.SE3(away.rotation @ pose.rotation, away.translation), "feedforward": np.zeros(6)}
        v = rng.uniform(-1, 1, machine.nv)
        wanted = slope(lambda t, q=q, v=v, given=values: found(pin.integrate(machine.model, q, t * v), given)["value"])
        np.testing.assert_allclose(found(q, values)["jacobian"] @ v, wanted, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("item", "limit"),
    [
        (EndEffector("panda_hand_tcp"), 760),
        (EndEffector("panda_hand_tcp", axes="frame"), 1000),
        (EndEffector("panda_hand_tcp", relative_to="panda_link2"), 950),
        (EndEffector("panda_hand_tcp", kind="position"), 350),
        (Posture(), 45),
    ],
)
def test_error_and_jacobian_stay_small(item: EndEffector, limit: int) -> None:
    """Instructions of value and Jacobian together; whole-chain differentiation of the first takes 2329."""
    machine = robot("panda")
    kinematics = Kinematics(machine.model)
    tracer, symbols = Tracer(kinematics), run_time.symbols(machine, item.inputs(machine))
    error = item.error(machine, tracer, symbols.values)
    outputs = ca.cse([tracer.expand(error), tracer.jacobian(error)])
    count = ca.Function("size", [kinematics.q, symbols.vector], outputs).n_instructions()
    print(count)
    assert count <= limit

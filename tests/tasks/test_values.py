"""Each task's error at random states, computed again with Pinocchio and numpy and not with our expressions."""

from __future__ import annotations

import zlib

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from tests.evaluation import numbers, slope
from tests.models import placement
from tests.random_robots import random_pose
from tests.tasks.robots import FRAMES, NAMES, random_configuration, robot
from wbc.robot import Robot
from wbc.symbolic import Kinematics, Tracer
from wbc.tasks import CenterOfMass, Elbow, EndEffector, Posture, inputs as run_time

STATES = 2


def states(name: str) -> tuple[Robot, list[np.ndarray], np.random.Generator]:
    machine, rng = robot(name), np.random.default_rng(zlib.crc32(name.encode()))
    return machine, [random_configuration(machine, rng) for _ in range(STATES)], rng


def rotation_vector(rotation: np.ndarray) -> np.ndarray:
    """Scipy's logarithm: a third implementation, reliable up to pi."""
    return Rotation.from_matrix(rotation).as_rotvec()


def axes_of(machine: Robot, axes: str, frame: str, base: str, q: np.ndarray) -> np.ndarray:
    chosen = {"frame": frame, "reference": base}.get(axes, axes)
    return placement(machine, chosen, q).rotation


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("axes", ["reference", "world", "frame", "middle"])
@pytest.mark.parametrize("relative", [False, True])
def test_end_effector_is_the_decoupled_pose_error(name: str, axes: str, relative: bool) -> None:
    machine, configurations, rng = states(name)
    f = FRAMES[name]
    base, along = (f.base if relative else "world"), (f.middle if axes == "middle" else axes)
    found = {
        kind: numbers(EndEffector(f.tip, kind=kind, relative_to=base, axes=along), machine)
        for kind in ("pose", "position", "orientation")
    }
    for q in configurations:
        target, pose = random_pose(rng), placement(machine, f.tip, q)
        desired = placement(machine, base, q) * target
        turn = axes_of(machine, along, f.tip, base, q).T
        position = turn @ (pose.translation - desired.translation)
        rotation = turn @ rotation_vector(pose.rotation @ desired.rotation.T)
        still = {"pose": np.zeros(6), "position": np.zeros(3), "orientation": np.zeros(3)}
        given = {"pose": target, "position": target.translation, "orientation": target.rotation}
        wanted = {"pose": np.concatenate([position, rotation]), "position": position, "orientation": rotation}
        for kind, function in found.items():
            got = function(q, {"target": given[kind], "feedforward": still[kind]})["value"]
            np.testing.assert_allclose(got, wanted[kind], rtol=0, atol=1e-12)


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


@pytest.mark.parametrize("name", NAMES)
def test_elbow_and_centre_of_mass_in_the_axes_of_another_frame(name: str) -> None:
    """In those of the world and in the elbow's own the closed loops see them decay."""
    machine, configurations, rng = states(name)
    f, offset, data = FRAMES[name], rng.uniform(-0.3, 0.3, 3), machine.model.createData()
    elbow = numbers(Elbow(f.middle, offset=offset, axes=f.tip), machine)
    center = numbers(CenterOfMass(axes=f.tip), machine)
    for q in configurations:
        values = {"target": rng.uniform(-1, 1, 3), "feedforward": np.zeros(3)}
        turn = placement(machine, f.tip, q).rotation.T
        point = placement(machine, f.middle, q).act(offset)
        mean = pin.centerOfMass(machine.model, data, q)
        for found, wanted in ((elbow, point), (center, mean)):
            got = found(q, values)["value"]
            np.testing.assert_allclose(got, turn @ (wanted - values["target"]), rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_posture_is_the_difference_on_the_manifold(name: str) -> None:
    machine, configurations, rng = states(name)
    last, first = machine.joint_names[-1], machine.joint_names[0]
    chosen = (last, first)
    found, whole = numbers(Posture(chosen), machine), numbers(Posture(), machine)
    picked = np.r_[machine.dofs(last), machine.dofs(first)]
    rest = slice(6 if machine.base == "floating" else 0, machine.nv)
    for q in configurations:
        target = pin.integrate(machine.model, q, rng.uniform(-2.0, 2.0, machine.nv))
        wanted = pin.difference(machine.model, target, q)
        values = {"target": target, "feedforward": np.zeros(machine.nv)}
        np.testing.assert_allclose(found(q, values)["value"], wanted[picked], rtol=0, atol=1e-11)
        np.testing.assert_allclose(whole(q, values)["value"], wanted[rest], rtol=0, atol=1e-11)


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

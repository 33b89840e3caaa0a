"""Two hands, coupled joints and manipulability: values, symmetry, singular configurations, bad input."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.evaluation import numbers, sample, slope
from tests.models import X, Z, arm, placement, robot as bare
from tests.tasks.robots import FRAMES, random_configuration, robot
from wbc.errors import RangeError, UnknownNameError
from wbc.robot import Robot
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.manipulability import FLOOR, manipulability, manipulability_curvature
from wbc.tasks import EndEffector, Expression, Item, JointCoupling, Limit, Manipulability, Posture, RelativePose

HAND, OTHER = "panda_hand", "panda_link4"


def drawn(item: Item, machine: Robot, seed: int) -> tuple[np.ndarray, dict[str, Any]]:
    rng = np.random.default_rng(seed)
    return random_configuration(machine, rng), {d.name: sample(machine, d, rng) for d in item.inputs(machine)}


def test_default_point_is_halfway_between_the_hands_and_may_be_declared() -> None:
    machine, q = robot("panda"), drawn(Posture(), robot("panda"), 1)[0]
    item = RelativePose(OTHER, HAND)
    initial = item.initial(machine, q)
    between = (placement(machine, OTHER, q).translation + placement(machine, HAND, q).translation) / 2
    assert placement(machine, OTHER, q).act(initial["at"]) == pytest.approx(between, abs=1e-12)
    fixed = replace(item, at=(1, 2, 3))
    assert [d.default for d in fixed.inputs(machine) if d.name == "at"] == [(1.0, 2.0, 3.0)]
    assert fixed.declaration(machine) == item.declaration(machine)


def test_coupling_of_unbounded_joints_is_an_angle() -> None:
    machine = robot("kinova")
    a, b = "j2s6s200_joint_1", "j2s6s200_joint_2"
    item = JointCoupling([{a: 2, b: -0.5}, {b: 1}])
    found = numbers(item, machine)
    for turn in (-2.9, 0.4, 2.9):
        q = machine.neutral.copy()
        q[0:2], q[2] = (np.cos(turn), np.sin(turn)), 7.0
        e = found(q, {"target": np.array([1.0, 1.0]), "feedforward": np.zeros(2)})
        plain = 2 * turn - 0.5 * 7.0 - 1.0
        assert e["value"][0] == pytest.approx(np.arctan2(np.sin(plain), np.cos(plain)), abs=1e-12)
        assert e["value"][1] == pytest.approx(6.0, abs=1e-12)
        assert e["jacobian"] == pytest.approx(np.array([[2, -0.5, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0]]), abs=1e-12)
    assert [(row.label, row.unit) for row in item.rows(machine)] == [(f"2 {a} - 0.5 {b}", "rad"), (b, "rad")]


def test_coupling_starts_where_it_is_told() -> None:
    machine = robot("panda")
    relation = {"panda_joint1": 1, "panda_joint2": -2}
    q = drawn(Posture(), machine, 2)[0]
    assert JointCoupling(relation).inputs(machine)[0].default == (0.0,)
    assert JointCoupling([relation, relation], target=(1, 2)).inputs(machine)[0].default == (1.0, 2.0)
    staying = JointCoupling(relation, target=None)
    assert staying.inputs(machine)[0].default is None
    assert staying.initial(machine, q)["target"] == pytest.approx([q[0] - 2 * q[1]], abs=1e-12)
    assert replace(staying, target=3.0) == JointCoupling(relation, target=3.0)


def test_singular_configurations_have_a_value_and_no_slope() -> None:
    """Stretched out, wrist aligned, and every column the same: no NaN, and the floor."""
    machine = arm("planar", [(Z, (1.0, 0.0, 0.0)), (Z, (1.0, 0.0, 0.0))])
    item = Manipulability("tip", along=("x", "y"), length=1.0)
    for form in ("linear", "log"):
        found = numbers(replace(item, form=form), machine)
        stretched = found(np.zeros(2), {"target": 0.5, "feedforward": 0.0})
        w = np.sqrt(5.0 + FLOOR**2) * FLOOR
        assert stretched["value"][0] == pytest.approx(np.log(w / 0.5) if form == "log" else w - 0.5, rel=1e-9)
        assert stretched["jacobian"] == pytest.approx(np.zeros((1, 2)), abs=1e-9)
        beside = found(np.array([0.0, 1e-3]), {"target": 0.5, "feedforward": 0.0})
        assert np.isfinite(beside["jacobian"]).all()
    for q2 in (0.3, 1.2, -2.0):
        assert item.value(machine, np.array([0.7, q2])) == pytest.approx(abs(np.sin(q2)), rel=1e-3)


def odd_robot() -> Robot:
    """A chain of joints whose motion is not constant in their child."""
    model, place = pin.Model(), pin.SE3(pin.exp3(np.array([0.1, 0.2, 0.3])), np.array([0.1, 0.3, 0.2]))
    composite = pin.JointModelComposite(pin.JointModelRX(), place)
    composite.addJoint(pin.JointModelPZ(), place)
    composite.addJoint(pin.JointModelRY(), place)
    universal = pin.JointModelUniversal(np.array(X), np.array([0.0, 1.0, 0.0]))
    joints = [pin.JointModelSphericalZYX(), universal, pin.JointModelSpherical(), composite, pin.JointModelPlanar()]
    last = 0
    for k, joint in enumerate(joints):
        last = model.addJoint(last, joint, place, f"joint{k}")
        model.addFrame(pin.Frame(f"frame{k}", last, 0, place, pin.FrameType.OP_FRAME))
    return bare("odd", model)


@pytest.mark.parametrize(("frame", "base"), [("frame4", "world"), ("frame4", "frame1"), ("frame1", "frame4")])
@pytest.mark.parametrize("along", [("x", "y", "z"), ("y", "rx")])
def test_slope_on_joints_of_every_kind(frame: str, base: str, along: tuple[str, ...]) -> None:
    machine = odd_robot()
    item = Manipulability(frame, along=along, relative_to=base, length=0.5)
    found = numbers(item, machine)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        q = pin.integrate(machine.model, machine.neutral, rng.uniform(-1, 1, machine.nv))
        direction = rng.uniform(-1, 1, machine.nv)
        row = found(q, {"target": 1.0, "feedforward": 0.0})["jacobian"]
        along_it = slope(lambda t, q=q, d=direction: item.value(machine, pin.integrate(machine.model, q, t * d)))
        assert float(row[0] @ direction) == pytest.approx(along_it, rel=1e-6, abs=1e-7)


def test_slope_costs_less_than_automatic_differentiation() -> None:
    kinematics = Kinematics(robot("talos").model)
    tip = FRAMES["talos"].tip
    w, row = manipulability(kinematics, tip, "torso_2_link", range(6), 1.0)
    counts = [
        ca.Function("w", [kinematics.q], ca.cse([w, slopes])).n_instructions()
        for slopes in (row, kinematics.derivative(w))
    ]
    assert counts[0] < 1700
    assert counts[0] < 0.75 * counts[1]
    bound = ca.diag(manipulability_curvature(kinematics, tip, "torso_2_link", 2.0))
    assert np.count_nonzero(np.array(ca.DM(bound))) == 7


def test_manipulability_in_a_limit_and_in_an_expression() -> None:
    machine, tip = wbc.robots.load("panda", shapes="none"), "panda_hand_tcp"
    item = Manipulability(tip, kind="position")
    stack = wbc.Stack(machine, 0.01)
    own = Expression(
        lambda kin, p: kin.manipulability(tip, "world", (0, 1, 2), machine.characteristic_length), units="1"
    )
    stack.add(Limit(item, lower=0.1), name="agile").add(own, name="own").add(EndEffector(tip, kind="position"))
    controller = stack.compile(backend="vm")
    controller["agile"].target, controller["own"].enabled = FLOOR**3, False
    controller.reset(machine.neutral)
    goal = controller["end_effector"].target + np.array([0.6, 0.0, 0.2])

    def least(guarded: bool) -> float:
        controller["agile"].enabled, q = guarded, machine.neutral
        controller.reset(q)
        controller["end_effector"].target = goal
        found = np.inf
        for _ in range(300):
            q = pin.integrate(machine.model, q, controller.step(q).v * 0.01)
            found = min(found, item.value(machine, q))
        return float(found)

    assert least(guarded=False) < 0.08
    assert 0.0999 < least(guarded=True) < 0.103
    q = random_configuration(machine, np.random.default_rng(4))
    assert numbers(own, machine)(q, {})["value"][0] == pytest.approx(item.value(machine, q), rel=1e-10)


def test_joints_that_no_relation_can_have() -> None:
    uneven = JointCoupling({"j2s6s200_joint_1": 0.5, "j2s6s200_joint_2": 1})
    with pytest.raises(RangeError, match="must be whole"):
        uneven.validate(robot("kinova"))
    with pytest.raises(UnknownNameError, match="root_joint"):
        JointCoupling({"root_joint": 1}).validate(robot("talos"))

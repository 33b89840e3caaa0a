"""Rolling: rows against textbooks, tilted ground, wheels that lie flat, limits of wheels, bad declarations."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.evaluation import numbers
from tests.rates import touching
from tests.refusals import assert_refused
from tests.wheels import (
    CENTAURO_RADIUS,
    OMNI_ANGLES,
    OMNI_ARM,
    OMNI_RADIUS,
    PRO_AT,
    PRO_RADIUS,
    TIAGO_HALF_TRACK,
    TIAGO_RADIUS,
    vehicle,
)
from wbc.errors import DuplicateNameError, NotFiniteError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.robot import Limits, Robot
from wbc.tasks import EndEffector, JointLimits, Posture, Rolling, SacrificeOrder, Wheel

LEVEL = {"ground": pin.SE3.Identity()}


def turns(rows: np.ndarray, robot: Robot, item: Rolling, twist: np.ndarray) -> np.ndarray:
    """Speeds of the wheels [rad/s] that the rows want for a twist of the base in its own axes."""
    wheels = [robot.dofs(wheel.joint).start for wheel in item.wheels]
    found = np.linalg.lstsq(rows[:, wheels], -rows[:, :3] @ twist, rcond=None)
    assert rows[:, wheels] @ found[0] == pytest.approx(-rows[:, :3] @ twist, abs=1e-9)
    return found[0]


def textbook(name: str, twist: np.ndarray) -> list[float]:
    """Speeds of the wheels for a twist of the base (Siegwart et al., Autonomous Mobile Robots, 2011, section 3.2)."""
    x, y, w = twist
    if name == "tiago":
        return [(x - TIAGO_HALF_TRACK * w) / TIAGO_RADIUS, (x + TIAGO_HALF_TRACK * w) / TIAGO_RADIUS]
    if name == "tiago_pro":
        k = sum(PRO_AT) * w
        return [(x - y - k) / PRO_RADIUS, (x + y + k) / PRO_RADIUS, (x + y - k) / PRO_RADIUS, (x - y + k) / PRO_RADIUS]
    return [(math.sin(a) * x - math.cos(a) * y - OMNI_ARM * w) / OMNI_RADIUS for a in OMNI_ANGLES]


@pytest.mark.parametrize("name", ["tiago", "tiago_pro", "omni"])
def test_wheels_turn_as_in_the_textbook(name: str) -> None:
    known, rng = vehicle(name), np.random.default_rng(1)
    item = Rolling(known.wheels)
    found = numbers(item, known.robot)
    for _ in range(5):
        q = pin.integrate(known.robot.model, known.robot.neutral, rng.uniform(-1, 1, known.robot.nv))
        twist = rng.uniform(-1, 1, 3) * ([1, 0, 1] if name == "tiago" else [1, 1, 1])
        here = found(q, LEVEL)
        assert turns(here["matrix"], known.robot, item, twist) == pytest.approx(textbook(name, twist), abs=1e-8)
        assert not here["lower"].any()
        assert not here["upper"].any()


def test_rows_labels_and_order() -> None:
    tiago, legs = vehicle("tiago"), vehicle("centauro")
    labels = [row.label for row in Rolling(tiago.wheels).rows(tiago.robot)]
    assert labels == [f"wheel_{side}_joint {what}" for side in ("left", "right") for what in ("rolling", "sideways")]
    assert [row.label for row in Rolling(Wheel("wheel_0", 0.1, 0.0)).rows(vehicle("omni").robot)] == ["wheel_0 roller"]
    one = Rolling(legs.wheels[0])
    assert [row.label for row in one.rows(legs.robot)] == [f"j_wheel_1 {w}" for w in ("rolling", "sideways", "contact")]
    assert len(Rolling(legs.wheels[0], contact=False).rows(legs.robot)) == 2
    assert [declared.name for declared in Rolling(tiago.wheels).inputs(tiago.robot)] == ["ground"]
    assert {row.unit for row in one.rows(legs.robot)} == {"m/s"}
    assert Rolling.order == SacrificeOrder.HOLD
    assert Rolling.equality


def test_ground_is_level_under_the_first_wheel_unless_it_is_set() -> None:
    legs, rng = vehicle("centauro"), np.random.default_rng(2)
    spread = np.where(np.arange(legs.robot.nv) < 6, 0.3, 0.05)
    q = pin.integrate(legs.robot.model, legs.robot.neutral, spread * rng.uniform(-1, 1, legs.robot.nv))
    ground = Rolling(legs.wheels).initial(legs.robot, q)["ground"]
    assert (ground.rotation == np.eye(3)).all()
    assert ground.translation[2] == pytest.approx(touching(legs.robot, legs.wheels[0], ground, q)[0][2], abs=1e-12)
    level, slope = (
        numbers(Rolling(legs.wheels), legs.robot)(q, {"gain": 0.0, "ground": pin.SE3(turn, np.zeros(3))})["matrix"]
        for turn in (np.eye(3), pin.exp3(np.array([0.2, 0.0, 0.0])))
    )
    assert np.abs(level - slope).max() > 0.01


def test_wheel_that_lies_flat_has_rows_without_nan() -> None:
    """Turned on its side the whole robot has wheels whose axes are along the normal."""
    legs = vehicle("centauro")
    q = legs.robot.neutral.copy()
    q[3:7] = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    here = numbers(Rolling(legs.wheels), legs.robot)(q, {"gain": 1.0, "ground": pin.SE3.Identity()})
    assert all(np.isfinite(part).all() for part in here.values())


def test_speed_of_the_wheels_limits_the_base() -> None:
    known = vehicle("omni")
    stack = wbc.Stack(known.robot, 0.01).add(Rolling(known.wheels)).add(JointLimits(acceleration=False))
    stack.add(EndEffector("base"), name="base")
    controller = stack.compile(backend="vm")
    q = known.robot.neutral
    controller.reset(q)
    controller["base"].target = pin.SE3(np.eye(3), np.array([10.0, 0.0, 0.0]))
    controller["base"].gain = 10.0
    step = controller.step(q)
    wheels = step.v[[known.robot.dofs(wheel.joint).start for wheel in known.wheels]]
    assert step.status == "solved"
    assert np.abs(wheels).max() == pytest.approx(20.0, abs=1e-6)
    assert wheels == pytest.approx(textbook("omni", step.v[:3]), abs=1e-6)


def skid_robot() -> Robot:
    """Four wheels, none steered, on a base that the description calls a differential drive."""
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "root_joint")
    model.addFrame(pin.Frame("base", base, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    for x in (0.3, -0.3):
        for y in (0.25, -0.25):
            place = pin.SE3(np.eye(3), np.array([x, y, 0.1]))
            model.addJoint(base, pin.JointModelRY(), place, f"wheel_{'front' if x > 0 else 'rear'}_{y > 0:d}")
    none = np.full(model.nv, np.inf)
    return Robot("skid", model, Limits(-none, none, none, none, none), base="differential", locked_dofs=(1,))


@pytest.mark.parametrize("skids", [False, True])
def test_four_fixed_wheels_turn_only_if_they_may_skid(skids: bool) -> None:
    machine = skid_robot()
    wheels = [Wheel(name, 0.1, 0.0 if skids else None) for name in machine.joint_names if name.startswith("wheel")]
    stack = wbc.Stack(machine, 0.01).add(Rolling(wheels)).add(EndEffector("base", kind="orientation"), name="base")
    stack.add(Posture(), weight=1e-6)
    controller = stack.compile(backend="vm")
    q = machine.neutral
    controller.reset(q)
    controller["base"].target = pin.exp3(np.array([0.0, 0.0, 0.5]))
    for _ in range(200):
        step = controller.step(q)
        assert step.status == "solved"
        q = pin.integrate(machine.model, q, 0.01 * step.v)
    yaw = math.atan2(q[3], q[2])
    assert yaw == pytest.approx(0.5 if skids else 0.0, abs=0.02)
    if skids:
        left, right = q[4:][[0, 2]], q[4:][[1, 3]]
        assert left == pytest.approx(np.full(2, -0.25 / 0.1 * yaw), abs=1e-6)
        assert right == pytest.approx(np.full(2, 0.25 / 0.1 * yaw), abs=1e-6)


W = "wheel_left_joint"
BAD: dict[str, tuple[Callable[[], Rolling], type[WbcError], str]] = {
    "radius": (lambda: Rolling(Wheel(W, 0.0)), RangeError, "Wheel.radius"),
    "radius NaN": (lambda: Rolling(Wheel(W, np.nan)), NotFiniteError, "Wheel.radius"),
    "joint number": (lambda: Rolling(Wheel(3, 0.1)), ShapeError, "Wheel.joint"),
    "roller": (lambda: Rolling(Wheel(W, 0.1, math.pi / 2)), RangeError, "Wheel.roller"),
    "none": (lambda: Rolling([]), ShapeError, "Rolling.wheels"),
    "names": (lambda: Rolling([W]), ShapeError, "expected one Wheel or several"),
    "number": (lambda: Rolling(3), ShapeError, "Rolling.wheels"),
    "twice": (lambda: Rolling([Wheel(W, 0.1), Wheel(W, 0.2)]), DuplicateNameError, "two wheels on one joint"),
    "unknown": (lambda: Rolling(Wheel("wheel_left", 0.1)), UnknownNameError, f"'{W}'"),
    "sliding": (lambda: Rolling(Wheel("torso_lift_joint", 0.1)), RangeError, "revolute"),
    "base": (lambda: Rolling(Wheel("root_joint", 0.1)), RangeError, "revolute"),
    "steering": (lambda: Rolling(Wheel("arm_1_joint", 0.1)), RangeError, "it steers"),
    "gain": (lambda: Rolling(Wheel(W, 0.1), gain=-1.0), RangeError, "Rolling.gain"),
    "contact": (lambda: Rolling(Wheel(W, 0.1), contact="yes"), ShapeError, "Rolling.contact"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_declaration_leaves_the_stack_as_it_was(case: str) -> None:
    make, error, text = BAD[case]
    stack = wbc.Stack(vehicle("tiago").robot, 0.01)
    entries = stack.entries
    assert_refused(lambda: stack.add(make()), error, text)
    assert stack.entries == entries


def test_wheel_that_nothing_carries() -> None:
    with pytest.raises(RangeError, match="nothing carries this wheel"):
        Rolling(Wheel("panda_joint1", 0.1)).validate(wbc.robots.load("panda", shapes="none"))


def test_radius_of_the_legs_wheels_is_below_their_centres() -> None:
    legs = vehicle("centauro")
    data = legs.robot.model.createData()
    pin.forwardKinematics(legs.robot.model, data, legs.robot.neutral)
    for wheel in legs.wheels:
        centre = data.oMi[legs.robot.model.getJointId(wheel.joint)].translation
        point = touching(legs.robot, wheel, pin.SE3.Identity(), legs.robot.neutral)[0]
        assert centre - point == pytest.approx([0.0, 0.0, CENTAURO_RADIUS], abs=1e-6)

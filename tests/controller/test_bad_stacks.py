"""Bad stacks and robots: a typed error, the stack as it was, and the next good declaration works."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.controller.stacks import DT, robot
from wbc import Stack, WbcError
from wbc.errors import (
    BoundsError,
    DuplicateNameError,
    LevelError,
    MissingShapeError,
    NotFiniteError,
    RangeError,
    RobotFileError,
    ShapeError,
    UnknownNameError,
    UnsupportedJointError,
)
from wbc.shapes import Sphere
from wbc.tasks import (
    Elbow,
    EndEffector,
    Expression,
    Fixed,
    FrameVelocityLimit,
    Hold,
    Input,
    JointLimits,
    Obstacle,
    PitchPlaneLimit,
    Posture,
)

TIP = "panda_hand_tcp"


def height(*inputs: Input) -> Expression:
    return Expression(lambda kin, p: kin.position(TIP)[2], units="m", inputs=inputs)


#: call on a stack, error, field, value, nearest choice
ADD: dict[str, tuple[Callable[[Stack], Any], type[WbcError], str, Any, str | None]] = {
    "frame": (
        lambda s: s.add(EndEffector("panda_hnd")),
        UnknownNameError,
        "EndEffector.frame",
        "panda_hnd",
        "panda_hand",
    ),
    "relative": (
        lambda s: s.add(EndEffector(TIP, relative_to="panda_lnk3")),
        UnknownNameError,
        "EndEffector.relative_to",
        "panda_lnk3",
        "panda_link3",
    ),
    "elbow": (lambda s: s.add(Elbow("panda_link44")), UnknownNameError, "Elbow.frame", "panda_link44", "panda_link4"),
    "hold": (lambda s: s.add(Hold("panda_hnd")), UnknownNameError, "Hold.frame", "panda_hnd", "panda_hand"),
    "joint": (
        lambda s: s.add(Posture(("panda_joint9",)), name="other"),
        UnknownNameError,
        "Posture.joints",
        "panda_joint9",
        "panda_joint1",
    ),
    "fixed joint": (
        lambda s: s.add(Fixed("panda_jnt3")),
        UnknownNameError,
        "Fixed.joints",
        "panda_jnt3",
        "panda_joint3",
    ),
    "limited joint": (
        lambda s: s.add(JointLimits(joints=("panda_joint_2",))),
        UnknownNameError,
        "JointLimits.joints",
        "panda_joint_2",
        "panda_joint2",
    ),
    "link": (
        lambda s: s.add(Obstacle(Sphere(0.1), links="panda_lnk5")),
        UnknownNameError,
        "Obstacle.links",
        "panda_lnk5",
        "panda_link5",
    ),
    "link without shape": (
        lambda s: s.add(Obstacle(Sphere(0.1), links="panda_link3")),
        MissingShapeError,
        "Obstacle.links",
        "panda_link3",
        None,
    ),
    "duplicate": (lambda s: s.add(Elbow("panda_link4"), name="posture"), DuplicateNameError, "name", "posture", None),
    "duplicate by class": (lambda s: s.add(Posture()), DuplicateNameError, "name", "posture", None),
    "empty name": (lambda s: s.add(Elbow("panda_link4"), name=""), ShapeError, "name", "", None),
    "level of bounds": (lambda s: s.add(JointLimits(), level=1), LevelError, "level", 1, "0"),
    "level below": (lambda s: s.add(Elbow("panda_link4"), level=-1), LevelError, "level", -1, "0"),
    "level flag": (lambda s: s.add(Elbow("panda_link4"), level=True), ShapeError, "level", True, None),
    "weight": (lambda s: s.add(Elbow("panda_link4"), weight=-0.1), RangeError, "weight", -0.1, None),
    "weight inf": (lambda s: s.add(Elbow("panda_link4"), weight=np.inf), NotFiniteError, "weight", np.inf, None),
    "weight of a constraint": (lambda s: s.add(JointLimits(), weight=0.5), RangeError, "weight", 0.5, None),
    "class": (lambda s: s.add(Posture), ShapeError, "item", Posture, None),
    "text": (lambda s: s.add("posture"), ShapeError, "item", "posture", None),
    "item": (lambda s: s["postur"], UnknownNameError, "item", "postur", "posture"),
    "item list": (lambda s: s[["posture"]], UnknownNameError, "item", ["posture"], "posture"),
    "plane upside down": (
        lambda s: s.add(PitchPlaneLimit("panda_link2", "panda_link4", "panda_link6", lower=1.0, upper=-1.0)),
        BoundsError,
        "lower",
        1.0,
        None,
    ),
    "input upside down": (
        lambda s: s.add(height(Input("a", default=0.0, low=1.0, high=-1.0))),
        BoundsError,
        "Expression.inputs.a.low",
        1.0,
        None,
    ),
    "negative speed": (
        lambda s: s.add(FrameVelocityLimit(TIP, linear=-1.0)),
        RangeError,
        "FrameVelocityLimit.linear",
        -1.0,
        None,
    ),
    "solver": (lambda s: s.compile(solver="opsq"), UnknownNameError, "solver", "opsq", "osqp"),
    "backend": (lambda s: s.compile(backend="VM"), UnknownNameError, "backend", "VM", "vm"),
}


@pytest.mark.parametrize("case", ADD)
def test_a_refused_declaration_leaves_the_stack_as_it_was(case: str) -> None:
    call, kind, field, value, nearest = ADD[case]
    stack, twin = (Stack(robot("panda"), DT).add(Posture()) for _ in range(2))
    before = stack.entries, stack.key_data()
    with pytest.raises(WbcError) as caught:
        call(stack)
    error = caught.value
    assert type(error) is kind
    assert (error.field, error.value) == (field, value)
    assert field in str(error)
    assert repr(value) in str(error)
    assert nearest is None or error.choices[0] == nearest
    assert (stack.entries, stack.key_data()) == before
    for one in (stack, twin):
        one.add(JointLimits())
    assert stack.key_data() == twin.key_data()
    one, other = (s.compile(backend="vm") for s in (stack, twin))
    q = robot("panda").neutral
    assert one.step(q)._data == other.step(q)._data


@pytest.mark.parametrize(
    ("arguments", "kind", "field"),
    [
        ({"dt": 0.0}, RangeError, "dt"),
        ({"dt": -DT}, RangeError, "dt"),
        ({"dt": np.nan}, NotFiniteError, "dt"),
        ({"dt": np.inf}, NotFiniteError, "dt"),
        ({"dt": "fast"}, ShapeError, "dt"),
        ({"damping": 0.0}, RangeError, "damping"),
        ({"damping": -1e-8}, RangeError, "damping"),
        ({"length": 0.0}, RangeError, "length"),
        ({"robot": "panda"}, ShapeError, "robot"),
    ],
)
def test_bad_stack(arguments: dict[str, Any], kind: type[WbcError], field: str) -> None:
    with pytest.raises(WbcError) as caught:
        Stack(**({"robot": robot("panda"), "dt": DT} | arguments))
    assert type(caught.value) is kind
    assert caught.value.field == field
    assert caught.value.value is arguments[field]


LOWER = np.full(7, 4.0)

#: how limits may be overridden so that lower > upper, or otherwise badly
LIMITS: dict[str, tuple[dict[str, Any], type[WbcError], str]] = {
    "crossed arrays": ({"position_lower": LOWER}, BoundsError, "limits.position_lower"),
    "crossed joint": ({"position_upper": {"panda_joint2": -3.0}}, BoundsError, "limits.position_lower"),
    "crossed number": ({"position_lower": 5.0}, BoundsError, "limits.position_lower"),
    "negative velocity": ({"velocity": -1.0}, RangeError, "limits.velocity"),
    "NaN": ({"acceleration": np.nan}, NotFiniteError, "limits.acceleration"),
    "shape": ({"velocity": np.ones(6)}, ShapeError, "limits.velocity"),
    "limit": ({"velocities": 1.0}, UnknownNameError, "limit"),
    "joint": ({"velocity": {"panda_joint22": 1.0}}, UnknownNameError, "limits.velocity"),
}


@pytest.mark.parametrize(
    ("case", "way"),
    [(case, way) for case in LIMITS for way in ("with_limits", "load") if (case, way) != ("limit", "load")],
)
def test_infeasible_bounds(case: str, way: str) -> None:
    changes, kind, field = LIMITS[case]
    bot = robot("panda")
    before = bot.fingerprint
    with pytest.raises(WbcError) as caught:
        bot.with_limits(**changes) if way == "with_limits" else wbc.robots.load("panda", **changes)
    assert type(caught.value) is kind
    assert caught.value.field == field
    assert kind is not UnknownNameError or caught.value.choices[0] in ("velocity", "panda_joint2")
    assert bot.fingerprint == before
    assert bot.with_limits(position_lower={"panda_joint2": -0.5}).limits.position_lower[1] == -0.5


LINKS = '<link name="a"/><link name="b"/>'
AXIS = '<axis xyz="0 0 0"/>'
LIMIT = '<limit lower="{}" upper="{}" velocity="1" effort="1"/>'
JOINT = '<joint name="j" type="{}"><parent link="a"/><child link="b"/>{}</joint>'
FILES: dict[str, tuple[bytes, type[WbcError]]] = {
    "cut.urdf": (f'<robot name="r">{LINKS}'.encode(), RobotFileError),
    "empty.urdf": (b"", RobotFileError),
    "noise.urdf": (bytes(range(128, 256)), RobotFileError),
    "html.urdf": (b"<html/>", RobotFileError),
    "kind.urdf": (f'<robot name="r">{LINKS}{JOINT.format("rotary", "")}</robot>'.encode(), RobotFileError),
    "axis.urdf": (
        f'<robot name="r">{LINKS}{JOINT.format("revolute", LIMIT.format(-1, 1) + AXIS)}</robot>'.encode(),
        RobotFileError,
    ),
}


@pytest.mark.parametrize("name", FILES)
def test_unreadable_or_broken_robot_file(name: str, tmp_path: Path) -> None:
    text, kind = FILES[name]
    path = tmp_path / name
    path.write_bytes(text)
    with pytest.raises(WbcError) as caught:
        wbc.robots.load(path)
    assert type(caught.value) is kind
    assert caught.value.field == ("robot" if kind is RobotFileError else "limits.position_lower")
    assert kind is not RobotFileError or caught.value.value == str(path)
    path.write_text(f'<robot name="r">{LINKS}{JOINT.format("revolute", LIMIT.format(-1, 1))}</robot>')
    stack = Stack(wbc.robots.load(path), DT).add(Posture())
    assert stack.compile(backend="vm").step([0.5]).v == pytest.approx([0.0])


def test_missing_file_and_directory(tmp_path: Path) -> None:
    for source in (tmp_path / "none.urdf", tmp_path):
        with pytest.raises(RobotFileError) as caught:
            wbc.robots.load(source)
        assert caught.value.field == "robot"
        assert caught.value.value == str(source)


def test_unsupported_joint() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelEllipsoid(1.0, 2.0, 3.0), pin.SE3.Identity(), "egg")
    with pytest.raises(UnsupportedJointError) as caught:
        wbc.robots.load(model)
    assert "egg" in str(caught.value)
    assert "Ellipsoid" in str(caught.value)
    assert "RX" in caught.value.choices

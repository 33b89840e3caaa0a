"""Bad declarations: a typed error names the field and, for names, the nearest valid one; the stack stays as it was."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.items import ITEMS
from tests.refusals import assert_refused
from tests.tasks.robots import robot
from wbc.api import Stack
from wbc.errors import (
    BoundsError,
    DuplicateNameError,
    MissingShapeError,
    NotFiniteError,
    RangeError,
    RotationError,
    ShapeError,
    UnknownNameError,
    WbcError,
)
from wbc.robot import Limits, Robot
from wbc.shapes import PlacedShape, Sphere
from wbc.tasks import (
    AxisAlign,
    AxisCone,
    CenterOfMass,
    Damping,
    Elbow,
    EndEffector,
    Fixed,
    FrameVelocityLimit,
    GazeCone,
    Hold,
    Input,
    Item,
    JointCoupling,
    JointLimits,
    Limit,
    LookAt,
    Manipulability,
    Momentum,
    Obstacle,
    PitchPlane,
    PitchPlaneLimit,
    PlaneReference,
    Posture,
    Row,
    SelfCollision,
    Task,
    WorkspaceBox,
    WorkspacePolyhedron,
)

INF, HERE = np.inf, pin.SE3.Identity()
HAND, PLANE = "panda_hand", ("panda_link2", "panda_link4", "panda_link6")
FIRST, *_, LAST = robot("panda").shapes
#: A link without shapes
#: What is named where a shape is refused
SHAPES = "valid: Box, Capsule, Convex, Cylinder, Ellipsoid, HalfSpace, HeightMap, Sphere"
BARE = next(n for n in robot("panda").frame_names if n.startswith("panda_link") and n not in robot("panda").shapes)
PLACE = EndEffector(HAND, kind="position")


def wrong(item: Item, name: str) -> Iterator[tuple[Any, tuple[type[WbcError], ...]]]:
    """What a field cannot take, by what it has, and the errors that say so."""
    value = getattr(item, name)
    if name == "weights":
        rows = len(item.rows(robot("panda")))
        yield (1.0,) * (rows + 1), (ShapeError,)
        yield (*(1.0,) * (rows - 1), -1.0), (RangeError,)
        yield (np.nan,) * rows, (NotFiniteError,)
        yield "heavy", (ShapeError,)
    elif isinstance(value, str):
        yield value + "x", (UnknownNameError,)
        yield 3, (UnknownNameError, ShapeError)
    elif isinstance(value, bool):
        yield "yes", (ShapeError,)
    elif isinstance(value, float):
        yield np.nan, (NotFiniteError, RangeError)
        yield "text", (ShapeError,)
        yield (1.0, 2.0), (ShapeError, BoundsError)
    elif isinstance(value, tuple) and value and all(isinstance(x, float) for x in value):
        yield (np.nan,) * len(value), (NotFiniteError,)
        yield "text", (ShapeError,)
        yield (*value, 1.0, 1.0), (ShapeError,)


@pytest.mark.parametrize("class_name", sorted(ITEMS.keys() - {"Expression"}))
def test_every_field_refuses_what_it_cannot_take(class_name: str) -> None:
    bot = robot("panda")
    for item, _ in ITEMS[class_name](bot):
        for field in dataclasses.fields(item):
            for bad, errors in wrong(item, field.name):
                with pytest.raises(errors) as caught:
                    dataclasses.replace(item, **{field.name: bad}).validate(bot)
                assert field.name in str(caught.value)
                if isinstance(caught.value, UnknownNameError) and isinstance(bad, str):
                    assert caught.value.value == bad
                    assert caught.value.choices[0] == getattr(item, field.name)
                    assert f"did you mean {getattr(item, field.name)!r}" in str(caught.value)


@pytest.mark.parametrize("class_name", ITEMS)
def test_a_frame_that_no_joint_moves_is_refused(class_name: str) -> None:
    """On the base, or against itself."""
    bot = robot("panda")
    item = ITEMS[class_name](bot)[0][0]
    fields = [field.name for field in dataclasses.fields(item)]
    others = {name: "world" for name in ("relative_to", "other", "point_frame", "frame_b") if name in fields}
    for own in {"frame", "frame_a"} & {*fields}:
        still = {name: "panda_link0" if name == "frame_b" else "world" for name in others}
        changes = [{own: "panda_link0", **still}, *({name: getattr(item, own)} for name in others)]
        for change in changes:
            assert_refused(
                lambda change=change: dataclasses.replace(item, **change).validate(bot), RangeError, "no joint moves"
            )


@dataclasses.dataclass(frozen=True)
class Below(Task):
    """A user's task with an input that is called like one of a limit."""

    def inputs(self, robot: object) -> tuple[Input, ...]:
        return (Input("lower", default=0.0),)

    def rows(self, robot: object) -> tuple[Row, ...]:
        return (Row("a", "rad"),)

    def error(self, robot: object, kin: Any, inputs: Any) -> Any:
        return kin.q[0] - inputs["lower"]


CASES: tuple[tuple[Callable[[], Any], type[WbcError], str], ...] = (
    (lambda: Posture(("panda_joint8",)), UnknownNameError, "panda_joint"),
    (lambda: Posture("panda_joint1"), ShapeError, "sequence of joint names"),
    (lambda: Posture(3), ShapeError, "sequence of joint names"),
    (lambda: Posture(("panda_joint1", "panda_joint1")), DuplicateNameError, "twice"),
    (lambda: Posture(()), ShapeError, "no joint is left"),
    (lambda: Posture(("panda_joint1",), weights=(1, 2)), ShapeError, "1 numbers"),
    (lambda: Posture(start="neutrl"), UnknownNameError, "'neutral'"),
    (lambda: Damping(weights=(1, 2)), ShapeError, "7 numbers"),
    (lambda: CenterOfMass(axes="frame"), UnknownNameError, "CenterOfMass.axes"),
    (lambda: JointCoupling([]), ShapeError, "JointCoupling.coefficients"),
    (lambda: JointCoupling("panda_joint1"), ShapeError, "JointCoupling.coefficients"),
    (lambda: JointCoupling(["panda_joint1", "panda_joint2"]), ShapeError, "coefficients[0]"),
    (lambda: JointCoupling({"panda_jont1": 1}), UnknownNameError, "'panda_joint1'"),
    (lambda: JointCoupling({"panda_joint1": 0}), RangeError, "other than 0"),
    (lambda: JointCoupling([{"panda_joint1": 1}, {}]), RangeError, "coefficients[1]"),
    (lambda: JointCoupling({"panda_joint1": np.inf}), NotFiniteError, "'panda_joint1'"),
    (lambda: JointCoupling({"panda_joint1": 1}, target=(1, 2)), ShapeError, "JointCoupling.target"),
    (lambda: JointCoupling({"panda_joint1": 1}, weights=(1, 2)), ShapeError, "1 numbers"),
    (lambda: Manipulability("panda_link4"), RangeError, "choose fewer with along="),
    (lambda: Manipulability("panda_link2", kind="orientation"), RangeError, "rx, ry, rz"),
    (lambda: Manipulability(HAND, along=("x", "w")), UnknownNameError, "Manipulability.along"),
    (lambda: Manipulability(HAND, along=()), ShapeError, "Manipulability.along"),
    (lambda: Manipulability(HAND, along=("x", "x")), DuplicateNameError, "twice"),
    (lambda: Manipulability(HAND, length=0), RangeError, "Manipulability.length"),
    (lambda: AxisAlign(HAND, axis=(0, 0, 0)), RangeError, "AxisAlign.axis"),
    (lambda: AxisAlign(HAND, around=(0, 0, -2)), RangeError, "AxisAlign.around"),
    (lambda: LookAt(HAND, axis=(0, 0, 0)), RangeError, "LookAt.axis"),
    (lambda: LookAt(HAND, around=(0, 0, 1)), RangeError, "LookAt.around"),
    (lambda: LookAt(HAND, width=0.0), RangeError, "LookAt.width"),
    (lambda: LookAt(HAND, width=2.0), RangeError, "LookAt.width"),
    (lambda: Limit(JointLimits(), lower=0.0), ShapeError, "Limit.task"),
    (lambda: Limit("hand", lower=0.0), ShapeError, "expected a task"),
    (lambda: Limit(Limit(PLACE, lower=0.0), upper=1.0), ShapeError, "expected a task"),
    (lambda: Limit(Damping(), upper=1.0), ShapeError, "its rows are velocities"),
    (lambda: Limit(Momentum(), upper=1.0), ShapeError, "its rows are velocities"),
    (lambda: Limit(AxisAlign(HAND), upper=1.0), ShapeError, "its rows are velocities"),
    (lambda: Limit(PitchPlane(*PLANE, axis="panda_joint4"), upper=1.0), ShapeError, "its rows are velocities"),
    (lambda: Limit(Elbow("panda_hnd"), upper=1.0), UnknownNameError, "Elbow.frame"),
    (lambda: Limit(PLACE), ShapeError, "a lower or an upper limit"),
    (lambda: Limit(PLACE, (0, 0, 1), 0.5), BoundsError, "above upper = 0.5 in entry 2"),
    (lambda: Limit(PLACE, (0, 0, 1), (1, 2)), ShapeError, "lower has 3 numbers"),
    (lambda: Limit(PLACE, (0, 1)), ShapeError, "one number, or 3"),
    (lambda: Limit(PLACE, (0, 1, 2), only=("x", "z")), ShapeError, "one number, or 2"),
    (lambda: Limit(PLACE, np.zeros((3, 1))), ShapeError, "Limit.lower"),
    (lambda: Limit(PLACE, ()), ShapeError, "Limit.lower"),
    (lambda: Limit(PLACE, upper=-INF), NotFiniteError, "Limit.upper"),
    (lambda: Limit(EndEffector(HAND), 0.0, only="rw"), UnknownNameError, "'rx'"),
    (lambda: Limit(PLACE, 0.0, only=("x", "x")), DuplicateNameError, "Limit.only"),
    (lambda: Limit(PLACE, 0.0, only=3), ShapeError, "Limit.only"),
    (lambda: Limit(Below(), 0.0), DuplicateNameError, "'lower'"),
    (lambda: WorkspaceBox(HAND, (0, 0, 1), (1, 1, 0.5)), BoundsError, "WorkspaceBox.lower: above upper"),
    (lambda: WorkspaceBox(HAND, 1.0, -1.0), BoundsError, "WorkspaceBox.lower"),
    (lambda: WorkspaceBox(HAND), ShapeError, "a lower or an upper limit"),
    (lambda: WorkspaceBox(HAND, (0, 0)), ShapeError, "one number or 3"),
    (lambda: WorkspaceBox(HAND, upper=(0, np.nan, 1)), NotFiniteError, "WorkspaceBox.upper"),
    (lambda: WorkspaceBox(HAND, lower=(0, INF, 1)), NotFiniteError, "-inf for no limit"),
    (lambda: WorkspaceBox(HAND, upper=-INF), NotFiniteError, "inf for no limit"),
    (lambda: WorkspacePolyhedron(HAND, []), ShapeError, "one at least"),
    (lambda: WorkspacePolyhedron(HAND, "up"), ShapeError, "WorkspacePolyhedron.normals"),
    (lambda: WorkspacePolyhedron(HAND, (0, 0, 1)), ShapeError, "normals[0]"),
    (lambda: WorkspacePolyhedron(HAND, [(0, 0, 1), (0, 0, 0)]), RangeError, "normals[1]"),
    (lambda: WorkspacePolyhedron(HAND, [(0, 0, np.nan)]), NotFiniteError, "normals[0]"),
    (lambda: WorkspacePolyhedron(HAND, np.eye(3), (0, 1)), ShapeError, "one number or 3"),
    (lambda: WorkspacePolyhedron(HAND, np.eye(3), INF), NotFiniteError, "-inf for no plane"),
    (lambda: WorkspacePolyhedron(HAND, np.eye(3), pose=2 * np.eye(4)), RotationError, "WorkspacePolyhedron.pose"),
    (lambda: AxisCone(HAND, 0.0), RangeError, "AxisCone.half_angle"),
    (lambda: AxisCone(HAND, 90), RangeError, "[0.001, 3.14159] rad"),
    (lambda: AxisCone(HAND, 1.0, axis=(0, 0, 0)), RangeError, "AxisCone.axis"),
    (lambda: GazeCone(HAND, -1.0), RangeError, "GazeCone.half_angle"),
    (lambda: Limit(Elbow("panda_link0"), upper=1.0), RangeError, "no joint moves"),
    (lambda: EndEffector(HAND, relative_to="panda_link8"), RangeError, "no joint moves"),
    (lambda: EndEffector("world"), RangeError, "no joint moves"),
    (lambda: Fixed(()), ShapeError, "Fixed.joints"),
    (lambda: Fixed(None), ShapeError, "Fixed.joints"),
    (lambda: Fixed((1, 2)), ShapeError, "Fixed.joints"),
    (lambda: Fixed(["panda_joint1", "panda_joint1"]), DuplicateNameError, "panda_joint1"),
    (lambda: Fixed("panda_joint1", acceleration=2), ShapeError, "Fixed.acceleration"),
    (lambda: Fixed("panda_joint_1"), UnknownNameError, "did you mean 'panda_joint1'"),
    (lambda: FrameVelocityLimit(HAND), ShapeError, "FrameVelocityLimit"),
    (lambda: FrameVelocityLimit(HAND, linear=np.inf), ShapeError, "FrameVelocityLimit"),
    (lambda: FrameVelocityLimit(HAND, linear=-1.0), RangeError, "FrameVelocityLimit"),
    (lambda: Hold(HAND, gain=-1.0), RangeError, "Hold.gain"),
    (lambda: JointLimits(margin=-0.1), RangeError, "JointLimits.margin"),
    (lambda: JointLimits(shortest_dt=0.0), RangeError, "JointLimits.shortest_dt"),
    (lambda: JointLimits(return_rate=-1.0), RangeError, "JointLimits.return_rate"),
    (lambda: JointLimits(joints=()), ShapeError, "JointLimits.joints"),
    (lambda: JointLimits(joints=("panda_joint1", "panda_joint1")), DuplicateNameError, "JointLimits.joints"),
    (lambda: JointLimits(joints=["panda_joint44"]), UnknownNameError, "did you mean 'panda_joint4'"),
    (lambda: JointLimits(margin=1.9, joints=("panda_joint6",)), RangeError, "panda_joint6"),
    (lambda: Obstacle("ball"), ShapeError, SHAPES),
    (lambda: Obstacle(PlacedShape(Sphere(0.1), HERE)), ShapeError, SHAPES),
    (lambda: Obstacle([]), ShapeError, SHAPES),
    (lambda: Obstacle([Sphere(0.1)]), ShapeError, SHAPES),
    (lambda: Obstacle(Sphere(0.1), closest=0), RangeError, "Obstacle.closest"),
    (lambda: Obstacle(Sphere(0.1), closest=1.5), RangeError, "Obstacle.closest"),
    (lambda: Obstacle(Sphere(0.1), closest=True), RangeError, "Obstacle.closest"),
    (lambda: Obstacle(Sphere(0.1), closest=np.inf), NotFiniteError, "Obstacle.closest"),
    (lambda: Obstacle(Sphere(0.1), margin=-0.01), RangeError, "Obstacle.margin"),
    (lambda: Obstacle(Sphere(0.1), links=("a", "a")), DuplicateNameError, "Obstacle.links"),
    (lambda: Obstacle(Sphere(0.1), pose=np.zeros(3)), ShapeError, "Obstacle.pose"),
    (lambda: Obstacle(Sphere(0.1), links=LAST + "x"), UnknownNameError, f"did you mean '{LAST}'"),
    (lambda: Obstacle(Sphere(0.1), links=(LAST, BARE)), MissingShapeError, BARE),
    (lambda: SelfCollision("ab"), ShapeError, "SelfCollision.pairs"),
    (lambda: SelfCollision(3), ShapeError, "SelfCollision.pairs"),
    (lambda: SelfCollision([]), ShapeError, "SelfCollision.pairs"),
    (lambda: SelfCollision([FIRST]), ShapeError, "SelfCollision.pairs"),
    (lambda: SelfCollision([(FIRST,)]), ShapeError, "SelfCollision.pairs"),
    (lambda: SelfCollision([(FIRST, FIRST)]), ShapeError, "SelfCollision.pairs"),
    (lambda: SelfCollision([(FIRST, 2)]), ShapeError, "SelfCollision.pairs"),
    (lambda: SelfCollision([(FIRST, LAST, FIRST)]), ShapeError, "SelfCollision.pairs"),
    (lambda: SelfCollision([(FIRST, LAST), (LAST, FIRST)]), DuplicateNameError, "twice"),
    (lambda: SelfCollision(margin=-0.1), RangeError, "SelfCollision.margin"),
    (lambda: SelfCollision(closest=0), RangeError, "SelfCollision.closest"),
    (lambda: SelfCollision(closest=2.5), RangeError, "SelfCollision.closest"),
    (lambda: SelfCollision(closest=True), RangeError, "SelfCollision.closest"),
    (lambda: SelfCollision(corners=-1), RangeError, "SelfCollision.corners"),
    (lambda: SelfCollision(method="symbolik"), UnknownNameError, "valid: symbolic"),
    (lambda: SelfCollision([(FIRST, LAST + "x")]), UnknownNameError, LAST),
    (lambda: SelfCollision([(FIRST, BARE)]), MissingShapeError, "no collision shapes"),
    (lambda: PlaneReference(pole=(0, 0, 0)), RangeError, "reference.pole"),
    (lambda: PlaneReference(direction=(0, 0, 2)), RangeError, "reference.direction"),
    (lambda: PlaneReference(direction=(np.nan, 0, 2)), NotFiniteError, "reference.direction"),
    (lambda: PlaneReference(pole=(0, 1)), ShapeError, "reference.pole"),
    (lambda: PitchPlane(*PLANE, reference=(0, 0, 1)), ShapeError, "reference"),
    (lambda: PitchPlane(*PLANE, line_width=0), RangeError, "line_width"),
    (lambda: PitchPlane(*PLANE, elbow_width=1.5), RangeError, "elbow_width"),
    (lambda: PitchPlane(*PLANE, reference_width=4), RangeError, "reference_width"),
    (lambda: PitchPlaneLimit(*PLANE, lower=1.0, upper=0.5), BoundsError, "lower"),
    (lambda: PitchPlaneLimit(*PLANE, lower=-0.5, upper=-0.5 + 2 * np.pi), RangeError, "upper"),
    (lambda: PitchPlane(*PLANE, axis="panda_joint44"), UnknownNameError, "axis"),
    (lambda: PitchPlane("panda_link2", "panda_link4", "panda_link2"), RangeError, "wrist"),
    (lambda: PitchPlane(*PLANE, axis="panda_joint1"), RangeError, "axis"),
)


@pytest.mark.parametrize(("make", "error", "text"), CASES)
def test_bad_declaration(make: Callable[[], Any], error: type[WbcError], text: str) -> None:
    stack = Stack(robot("panda"), 0.01)
    entries = stack.entries
    assert_refused(lambda: stack.add(make()), error, text)
    assert stack.entries == entries


@pytest.mark.parametrize("cls", [CenterOfMass, Momentum])
def test_mass_is_needed(cls: type[Item]) -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    none = np.full(1, np.inf)
    bare = Robot("bare", model, Limits(-none, none, none, none, none))
    assert_refused(lambda: cls().validate(bare), RangeError, "no mass")


def test_a_name_is_free_where_that_side_is_left_out() -> None:
    Limit(Below(), upper=1.0).validate(robot("panda"))


@pytest.mark.parametrize(
    "given", [[1, 2, 3], (1.0, 2.0, 3.0), np.array([1, 2, 3]), np.array([1, 2, 3], dtype=np.float32)]
)
def test_weights_of_any_kind_of_number(given: Any) -> None:
    items = [CenterOfMass(weights=given), Elbow("panda_link4", weights=given)]
    for item in items:
        assert item.row_weights(robot("panda")).tolist() == [1.0, 2.0, 3.0]
        assert isinstance(hash(item), int)

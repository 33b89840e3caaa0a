"""Bad input is refused by name, and changes nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.clearance.world import free_tree, random_arms, still
from wbc.clearance import (
    CylinderInside,
    EndlessCylinder,
    Exemption,
    Motion,
    Pair,
    Sweeper,
    SweptBody,
    SweptScene,
    Tree,
    TriangleMesh,
)
from wbc.errors import (
    ContinuityError,
    DuplicateNameError,
    NotFiniteError,
    RangeError,
    RobotFileError,
    RotationError,
    ShapeError,
    UnknownNameError,
    UnsupportedJointError,
    WbcError,
)
from wbc.shapes import HalfSpace, Sphere

TREE = free_tree()
HAND = SweptBody("hand", Sphere(0.1), "universe", grasp=np.zeros(3))
TABLE = SweptBody("table", HalfSpace())
POSES = [[0, 0, 1, 0, 0, 0, 1], [0, 0, 1, 0, 0, 0, 1]]
NONE = np.zeros((2, 0))


def scene(**changes: Any) -> SweptScene:
    """A hand and a table."""
    given = {"bodies": [HAND, TABLE], "pairs": [Pair("hand", "table", 0.01)], **changes}
    return SweptScene(TREE, given["bodies"], given["pairs"])


def jumping() -> Motion:
    """A scalar that is elsewhere after the knot in the middle."""
    controls = np.array([[[0.0, 1.0]], [[1.1, 2.0]]])
    return Motion(np.arange(3.0), controls, np.zeros((0, 3, 12)), np.zeros(1), np.zeros((0, 2)))


def exempt(**changes: Any) -> Any:
    """A sweep with an exemption."""
    given: dict[str, Any] = {"hand": "hand", "mount": "table", "point": np.zeros(3), "slope": 0.1, **changes}
    return Sweeper(scene()).sweep(still(pin.SE3.Identity()), exemptions=[Exemption(**given)])


BAD: list[tuple[Callable[[], Any], type[WbcError], str]] = [
    (lambda: scene(bodies=[HAND, HAND]), DuplicateNameError, "hand"),
    (lambda: scene(bodies=["hand"]), ShapeError, "SweptBody"),
    (lambda: scene(bodies=[HAND, SweptBody(3, HalfSpace())]), WbcError, "name"),  # type: ignore[arg-type]
    (lambda: scene(bodies=[HAND, SweptBody("table", HalfSpace(), "world", "here")]), WbcError, "table.placement"),  # type: ignore[arg-type]
    (lambda: scene(bodies=[HAND, SweptBody("table", HalfSpace(), [])]), WbcError, "table.link"),  # type: ignore[arg-type]
    (lambda: scene(bodies=[SweptBody("hand", Sphere(0.1), "universe", grasp=[1, 2]), TABLE]), ShapeError, "hand.grasp"),
    (lambda: scene(pairs=[("hand", "table")]), ShapeError, "a Pair"),
    (lambda: scene(pairs=[Pair(["hand"], "table")]), WbcError, "pairs"),  # type: ignore[arg-type]
    (lambda: SweptScene("tree", [], []), ShapeError, "a Tree"),  # type: ignore[arg-type]
    (lambda: Sweeper(scene()).sweep(still(pin.SE3.Identity()), exemptions=["hand"]), ShapeError, "an Exemption"),  # type: ignore[list-item]
    (lambda: Sweeper(scene()).sweep(still(pin.SE3.Identity()), "all"), ShapeError, "pairs"),
    (lambda: Sweeper(scene()).sweep(still(pin.SE3.Identity()), [[0], [0, 1]]), ShapeError, "pairs"),
    (lambda: Sweeper(scene()).sweep(still(pin.SE3.Identity()), [0.5]), ShapeError, "pairs"),
    (lambda: scene(pairs=[Pair("hand", "tabel")]), UnknownNameError, "table"),
    (lambda: scene(pairs=[Pair("hand", "table", float("nan"))]), NotFiniteError, "hand and table"),
    (lambda: scene(pairs=[Pair("table", "table")]), ShapeError, "have no distance"),
    (lambda: scene(bodies=[HAND, SweptBody("table", HalfSpace(), "universe")]), ShapeError, "fixed in the world"),
    (lambda: scene(bodies=[HAND, SweptBody("table", HalfSpace(), "wrold")]), UnknownNameError, "world"),
    (lambda: scene(bodies=[HAND, SweptBody("table", "box")]), ShapeError, "table.shape"),  # type: ignore[arg-type]
    (lambda: CylinderInside(0.0), RangeError, "CylinderInside.radius"),
    (lambda: EndlessCylinder(float("inf")), WbcError, "EndlessCylinder.radius"),
    (lambda: TriangleMesh.read("no.stl"), RobotFileError, "no.stl"),
    (lambda: TriangleMesh(np.zeros((2, 3))), ShapeError, "TriangleMesh.corners"),
    (lambda: TriangleMesh(np.full((1, 3, 3), np.nan)), NotFiniteError, "TriangleMesh.corners"),
    (lambda: Motion.linear(TREE, [0.0], NONE[:1], POSES[:1]), ShapeError, "two knots"),
    (lambda: Motion.linear(TREE, [0.0, 0.0], NONE, POSES), RangeError, r"Motion.times\[1\]"),
    (lambda: Motion.linear(TREE, [0.0, 1.0], np.zeros((2, 1)), POSES), ShapeError, "q"),
    (lambda: Motion.linear(TREE, [0.0, 1.0], NONE), ShapeError, "poses"),
    (lambda: Motion.linear(TREE, [0.0, 1.0], NONE, np.zeros((2, 7))), RotationError, "poses"),
    (lambda: Motion.linear(TREE, [0.0, np.nan], NONE, POSES), NotFiniteError, "times"),
    (lambda: Motion.linear(TREE, [0.0, 1.0], NONE, POSES, free_slack=-1.0), RangeError, "free_slack"),
    (lambda: Motion.linear(TREE, [0.0, 1.0], NONE, POSES, slack=[1.0, 2.0]), ShapeError, "slack"),
    (lambda: Tree.of_model(pin.Model(), things=("cart", "cart")), DuplicateNameError, "cart"),
    (jumping, ContinuityError, r"Motion.controls\[1, 0\]"),
    (lambda: Sweeper("scene"), ShapeError, "SweptScene"),  # type: ignore[arg-type]
    (lambda: Sweeper(scene()).sweep("motion"), ShapeError, "Motion"),  # type: ignore[arg-type]
    (lambda: Sweeper(scene()).sweep(still(pin.SE3.Identity()), aim="al"), UnknownNameError, "any"),
    (lambda: Sweeper(scene()).sweep(still(pin.SE3.Identity()), tolerance=0.0), RangeError, "tolerance"),
    (lambda: Sweeper(scene()).sweep(still(pin.SE3.Identity()), [1]), RangeError, "pairs"),
    (lambda: Sweeper(scene()).sweep(still(pin.SE3.Identity()), [0, 0]), ShapeError, "each once"),
    (lambda: Sweeper(scene()).at(still(pin.SE3.Identity()), 2.0), RangeError, "time"),
    (lambda: exempt(hand="table"), ShapeError, "grasp"),
    (lambda: exempt(mount="hand"), ShapeError, "fixed in the world"),
    (lambda: exempt(slope=-1.0), RangeError, "slope"),
    (lambda: exempt(depth=np.nan), NotFiniteError, "depth"),
    (lambda: exempt(point=[0, 0]), ShapeError, "point"),
]


@pytest.mark.parametrize("case", BAD, ids=range(len(BAD)))
def test_bad_input_is_refused_by_name(case: tuple[Callable[[], Any], type[WbcError], str]) -> None:
    call, kind, said = case
    with pytest.raises(kind, match=said):
        call()


def test_an_exemption_of_no_pair_names_those_there_are() -> None:
    bodies = [HAND, TABLE, SweptBody("wall", HalfSpace())]
    sweeper = Sweeper(scene(bodies=bodies))
    with pytest.raises(UnknownNameError, match="hand and table"):
        sweeper.sweep(still(pin.SE3.Identity()), exemptions=[Exemption("hand", "wall", np.zeros(3), 0.1)])
    assert sweeper.sweep(still(pin.SE3.Identity())).violation is not None


def test_a_motion_of_another_tree_is_refused() -> None:
    tree = Tree.of_model(random_arms(np.random.default_rng(0)))
    motion = Motion.linear(tree, [0.0, 1.0], np.zeros((2, 8)))
    with pytest.raises(ShapeError, match="0 scalars and 1 free"):
        Sweeper(scene()).sweep(motion)


def test_joints_that_are_no_turns_and_shifts_by_scalars_are_refused() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    with pytest.raises(UnsupportedJointError, match="ball"):
        Tree.of_model(model)

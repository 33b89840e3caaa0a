"""Bad declarations: a typed error that names the field and, for names, the nearest valid one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.refusals import assert_refused
from tests.tasks.robots import robot
from wbc.errors import DuplicateNameError, NotFiniteError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.robot import Limits, Robot
from wbc.tasks import CenterOfMass, Damping, Elbow, EndEffector, Item, Posture

HAND = "panda_hand"

CASES: dict[str, tuple[Callable[[], Item], type[WbcError], str]] = {
    "frame": (lambda: EndEffector("panda_hnd"), UnknownNameError, HAND),
    "frame type": (lambda: EndEffector(3), UnknownNameError, "EndEffector.frame"),
    "kind": (lambda: EndEffector(HAND, kind="positions"), UnknownNameError, "'position'"),
    "relative": (lambda: EndEffector(HAND, relative_to="wrld"), UnknownNameError, "'world'"),
    "axes": (lambda: EndEffector(HAND, axes="referense"), UnknownNameError, "'reference'"),
    "same frame": (lambda: EndEffector(HAND, relative_to=HAND), RangeError, "no joint moves"),
    "same body": (lambda: EndEffector(HAND, relative_to="panda_link8"), RangeError, "no joint moves"),
    "fixed frame": (lambda: EndEffector("panda_link0"), RangeError, "no joint moves"),
    "world": (lambda: EndEffector("world"), RangeError, "no joint moves"),
    "weights count": (lambda: EndEffector(HAND, weights=(1, 1, 1)), ShapeError, "6 numbers"),
    "weights position": (lambda: EndEffector(HAND, kind="position", weights=(1,) * 6), ShapeError, "3 numbers"),
    "weights negative": (lambda: EndEffector(HAND, weights=(1, 1, 1, 1, 1, -1)), RangeError, "weights[5]"),
    "weights NaN": (lambda: EndEffector(HAND, weights=[np.nan] * 6), NotFiniteError, "weights"),
    "weights inf": (lambda: EndEffector(HAND, weights=[np.inf] * 6), NotFiniteError, "weights"),
    "weights text": (lambda: EndEffector(HAND, weights="heavy"), ShapeError, "weights"),
    "elbow frame": (lambda: Elbow("panda_link"), UnknownNameError, "panda_link"),
    "elbow fixed": (lambda: Elbow("panda_link0"), RangeError, "no joint moves"),
    "elbow offset": (lambda: Elbow("panda_link4", offset=(1, 2)), ShapeError, "Elbow.offset"),
    "elbow offset NaN": (lambda: Elbow("panda_link4", offset=(1, 2, np.nan)), NotFiniteError, "Elbow.offset"),
    "elbow axes": (lambda: Elbow("panda_link4", axes="wold"), UnknownNameError, "'world'"),
    "elbow weights": (lambda: Elbow("panda_link4", weights=(1, 2)), ShapeError, "3 numbers"),
    "joint": (lambda: Posture(("panda_joint8",)), UnknownNameError, "panda_joint"),
    "joint string": (lambda: Posture("panda_joint1"), ShapeError, "sequence of joint names"),
    "joint number": (lambda: Posture(3), ShapeError, "sequence of joint names"),
    "joint twice": (lambda: Posture(("panda_joint1", "panda_joint1")), DuplicateNameError, "twice"),
    "no joints": (lambda: Posture(()), ShapeError, "no joint is left"),
    "posture weights": (lambda: Posture(("panda_joint1",), weights=(1, 2)), ShapeError, "1 numbers"),
    "start": (lambda: Posture(start="neutrl"), UnknownNameError, "'neutral'"),
    "damping weights": (lambda: Damping(weights=(1, 2)), ShapeError, "7 numbers"),
    "damping negative": (lambda: Damping(weights=(1, 1, 1, 1, 1, 1, -2)), RangeError, "weights[6]"),
    "mass axes": (lambda: CenterOfMass(axes="frame"), UnknownNameError, "CenterOfMass.axes"),
    "mass weights": (lambda: CenterOfMass(weights=np.ones((3, 1))), ShapeError, "3 numbers"),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_declaration(case: str) -> None:
    make, error, text = CASES[case]
    assert_refused(lambda: make().validate(robot("panda")), error, text)


def test_center_of_mass_needs_mass() -> None:
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    none = np.full(1, np.inf)
    bare = Robot("bare", model, Limits(-none, none, none, none, none))
    with pytest.raises(RangeError, match="no mass"):
        CenterOfMass().validate(bare)


@pytest.mark.parametrize(
    "given", [[1, 2, 3], (1.0, 2.0, 3.0), np.array([1, 2, 3]), np.array([1, 2, 3], dtype=np.float32)]
)
def test_weights_of_any_kind_of_number(given: Any) -> None:
    items = [CenterOfMass(weights=given), Elbow("panda_link4", weights=given)]
    for item in items:
        assert item.row_weights(robot("panda")).tolist() == [1.0, 2.0, 3.0]
        assert isinstance(hash(item), int)

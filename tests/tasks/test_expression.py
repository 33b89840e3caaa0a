"""The user's own task: rows found by tracing, a cache key that follows the formula, errors that say what is wrong."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import casadi as ca
import numpy as np
import pytest

from tests.evaluation import numbers
from tests.models import placement
from tests.tasks.robots import random_configuration, robot
from wbc.errors import (
    BoundsError,
    DuplicateNameError,
    NotFiniteError,
    RangeError,
    RotationError,
    ShapeError,
    UnknownNameError,
    WbcError,
)
from wbc.tasks import Expression, Input

HEIGHT = Input("height", unit="m", default=0.4)


def height(**options: Any) -> Expression:
    return Expression(
        lambda kin, p: kin.position("panda_hand")[2] - p["height"], **{"units": "m", "inputs": (HEIGHT,)} | options
    )


def test_three_lines_are_a_task() -> None:
    machine = robot("panda")
    task = height()
    found = numbers(task, machine)
    q = random_configuration(machine, np.random.default_rng(0))
    wanted = placement(machine, "panda_hand", q).translation[2] - 0.25
    assert found(q, {"height": 0.25})["value"] == pytest.approx([wanted], abs=1e-14)
    (row,) = task.rows(machine)
    assert (row.label, row.unit) == ("value", "m")


def test_rows_are_counted_and_named() -> None:
    machine = robot("panda")
    plain = Expression(lambda kin, p: kin.position("panda_hand"), units="m")
    assert [r.label for r in plain.rows(machine)] == ["0", "1", "2"]
    named = Expression(
        lambda kin, p: [kin.position("panda_hand")[0], kin.joint("panda_joint1")],
        units=("m", "rad"),
        labels=("reach", "pan"),
        weights=(1, 0.5),
    )
    named.validate(machine)
    assert [(r.label, r.unit) for r in named.rows(machine)] == [("reach", "m"), ("pan", "rad")]
    assert named.row_weights(machine).tolist() == [1.0, 0.5]


def test_key_follows_the_formula_and_not_the_source() -> None:
    machine = robot("panda")

    def key(scale: float, frame: str = "panda_hand", **options: Any) -> str:
        task = Expression(lambda kin, p: scale * kin.position(frame)[2], **{"units": "m"} | options)
        return repr(task.declaration(machine))

    def same_formula(kin: Any, p: Any) -> Any:
        point = kin.position("panda_hand")
        return 2.0 * point[2]

    assert key(2.0) == key(2.0) == repr(Expression(same_formula, units="m").declaration(machine))
    others = [key(2.0 + 1e-15), key(2.0, "panda_link7"), key(2.0, units="rad"), key(2.0, labels=("z",))]
    others += [key(2.0, weights=(2,)), key(2.0, inputs=(HEIGHT,))]
    assert len({key(2.0), *others}) == 7


def test_key_is_the_same_in_another_process() -> None:
    code = (
        "from tests.tasks.test_expression import height\nfrom tests.tasks.robots import robot\n"
        "print(repr(height().declaration(robot('panda'))))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.strip() == repr(height().declaration(robot("panda")))


def raising(kin: Any, p: Any) -> Any:
    raise ValueError("something of the user's own")


STRAY = ca.SX.sym("stray")

BAD_RESULTS = {
    "not SX": (lambda kin, p: np.ones(3), ShapeError, "expected a CasADi SX column"),
    "nothing": (lambda kin, p: None, ShapeError, "expected a CasADi SX column"),
    "MX": (lambda kin, p: ca.MX.sym("x"), ShapeError, "expected a CasADi SX column"),
    "empty": (lambda kin, p: [], ShapeError, "expected a CasADi SX column"),
    "row": (lambda kin, p: kin.position("panda_hand").T, ShapeError, "expected a column"),
    "matrix": (lambda kin, p: kin.rotation("panda_hand"), ShapeError, "expected a column"),
    "velocity": (lambda kin, p: kin.v[0], ShapeError, "not of v"),
    "constant": (lambda kin, p: p["height"], ShapeError, "does not depend on the configuration"),
    "own symbol": (lambda kin, p: kin.q[0] + STRAY, ShapeError, "stray"),
    "frame": (lambda kin, p: kin.position("panda_hnd"), UnknownNameError, "panda_hand"),
    "joint": (lambda kin, p: kin.joint("panda_joint9"), UnknownNameError, "panda_joint"),
    "input": (lambda kin, p: kin.q[0] - p["heigth"], UnknownNameError, "did you mean 'height'"),
    "raises": (raising, WbcError, "ValueError: something of the user's own"),
    "shapes": (lambda kin, p: kin.position("panda_hand") + ca.SX(2, 1), WbcError, "RuntimeError"),
    "index": (lambda kin, p: kin.q[99], WbcError, "the function raised"),
    "NaN": (lambda kin, p: ca.sqrt(kin.q[0] - 10), NotFiniteError, "neutral"),
    "no derivative": (lambda kin, p: ca.norm_2(kin.q - robot("panda").neutral), NotFiniteError, "no derivative"),
}


@pytest.mark.parametrize("case", BAD_RESULTS)
def test_bad_result_is_a_typed_error(case: str) -> None:
    function, error, text = BAD_RESULTS[case]
    with pytest.raises(WbcError) as caught:
        Expression(function, units="m", inputs=(HEIGHT,)).validate(robot("panda"))
    assert type(caught.value) is error
    assert text in str(caught.value)


BAD_OPTIONS: dict[str, tuple[dict[str, Any], type[WbcError]]] = {
    "units": ({"units": ("m", "m")}, ShapeError),
    "units type": ({"units": 3}, ShapeError),
    "labels": ({"labels": ("a", "b")}, ShapeError),
    "weights": ({"weights": (1, 2)}, ShapeError),
    "negative weight": ({"weights": (-1,)}, RangeError),
    "NaN weight": ({"weights": (np.nan,)}, NotFiniteError),
    "no input": ({"inputs": ("height",)}, ShapeError),
    "no default": ({"inputs": (Input("height"),)}, ShapeError),
    "twice": ({"inputs": (HEIGHT, HEIGHT)}, DuplicateNameError),
    "reserved": ({"inputs": (HEIGHT, Input("gain", default=1.0))}, DuplicateNameError),
    "identifier": ({"inputs": (HEIGHT, Input("a b", default=1.0))}, ShapeError),
    "kind": ({"inputs": (HEIGHT, Input("x", kind="matrix", default=1.0))}, UnknownNameError),
    "size": ({"inputs": (HEIGHT, Input("x", size=-1, default=1.0))}, RangeError),
    "bounds": ({"inputs": (HEIGHT, Input("x", default=1.0, low=2.0, high=1.0))}, BoundsError),
    "out of range": ({"inputs": (HEIGHT, Input("x", default=1.0, low=2.0))}, RangeError),
    "default shape": ({"inputs": (HEIGHT, Input("x", size=3, default=1.0))}, ShapeError),
    "default NaN": ({"inputs": (HEIGHT, Input("x", default=np.nan))}, NotFiniteError),
    "default rotation": ({"inputs": (HEIGHT, Input("x", kind="rotation", default=2 * np.eye(3)))}, RotationError),
    "unknown rate": ({"inputs": (HEIGHT, Input("x", default=1.0, rate="sped"))}, UnknownNameError),
    "rate size": ({"inputs": (HEIGHT, Input("x", kind="pose", default=np.eye(4), rate="height"))}, ShapeError),
}


@pytest.mark.parametrize("case", BAD_OPTIONS)
def test_bad_declaration_is_a_typed_error(case: str) -> None:
    options, error = BAD_OPTIONS[case]
    with pytest.raises(WbcError) as caught:
        height(**options).validate(robot("panda"))
    assert type(caught.value) is error


def test_function_must_be_callable() -> None:
    with pytest.raises(ShapeError, match="function"):
        Expression("kin.q", units="rad")

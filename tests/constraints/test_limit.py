"""Limit: whose rows it takes, what it refuses, how it fades with its task, and what its cache key sees."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import wbc
from tests.evaluation import numbers
from tests.stack import small
from tests.tasks.robots import FRAMES, random_configuration, robot
from wbc.stack.key import key
from wbc.tasks import (
    CenterOfMass,
    Elbow,
    EndEffector,
    Expression,
    Item,
    JointLimits,
    Limit,
    PitchPlane,
    PitchPlaneLimit,
    Posture,
)

HAND = "panda_hand"
INF = np.inf
PLACE = EndEffector(HAND, kind="position")

#: With every joint at zero its three points lie on one line: there is no plane, the factor is 0
FOLDED = PitchPlane("panda_link0", "panda_link1", "panda_link3")


def test_rows_and_inputs_are_those_of_the_task_and_two_sides() -> None:
    machine, item = robot("panda"), Limit(EndEffector(HAND), lower=0.0, upper=(1, 2), only=("rz", "x"))
    assert [(r.label, r.unit) for r in item.rows(machine)] == [
        ("rz.lower", "rad"),
        ("x.lower", "m"),
        ("rz.upper", "rad"),
        ("x.upper", "m"),
    ]
    declared = {d.name: d for d in item.inputs(machine)}
    assert list(declared) == ["target", "feedforward", "lower", "lower_rate", "upper", "upper_rate"]
    assert declared["upper"].default.tolist() == [1.0, 2.0]
    assert declared["lower"].unit == "rad, m"
    assert declared["lower"].rate == "lower_rate"
    assert [r.label for r in Limit(CenterOfMass(), upper=0.0).rows(machine)] == ["x.upper", "y.upper", "z.upper"]


def test_first_value_of_the_target_is_that_of_the_task() -> None:
    machine = robot("panda")
    q = random_configuration(machine, np.random.default_rng(5))
    assert np.array_equal(Limit(PLACE, lower=-0.1).initial(machine, q)["target"], PLACE.initial(machine, q)["target"])
    found = numbers(Limit(PLACE, lower=-0.1, upper=0.2), machine)
    values = {d.name: d.default for d in found.item.inputs(machine)} | PLACE.initial(machine, q)
    assert found(q, values)["value"] == pytest.approx([0.1] * 3 + [0.2] * 3, abs=1e-12)


# Fading


@pytest.mark.parametrize("name", ["panda", "talos"])
def test_fades_as_the_limit_of_the_plane_does(name: str) -> None:
    machine, rng, f = robot(name), np.random.default_rng(6), FRAMES[name]
    widths = {"elbow_width": 0.6, "line_width": 0.9}
    own = numbers(PitchPlaneLimit(*f.plane, lower=-0.5, upper=1.0, **widths), machine)
    found = numbers(Limit(PitchPlane(*f.plane, **widths), lower=-0.5, upper=1.0), machine)
    # PitchPlaneLimit wraps about the middle of its range: the same where the task's target is the middle
    values = {"target": 0.25, "feedforward": 0.0, "lower": [-0.75], "upper": [0.75]}
    values |= {"lower_rate": [0.0], "upper_rate": [0.0]}
    faded = 0
    for _ in range(20):
        q = random_configuration(machine, rng)
        here, wanted = found(q, values), own(q, {})
        assert here["value"] == pytest.approx(wanted["value"], abs=1e-12)
        assert here["jacobian"] == pytest.approx(wanted["jacobian"], abs=1e-10)
        faded += bool(np.abs(wanted["value"] - 0.75).max() < 0.7)
    assert faded > 0


@pytest.mark.parametrize(
    ("lower", "upper", "wanted"),
    [((-0.5,), (1.0,), [0.75, 0.75]), ((-INF,), (1.0,), [INF, 1.0]), ((-0.5,), (INF,), [1.0, INF])],
)
def test_singular_margins_are_constants(lower: Any, upper: Any, wanted: list[float]) -> None:
    machine = robot("panda")
    item = Limit(FOLDED, lower=lower, upper=upper)
    found = numbers(item, machine)
    values = {d.name: d.default for d in item.inputs(machine)} | {"target": 0.3}
    here = found(np.zeros(7), values)
    assert here["value"].tolist() == wanted
    assert not here["jacobian"].any()
    assert not here["drift"].any()


@pytest.mark.parametrize("lower", [True, False])
def test_one_sided_singular_margin_is_one(lower: bool) -> None:
    machine = robot("panda")
    item = Limit(FOLDED, **{"lower" if lower else "upper": 0.0})
    values = {d.name: d.default for d in item.inputs(machine)} | {"target": 0.3}
    assert numbers(item, machine)(np.zeros(7), values)["value"].tolist() == [1.0]


def test_step_reports_a_faded_limit() -> None:
    stack = wbc.Stack(wbc.robots.load("panda", shapes="none"), 0.01)
    stack.add(Limit(FOLDED, lower=-1.0, upper=1.0), name="plane")
    stack.add(Posture(), name="rest").add(JointLimits(acceleration=False))
    controller = stack.compile(backend="vm")
    assert controller.step(np.zeros(7)).faded == ("plane",)
    assert controller.step(np.zeros(7)).status == "solved"


# What is refused


# The cache


def name_of(item: Item) -> str:
    return key(small.stack().add(item), "1")


def tip(axes: str = "world") -> EndEffector:
    return EndEffector("tip", kind="position", axes=axes)


def test_key_sees_the_task_and_the_rows_and_no_first_values() -> None:
    same = [
        Limit(tip(), lower=0.0),
        Limit(tip(), lower=(1, 2, 3)),
        Limit(EndEffector("tip", "position", axes="world", gain=9.0), 1.0),
    ]
    assert len({name_of(item) for item in same}) == 1
    others = [
        Limit(tip("tip"), lower=0.0),
        Limit(tip(), lower=0.0, upper=1.0),
        Limit(tip(), upper=1.0),
        Limit(tip(), lower=0.0, only=("x", "y")),
        Limit(tip(), lower=0.0, only=("y", "x")),
        Limit(Elbow("tip"), lower=0.0),
        Limit(Expression(lambda kin, p: kin.position("tip")[0], units="m"), lower=0.0),
        Limit(Expression(lambda kin, p: 2 * kin.position("tip")[0], units="m"), lower=0.0),
    ]
    assert len({name_of(item) for item in (same[0], *others)}) == 1 + len(others)


def test_no_number_stands_for_equal_sides() -> None:
    """lower = upper is no mistake: the row is held as an equality by its two sides."""
    stack = small.stack().add(Limit(tip(), lower=-1.0, upper=1.0, only="y"), name="held")
    controller = stack.compile(backend="vm")
    controller["posture"].target, controller["hand"].enabled = small.Q, False
    controller["held"].target = np.zeros(3)
    controller.reset(small.Q)
    height = 0.5 * np.sin(0.3) + 0.4 * np.sin(1.1)
    controller["held"].set(lower=[height], upper=[height])
    controller["posture"].target = (0.6, 0.2)
    q = np.array(small.Q)
    for _ in range(50):
        step = controller.step(q)
        assert step.status == "solved"
        q = q + step.v * small.DT
    assert 0.5 * np.sin(q[0]) + 0.4 * np.sin(q[0] + q[1]) == pytest.approx(height, abs=1e-4)
    assert np.abs(q - small.Q).max() > 0.02

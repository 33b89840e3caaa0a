"""What a step counts from, what a reset resets, what a Step says, and that nothing else changes any of it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.backends import COMPILED, IN_PYTHON, way
from tests.controller.stacks import DT, FRAMES, controller, inside, robot
from tests.models import placement
from wbc import Controller, Stack, Step
from wbc.controller import core_of
from wbc.shapes import HalfSpace
from wbc.tasks import EndEffector, Hold, JointLimits, Obstacle, PitchPlane, Posture

BACKENDS = (IN_PYTHON, COMPILED)
ACCELERATION = 10.0
FAR = pin.SE3(pin.exp3(np.array([0.3, 2.0, 0.7])), np.array([0.4, 0.2, 0.6]))
START = np.array([0.1, -0.4, 0.2, -1.9, 0.1, 1.6, 0.4])


def arm(backend: str) -> Controller:
    return controller("arm", "panda", **way(backend))


def same(one: Step, two: Step) -> bool:
    """All numbers of two steps, bit for bit."""
    return one._data == two._data


# --- what accelerations are counted from ------------------------------------------------------------


def pulled(one: Controller) -> Controller:
    """Everything is asked for at once, so that acceleration bounds are what binds."""
    one["posture"].weight, one["posture"].gain, one["hand"].enabled = 10.0, 1e4, False
    one["posture"].target = START + np.array([1, 1, -1, 1, -1, 1, -1])
    return one


PULL = np.array([1, 1, -1, 1, -1, 1, -1])


@pytest.mark.parametrize("backend", BACKENDS)
def test_accelerations_count_from_the_last_command_or_the_measured_velocity(backend: str) -> None:
    one = pulled(arm(backend))
    first = one.step(START).v
    np.testing.assert_allclose(first, PULL * ACCELERATION * DT, atol=1e-9)
    np.testing.assert_array_equal(one.last_command, first)
    np.testing.assert_allclose(one.step(START).v, 2 * PULL * ACCELERATION * DT, atol=1e-9)
    measured = np.linspace(-0.3, 0.3, 7)
    given = one.step(START, measured).v
    np.testing.assert_allclose(given, measured + PULL * ACCELERATION * DT, atol=1e-9)
    # a measured velocity counts for its own step only
    np.testing.assert_allclose(one.step(START).v, given + PULL * ACCELERATION * DT, atol=1e-9)


@pytest.mark.parametrize("backend", BACKENDS)
def test_dt_counts_for_its_own_step(backend: str) -> None:
    one, last = pulled(arm(backend)), np.zeros(7)
    for dt in (None, 2 * DT, None, 0.25 * DT, 0.25 * DT, DT, 1.3 * DT, None, None):
        v = one.step(START, dt=dt).v
        np.testing.assert_allclose(v - last, PULL * ACCELERATION * (dt or DT), atol=1e-9)
        last = v
    twin = pulled(arm(backend))
    twin.reset(START, last)
    one.reset(START, last)
    one["posture"].target = twin["posture"].target = START + PULL
    assert same(one.step(START), twin.step(START, dt=DT))


# --- reset ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_reset_controller_is_a_fresh_one(backend: str) -> None:
    used, fresh = arm(backend), arm(backend)
    rng = np.random.default_rng(1)
    for _ in range(6):
        used.step(inside(robot("panda"), rng), rng.normal(size=7), DT * rng.uniform(0.3, 2.0))
    used.reset()
    assert not used.last_command.any()
    for _ in range(3):
        q = inside(robot("panda"), rng)
        assert same(used.step(q), fresh.step(q))


@pytest.mark.parametrize("backend", BACKENDS)
def test_reset_takes_defaults_again_unless_the_user_set_them(backend: str) -> None:
    one = arm(backend)
    one.step(START)
    np.testing.assert_array_equal(one["posture"].target, START)
    one["hand"].target, one["hand"].gain, one["hand"].feedforward = FAR, 3.5, np.full(6, 0.01)
    other = START + 0.2
    one.reset(other, np.full(7, 0.05))
    np.testing.assert_array_equal(one["posture"].target, other)
    np.testing.assert_array_equal(one.last_command, np.full(7, 0.05))
    np.testing.assert_array_equal(one["hand"].target.homogeneous, FAR.homogeneous)
    assert one["hand"].gain == 3.5
    np.testing.assert_array_equal(one["hand"].feedforward, np.full(6, 0.01))
    # a configuration given to reset is the first one: a later step takes nothing from its own
    one.step(START)
    np.testing.assert_array_equal(one["posture"].target, other)
    # without a configuration it is that of the next step
    one.reset()
    one.step(START)
    np.testing.assert_array_equal(one["posture"].target, START)
    # what the user sets stays, from then on
    one["posture"].target = other
    one.reset(START)
    np.testing.assert_array_equal(one["posture"].target, other)


# --- Step -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_step_is_immutable_and_stays_as_it_is(backend: str) -> None:
    one = arm(backend)
    one.step(START)
    one["hand"].target = FAR
    step = one.step(START)
    seen = describe(step)
    for name in ("v", "status", "iterations", "certificate", "residuals", "margins", "binding", "relaxed", "new"):
        with pytest.raises(AttributeError):
            setattr(step, name, 0.0)
    arrays = [step.v, step.residuals["hand"].values, step.margins["ball"], step.margins_ahead["ball"]]
    for array in arrays:
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
        with pytest.raises(ValueError, match="WRITEABLE"):
            array.flags.writeable = True
    kept = [a.copy() for a in arrays]
    one["hand"].mask, one["ball"].margin = 0.0, 0.3
    for _ in range(3):
        one.step(START + 0.1, np.ones(7), 2 * DT)
    one.reset(START)
    assert describe(step) == seen
    for array, copy in zip(arrays, kept, strict=True):
        np.testing.assert_array_equal(array, copy)


def describe(step: Step) -> str:
    residuals = {k: (r.values.tolist(), r.units, r.labels) for k, r in step.residuals.items()}
    margins = [{k: m.tolist() for k, m in part.items()} for part in (step.margins, step.margins_ahead)]
    return repr((step.v.tolist(), step.status, step.certificate, residuals, margins, step.binding, step.faded, step))


def test_residuals_have_units_and_labels() -> None:
    """Names, units and numbers, these by Pinocchio; the error is value - desired before the step."""
    one, bot = arm(IN_PYTHON), robot("panda")
    one.step(START)
    one["hand"].target, one["posture"].target = FAR, np.zeros(7)
    step = one.step(START)
    tip = placement(bot, FRAMES["panda"].tip, START)
    hand, posture = step.residuals["hand"], step.residuals["posture"]
    assert list(step.residuals) == ["hand", "posture"]
    assert hand.units == ("m",) * 3 + ("rad",) * 3
    assert hand.labels == ("x", "y", "z", "rx", "ry", "rz")
    turn = FAR.rotation @ pin.log3(FAR.rotation.T @ tip.rotation)
    np.testing.assert_allclose(hand.values, np.concatenate([tip.translation - FAR.translation, turn]), atol=1e-12)
    assert posture.units == ("rad",) * 7
    assert posture.labels == bot.dof_names
    np.testing.assert_allclose(posture.values, START, atol=1e-15)
    assert hand.norm("m") == pytest.approx(np.linalg.norm(tip.translation - FAR.translation))
    assert hand.norm("rad") == pytest.approx(np.linalg.norm(turn))
    assert str(hand) == f"{hand.norm('m'):.3g} m, {hand.norm('rad'):.3g} rad"
    for text in ("solved", f"hand {hand}", f"posture {posture}"):
        assert text in repr(step)


@pytest.mark.parametrize("backend", BACKENDS)
def test_binding_rows_have_names(backend: str) -> None:
    """The side is that of the bound: v at its upper end has a positive multiplier."""
    one, bot = arm(backend), robot("panda")
    for joint, side in ((3, "upper"), (3, "lower"), (5, "upper")):
        end = bot.limits.position_upper if side == "upper" else bot.limits.position_lower
        q, goal = START.copy(), START.copy()
        q[joint] = end[joint]
        goal[joint] = end[joint] + (1.0 if side == "upper" else -1.0)
        one.reset(q)
        one["hand"].enabled, one["posture"].target = False, goal
        step = one.step(q)
        assert [str(b) for b in step.binding] == [f"limits/panda_joint{joint + 1} {side}"]
        assert (step.binding[0].multiplier > 0.0) == (side == "upper")
        assert step.v[joint] == pytest.approx(0.0, abs=1e-9)
        assert f"binding: limits/panda_joint{joint + 1} {side}" in repr(step)


def test_binding_rows_of_constraints_have_names() -> None:
    """A margin binds from below, an equality is called equal."""
    bot, tip = robot("panda"), FRAMES["panda"].tip
    stack = Stack(bot, DT).add(Posture(), name="posture").add(Hold(tip, kind="position"), name="grip")
    stack.add(Obstacle(HalfSpace(), links="panda_link8"), name="table")
    one = stack.compile(solver=IN_PYTHON)
    one.step(START)
    one["posture"].target = START + PULL
    held = one.step(START)
    assert {str(b) for b in held.binding} == {"grip/x equal", "grip/y equal", "grip/z equal"}
    one["grip"].enabled = False
    lowest = min(one.step(START).margins["table"])
    one["table"].pose = pin.SE3(np.eye(3), np.array([0.0, 0.0, lowest]))
    one["posture"].target = START + [0, 1, 0, 0, 0, 0, 0]
    below = [str(b) for b in one.step(START).binding]
    labels = [row.label for row in core_of(one).layout.blocks["table"].rows]
    assert len(below) == 1
    assert below[0] in {f"table/{label} lower" for label in labels}
    assert all(label.startswith("panda_link8[") for label in labels)


def test_faded_rows_are_named() -> None:
    """The elbow on the shoulder-wrist line: the plane has no direction, the row is off and the Step says so."""
    crossing = -(np.arctan(0.0825 / 0.316) + np.arctan(0.0825 / 0.384))
    stack = Stack(robot("panda"), DT).add(Posture(), name="posture", weight=0.01)
    stack.add(PitchPlane(*FRAMES["panda"].plane), name="plane").add(EndEffector(FRAMES["panda"].tip), name="hand")
    one = stack.compile(solver=IN_PYTHON)
    clear = np.array([0.2, 0.4, -0.3, -1.8, 0.1, 1.2, 0.5])
    singular = clear.copy()
    singular[3] = crossing
    assert one.step(clear).faded == ()
    faded = one.step(singular)
    assert faded.faded == ("plane",)
    assert np.isfinite(faded.v).all()
    assert one.step(clear).faded == ()


def test_a_robot_of_one_joint() -> None:
    """The smallest problem there is, on both back ends."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    bot = wbc.robots.load(model, position_lower=-1.0, position_upper=1.0, velocity=2.0, acceleration=5.0)
    found: list[np.ndarray] = []
    for backend in BACKENDS:
        one = Stack(bot, DT).add(Posture(), name="posture").add(JointLimits(), name="limits").compile(**way(backend))
        q = np.array([0.2])
        one["posture"].target, one["posture"].gain = [3.0], 5.0
        for _ in range(400):
            q = q + DT * one.step(q).v
        found.append(q)
        assert q == pytest.approx([1.0], abs=1e-6)
        assert q[0] <= 1.0 + 1e-12
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


# --- the table --------------------------------------------------------------------------------------


def test_the_table_shows_every_item_with_its_weight_and_unit(capsys: pytest.CaptureFixture[str]) -> None:
    one = controller("everything", "panda")
    one["hand"].weight, one["hand"].gain, one["hand"].mask = 0.125, 7.25, (1, 1, 1, 0, 0, 0)
    one["ball"].rate, one["limits"].enabled = 12.5, False
    print(one)
    head, columns, _, *lines = capsys.readouterr().out.splitlines()
    for text in ("panda", "7 degrees of freedom", f"dt {DT:g} s", "daqp (vm)", "m,"):
        assert text in head
    assert columns.split()[:4] == ["item", "kind", "level", "weight"]
    rows = {line.split()[0]: line.split() for line in lines}
    assert list(rows) == list(core_of(one).layout.blocks)
    for name, words in rows.items():
        entry = one.stack[name]
        assert words[1:3] == [type(entry.item).__name__, "0"]
        assert words[3] == (f"{one[name].weight:g}" if entry.is_task else "hard")
        units = {row.unit for row in core_of(one).layout.blocks[name].rows}
        assert units <= {word.rstrip(",") for word in words}
        assert words[-1] == ("no" if name == "limits" else "yes")
    assert rows["hand"][3:9] == ["0.125", "7.25", "1/s", "3", "of", "6"]
    assert rows["ball"][4:6] == ["12.5", "1/s"]

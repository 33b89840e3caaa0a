"""Run-time switches and numbers mean what the declaration would have meant: held to stacks without the item or row."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.backends import COMPILED
from tests.controller.stacks import DT, FRAMES, controller, everything, near_limits, randomise, robot
from tests.repeats import ALL, MORE
from wbc.api import Controller, Stack
from wbc.controller import core_of
from wbc.qp import QP
from wbc.tasks import CenterOfMass, Damping, Elbow, EndEffector, Obstacle, Posture


def without(stack: Stack, name: str) -> Stack:
    """The same stack declared without one item."""
    out = Stack(stack.robot, stack.dt, calm=stack.calm)
    for entry in stack.entries:
        if entry.name != name:
            out.add(entry.item, name=entry.name, weight=entry.weight)
    return out


def copy_values(source: Controller, target: Controller) -> None:
    """All run-time values, by name."""
    for name in core_of(target).layout.blocks:
        for value in target[name].names:
            setattr(target[name], value, getattr(source[name], value))


def same(one: QP, two: QP) -> None:
    """Equal problems; rows that are off may be there or not."""
    assert pytest.approx(two.H, rel=1e-12, abs=1e-14) == one.H
    assert one.g == pytest.approx(two.g, rel=1e-12, abs=1e-12)
    n = one.n
    assert np.array_equal(one.lower[:n], two.lower[:n])
    assert np.array_equal(one.upper[:n], two.upper[:n])
    rows = [
        np.column_stack([qp.A, qp.lower[n:], qp.upper[n:]])[np.isfinite(qp.lower[n:]) | np.isfinite(qp.upper[n:])]
        for qp in (one, two)
    ]
    assert np.array_equal(rows[0], rows[1])


@pytest.fixture(scope="module")
def full() -> Controller:
    """The linear model: there H is a sum over rows."""
    return controller("linear", "panda")


@pytest.mark.parametrize("name", [e.name for e in everything("panda").entries][:: 1 if MORE >= ALL else 2])
def test_disabled_is_as_if_not_declared(full: Controller, name: str) -> None:
    rng = np.random.default_rng(len(name))
    q, v = near_limits(full.stack.robot, rng), rng.normal(size=7)
    randomise(full, rng)
    for each in core_of(full).layout.blocks:
        full[each].enabled = True
    full[name].enabled = False
    smaller = without(full.stack, name).compile(backend="python")
    copy_values(full, smaller)
    full.step(q, v)
    smaller.step(q, v)
    for each in (full, smaller):
        core_of(each).tick.v_last[:] = v
    same(full.qp(), smaller.qp())
    # what is off is still measured
    if name in full.step(q, v).residuals:
        assert full.step(q, v).residuals[name].values.size == len(core_of(full).layout.blocks[name].rows)


def test_masked_rows_are_as_if_not_there(full: Controller) -> None:
    """Rows of tasks by the referee of the whole QP; here each row alone, of every item."""
    rng = np.random.default_rng(5)
    q, v = near_limits(full.stack.robot, rng), rng.normal(size=7)
    randomise(full, rng)
    for name, block in core_of(full).layout.blocks.items():
        full[name].enabled = True
        full[name].mask = 1.0
        if block.form == "task":
            full[name].weight = 1.0
    full.step(q, v)
    core_of(full).tick.v_last[:] = v
    whole = full.qp()
    for name, block in core_of(full).layout.blocks.items():
        for k in range(len(block.rows)):
            mask = np.ones(len(block.rows))
            mask[k] = 0.0
            full[name].mask = mask
            part = full.qp()
            if block.form == "task":
                full[name].mask = 1.0 - mask
                only = full.qp()
                full[name].enabled = False
                none = full.qp()
                full[name].enabled = True
                scale = np.abs(whole.H).max()
                assert np.abs((whole.H - part.H) - (only.H - none.H)).max() < 1e-12 * scale
                assert np.linalg.matrix_rank(only.H - none.H, tol=1e-9 * scale) <= 1
            elif block.form == "bounds":
                others = np.arange(7) != k
                assert np.array_equal(part.lower[:7][others], whole.lower[:7][others])
            else:
                row = 7 + block.start + k
                assert np.isneginf(part.lower[row])
                assert np.isposinf(part.upper[row])
                others = np.arange(whole.lower.size) != row
                assert np.array_equal(part.lower[others], whole.lower[others])
        full[name].mask = 1.0


@pytest.mark.parametrize("backend", ["python", COMPILED])
def test_weights_gains_and_rates_equal_those_declared(backend: str) -> None:
    """One controller with numbers set at run time, one that was declared with them."""
    bot, f = robot("panda"), FRAMES["panda"]
    one, two = Stack(bot, DT), Stack(bot, DT)
    for stack, w, gain, weights in ((one, 1.0, None, None), (two, 0.25, 3.5, (1, 2, 0, 0.5, 1, 3))):
        stack.add(EndEffector(f.tip, weights=weights, gain=gain), name="hand", weight=w)
        stack.add(Posture(), name="posture", weight=1e-3 * w)
    changed, declared = one.compile(backend=backend), two.compile(backend=backend)
    changed["hand"].weight, changed["hand"].gain, changed["posture"].weight = 0.25, 3.5, 0.25e-3
    changed["hand"].mask = (1, 2, 0, 0.5, 1, 3)
    target = pin.SE3(pin.exp3(np.array([0.1, 0.2, -0.3])), np.array([0.4, 0.2, 0.6]))
    rng = np.random.default_rng(0)
    for each in (changed, declared):
        each["hand"].target = target
    for _ in range(10):
        q = near_limits(bot, rng)
        for each in (changed, declared):
            each["posture"].target = bot.neutral
        assert np.array_equal(changed.step(q).v, declared.step(q).v)


def test_written_values_read_back() -> None:
    tick, rng = controller("everything", "talos"), np.random.default_rng(1)
    written = randomise(tick, rng)
    for name, values in written.items():
        for key, value in values.items():
            back = getattr(tick[name], key)
            if isinstance(value, pin.SE3):
                assert isinstance(back, pin.SE3)
                assert back.isApprox(value, 1e-15)
            else:
                assert np.array_equal(back, value)
                assert isinstance(back, type(value))
    # what is read cannot be written into
    with pytest.raises(ValueError, match="read-only"):
        tick["hand"].target.translation[:] = 0.0
    tick["posture"].target[:] = 0.0
    tick["hand"].mask[:] = 0.0
    assert tick["hand"].target.isApprox(written["hand"]["target"], 1e-15)
    assert np.array_equal(tick["posture"].target, written["posture"]["target"])
    assert np.array_equal(tick["hand"].mask, written["hand"]["mask"])
    # and so is what was written
    mine = np.array(written["posture"]["target"])
    tick["posture"].target = mine
    mine[:] = 0.0
    assert np.array_equal(tick["posture"].target, written["posture"]["target"])


def test_first_configuration_is_the_default_target() -> None:
    """A fresh controller stays where it is, every task and hold; a moved robot is pulled back."""
    tick = controller("everything", "ur5")
    bot, rng = tick.stack.robot, np.random.default_rng(3)
    q = near_limits(bot, rng, share=0.0)
    for name in ("ball", "floor", "limits", "fixed"):
        tick[name].enabled = False
    step = tick.step(q)
    assert np.abs(step.v).max() < 1e-9
    assert all(np.abs(r.values).max() < 1e-12 for r in step.residuals.values())
    data = bot.model.createData()
    pin.framesForwardKinematics(bot.model, data, q)
    assert tick["hand"].target.isApprox(data.oMf[bot.model.getFrameId("tool0")], 1e-12)
    assert tick["com"].target == pytest.approx(pin.centerOfMass(bot.model, data, q))
    assert np.array_equal(tick["posture"].target, q)
    moved = q + 0.05
    assert np.abs(tick.step(moved).v).max() > 1e-3
    assert np.array_equal(tick["posture"].target, q)  # taken once
    # a reset takes those again that nobody has set, and only those
    tick["com"].target = (0.1, 0.2, 0.3)
    tick.reset(moved)
    assert np.array_equal(tick["posture"].target, moved)
    assert tick["com"].target == pytest.approx([0.1, 0.2, 0.3])
    tick.reset()
    tick.step(q)
    assert np.array_equal(tick["posture"].target, q)
    assert tick["com"].target == pytest.approx([0.1, 0.2, 0.3])


def test_default_rate_fits_the_longest_tick() -> None:
    stack = Stack(robot("panda"), dt=0.1).add(Obstacle(everything("panda")["ball"].item.shape), name="ball")
    tick = stack.compile(backend="python")
    assert tick["ball"].rate * stack.dt_range[1] <= 1.0
    assert tick["ball"].rate == pytest.approx(5.0)


def test_reset_starts_anew() -> None:
    """After any history a reset gives the bits of a fresh controller with the same values."""
    for backend in ("python", COMPILED):
        used, fresh = (controller("arm", "panda", backend=backend) for _ in range(2))
        bot, rng = used.stack.robot, np.random.default_rng(2)
        for _ in range(20):
            used.step(near_limits(bot, rng), rng.normal(size=7), DT * rng.uniform(0.3, 1.9))
        v = rng.normal(size=7)
        path = [near_limits(bot, rng) for _ in range(5)]
        for each in (used, fresh):
            each.reset(path[0], v)
        assert np.array_equal(used.last_command, v)
        for q in path:
            assert used.step(q)._data == fresh.step(q)._data
        used.reset()
        assert not used.last_command.any()


def test_acceleration_counts_from_the_last_command_or_from_v() -> None:
    tick = controller("arm", "panda", backend=COMPILED)
    bot = tick.stack.robot
    q = bot.neutral
    tick.reset(q)
    tick["hand"].target = pin.SE3(np.eye(3), np.array([5.0, 5.0, 5.0]))
    reach = bot.limits.acceleration * DT
    first = tick.step(q)
    assert np.abs(first.v).max() == pytest.approx(reach.max())
    second = tick.step(q)
    assert np.abs(second.v).max() == pytest.approx(2 * reach.max())
    assert np.array_equal(tick.last_command, second.v)
    measured = np.full(7, 0.01)
    third = tick.step(q, measured)
    assert (np.abs(third.v - measured) <= reach + 1e-15).all()
    # a longer tick reaches further, a shorter one less, and the declared one is back afterwards
    for dt in (tick.stack.dt_range[1], tick.stack.dt_range[0], DT):
        step = tick.step(q, measured, dt)
        assert np.abs(step.v - measured).max() == pytest.approx(10.0 * dt)
    assert np.abs(tick.step(q, measured).v - measured).max() == pytest.approx(10.0 * DT)


def test_margins_ahead_are_the_margins_of_the_next_state() -> None:
    """h(q (+) v dt), the moving ball moved on: held to the margins that the next step measures."""
    for name in ("panda", "kinova", "talos"):
        tick, rng = controller("everything", name), np.random.default_rng(7)
        bot = tick.stack.robot
        for _ in range(4):
            q, v, dt = near_limits(bot, rng), rng.normal(size=bot.nv), DT * rng.uniform(0.25, 2.0)
            randomise(tick, rng)
            step = tick.step(q, v, dt)
            for obstacle in ("ball", "floor"):
                pose, twist = tick[obstacle].pose, tick[obstacle].velocity
                turn = pin.exp3(twist[3:] * dt) @ pose.rotation
                tick[obstacle].pose = pin.SE3(turn, pose.translation + twist[:3] * dt)
            after = tick.step(pin.integrate(bot.model, q, step.v * dt), v, dt)
            for obstacle in ("ball", "floor"):
                assert step.margins_ahead[obstacle] == pytest.approx(after.margins[obstacle], abs=1e-10)


def residual_items() -> list[tuple[Any, str]]:
    f = FRAMES["panda"]
    return [
        (EndEffector(f.tip), "m"),
        (EndEffector(f.tip, kind="orientation"), "rad"),
        (Elbow(f.middle), "m"),
        (CenterOfMass(), "m"),
        (Posture(), "rad"),
        (Damping(), "rad"),
    ]


@pytest.mark.parametrize(("item", "unit"), residual_items(), ids=lambda x: getattr(x, "kind", "") or type(x).__name__)
def test_residuals_name_rows_and_units(item: Any, unit: str) -> None:
    tick = Stack(robot("panda"), DT).add(item, name="it").compile(backend="python")
    residual = tick.step(robot("panda").neutral).residuals["it"]
    rows = item.rows(robot("panda"))
    assert residual.labels == tuple(r.label for r in rows)
    assert residual.units == tuple(r.unit for r in rows)
    assert unit in residual.units
    assert residual.norm(unit) == pytest.approx(0.0, abs=1e-12)
    assert unit in str(residual)

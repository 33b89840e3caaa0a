"""Closed-loop checks of tasks. Each returns its figures and asserts what the class promises."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import Array, length
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import FEWER, STARTS, anywhere, machine, near
from tests.closed_loop.subjects import SUBJECTS, Subject, damping_weights, task_items
from wbc.tasks import Posture

DT, GAIN, TICKS = 0.02, 5.0, 110

#: Starts and targets have rows whose smallest singular value is above this [m or rad per rad]
LEAST_SINGULAR_VALUE = 0.1

Figures = dict[str, float]


def build(name: str) -> Loop:
    """The stack of all tasks on a robot."""
    return Loop(machine(name), task_items(name, machine(name)), DT, name)


def slope(loop: Loop, subject: Subject, q: Array) -> Array:
    """Derivative of the measured error, which is zero at its own target, by differences ahead, rows x nv."""
    eyes, f, model, step = loop.eyes, loop.frames, loop.robot.model, 1e-6
    target = subject.measure(eyes, f, q)
    moved = (pin.integrate(model, q, direction) for direction in step * np.eye(model.nv))
    return np.column_stack([subject.error(eyes, f, ahead, target) for ahead in moved]) / step


def regular(loop: Loop, subject: Subject, q: Array) -> bool:
    """Away from singular configurations of the task, and from where it fades."""
    if not subject.usable(loop.eyes, loop.frames, q):
        return False
    return float(np.linalg.svd(slope(loop, subject, q), compute_uv=False)[-1]) > LEAST_SINGULAR_VALUE


def pairs(
    loop: Loop, subject: Subject, seed: int, reach: float | None = None, count: int = STARTS
) -> Iterator[tuple[Array, Array]]:
    """Random starts, each with a configuration near it that the target is taken from; both regular."""
    rng, found, drawn = np.random.default_rng(seed), 0, 0
    while found < count:
        drawn += 1
        assert drawn < 40 * count, "hardly any regular configuration"
        q = anywhere(loop.robot, rng)
        goal = near(loop.robot, rng, q, reach or subject.reach)
        if regular(loop, subject, q) and regular(loop, subject, goal):
            found += 1
            yield q, goal


def errors(loop: Loop, subject: Subject, path: Array, target: Any) -> Array:
    return np.array([subject.error(loop.eyes, loop.frames, q, target) for q in path])


def decay(loop: Loop, name: str, seed: int = 1, subjects: Mapping[str, Subject] = SUBJECTS) -> Figures:
    """Alone, the error of every row falls by 1 - gain dt a tick, on a straight line in the class's coordinates.

    The first ticks bend the line by the curvature of the robot; the last show the bare rate.
    """
    subject = subjects[name]
    loop.only(name)
    loop[name].gain = GAIN
    worst = {"left": 0.0, "bend": 0.0, "rate": 0.0, "unsolved": 0.0}
    every = 10
    powers = (1 - GAIN * DT) ** np.arange(0, TICKS + 1, every)
    for q, goal in pairs(loop, subject, seed, count=subject.starts):
        target = subject.measure(loop.eyes, loop.frames, goal)
        loop[name].target = target
        run = loop.run(q, TICKS)
        worst["unsolved"] += run.unsolved
        e = errors(loop, subject, run.q[::every], target)
        sizes = np.linalg.norm(e, axis=1)
        worst["left"] = max(worst["left"], sizes[-1])
        worst["bend"] = max(worst["bend"], np.linalg.norm(e - powers[:, None] * e[0], axis=1).max() / sizes[0])
        last = (sizes[-1] / sizes[-5]) ** (1 / (4 * every))
        worst["rate"] = max(worst["rate"], abs(last - (1 - GAIN * DT)) / (GAIN * DT))
        assert worst["left"] < 1e-4, worst
        assert worst["bend"] < 0.02, worst
        assert worst["rate"] < 1e-4, worst
        assert worst["unsolved"] == 0, worst
    return worst


def feedforward(target: Any, later: Any, step: float) -> Any:
    """Rate of a target from its values ``step`` apart."""
    if isinstance(target, pin.SE3):
        turn = pin.log3(later.rotation @ target.rotation.T)
        return np.concatenate([later.translation - target.translation, turn]) / step
    if np.ndim(target) == 2:
        return pin.log3(later @ target.T) / step
    return (later - target) / step


def tracking(
    loop: Loop, name: str, seed: int = 2, ticks: int = 60, subjects: Mapping[str, Subject] = SUBJECTS
) -> Figures:
    """A moving target is followed with a small part of the lag, speed over gain, that a loop without its rate has.

    What is left is of first order in dt: each tick follows the tangent of a curve.
    """
    subject, eyes, f = subjects[name], loop.eyes, loop.frames
    model, step, settled, omega = loop.robot.model, 1e-6, 20, 4.0
    loop.only(name)
    loop[name].gain = GAIN
    worst = {"lag": 0.0, "unsolved": 0.0}
    for q, goal in pairs(loop, subject, seed, count=FEWER):
        along = pin.difference(model, q, goal)

        def at(time: float, q: Array = q, along: Array = along) -> Any:
            return subject.measure(eyes, f, pin.integrate(model, q, math.sin(omega * time) * along))

        times = DT * np.arange(ticks + 1)
        targets = [at(t) for t in times]
        if subject.cls is Posture:
            rates = list(omega * np.cos(omega * times)[:, None] * along)
        else:
            rates = [feedforward(y, at(t + step), step) for y, t in zip(targets, times, strict=True)]

        def aim(k: int, _: Array, targets: list[Any] = targets, rates: list[Any] = rates) -> None:
            loop[name].target = targets[k]
            setattr(loop[name], subject.rate, rates[k])

        run = loop.run(q, ticks, before=aim)
        worst["unsolved"] += run.unsolved
        left = max(np.linalg.norm(subject.error(eyes, f, run.q[k], targets[k])) for k in range(settled, ticks + 1, 8))
        worst["lag"] = max(worst["lag"], float(left) * GAIN / max(float(np.linalg.norm(r)) for r in rates))
        assert worst["lag"] < 0.08, worst
        assert worst["unsolved"] == 0, worst
    setattr(loop[name], subject.rate, 0.0 * np.asarray(rates[0]))
    return worst


def within_limits(loop: Loop, name: str, seed: int = 3) -> Figures:
    """Targets up to 0.8 rad away in every joint, with joint limits and a slight wish to rest: most are reached, some
    starts end at a limit or a singular pose, and no joint passes its limit.
    """
    subject, eyes, f = SUBJECTS[name], loop.eyes, loop.frames
    loop.only(name, "limits", "rest")
    loop[name].gain, loop["rest"].weight = GAIN, 1e-6
    limited = [k for k in loop.robot.position_index if k >= 0]
    model = loop.robot.model
    low, high = (np.array(a)[limited] for a in (model.lowerPositionLimit, model.upperPositionLimit))
    figures = {"reached": 0.0, "passed": 0.0, "at a limit": 0.0, "unsolved": 0.0}
    for q, goal in pairs(loop, subject, seed, 0.8, FEWER):
        target = subject.measure(eyes, f, goal)
        loop[name].target = target
        loop["rest"].target = q
        run = loop.run(q, TICKS + 40)
        figures["unsolved"] += run.unsolved
        room = np.minimum(run.q[:, limited] - low, high - run.q[:, limited])
        figures["passed"] = max(figures["passed"], -float(room.min()))
        figures["at a limit"] += bool(room.min() < 1e-3)
        figures["reached"] += length(subject.error(eyes, f, run.q[-1], target)) < 1e-4
        assert figures["passed"] <= 1e-12, figures
        assert figures["unsolved"] == 0, figures
    assert figures["reached"] >= 0.95 * FEWER, figures
    return figures


def damping(loop: Loop, name: str = "damping", seed: int = 4) -> Figures:
    """Beside a posture task of weight 1 and gain g, damping of weight w slows a joint's return to g / (1 + w)."""
    model, rng = loop.robot.model, np.random.default_rng(seed)
    loop.only(name, "rest")
    loop["rest"].weight, loop["rest"].gain = 1.0, GAIN
    base, factor = loop.robot.base_nv, 1 - GAIN * DT / (1 + damping_weights(loop.robot))
    worst = {"bend": 0.0, "base": 0.0}
    for _ in range(STARTS):
        q = anywhere(loop.robot, rng)
        goal = near(loop.robot, rng, q, 0.5)
        loop["rest"].target = goal
        run = loop.run(q, 40)
        start = pin.difference(model, goal, q)
        for k in (1, 10, 40):
            bend = (pin.difference(model, goal, run.q[k]) - factor**k * start)[base:]
            worst["bend"] = max(worst["bend"], float(np.abs(bend).max()))
        worst["base"] = max(worst["base"], float(np.abs(pin.difference(model, q, run.q[-1])[:base]).max(initial=0.0)))
        assert worst["bend"] < 1e-7, worst
        assert worst["base"] < 1e-12, worst
    return worst


def plane_rate(loop: Loop, name: str = "rate of the plane", seed: int = 5) -> Figures:
    """The body that carries the axis turns about the line at feedforward + gain target, tick by tick.

    Measured from successive rotations, which differ from the rate at the start of the tick by first order in dt.
    """
    rng, f, eyes = np.random.default_rng(seed), loop.frames, loop.eyes
    loop.only(name)
    loop[name].gain = GAIN
    worst, measured, found = {"rate": 0.0}, 0, 0
    while found < STARTS:
        q = anywhere(loop.robot, rng)
        if not eyes.plane_is_clear(q, f.plane, f.axis):
            continue
        found += 1
        loop[name].target, loop[name].feedforward = rng.uniform(-0.1, 0.1), rng.uniform(-0.5, 0.5)
        wanted = loop[name].feedforward + GAIN * loop[name].target
        run = loop.run(q, 20)
        for before, after in zip(run.q[:-1], run.q[1:], strict=True):
            if eyes.plane_is_clear(before, f.plane, f.axis):
                measured += 1
                rate = eyes.plane_rate(before, after, DT, f.plane, f.axis)
                worst["rate"] = max(worst["rate"], abs(rate - wanted))
        assert worst["rate"] < 5e-3, worst
    worst["measured"] = measured
    assert measured > 18 * STARTS, worst
    return worst

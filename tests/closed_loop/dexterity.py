"""Closed loops of the measure of manipulability, from singular values of Pinocchio's Jacobians."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import Array, Eyes
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import anywhere, machine
from tests.closed_loop.subjects import Subject
from tests.closed_loop.tasks import DT
from tests.tasks.robots import FRAMES, Frames
from wbc.robot import Robot
from wbc.tasks import Manipulability

#: What rows in metres are divided by [m], and the floor under singular values that the class states
LENGTH, FLOOR = 0.3, 1e-4

#: Rows of the Jacobian
ROWS = {"position": slice(0, 3), "orientation": slice(3, 6), "pose": slice(0, 6)}

Figures = dict[str, float]


def mount(robot: Robot) -> str:
    """The body that the arm is mounted on."""
    return "torso_2_link" if robot.base == "floating" else "world"


def singular_values(eyes: Eyes, f: Frames, q: Array, kind: str) -> Array:
    """Of the tip's Jacobian as seen from the body that the arm is mounted on, in the tip's axes."""
    model, base = eyes.model, mount(eyes.robot)
    pin.computeJointJacobians(model, eyes.data, q)
    pin.updateFramePlacements(model, eyes.data)
    tip = eyes.data.oMf[model.getFrameId(f.tip)]
    jacobian = pin.getFrameJacobian(model, eyes.data, model.getFrameId(f.tip), pin.LOCAL).copy()
    if base != "world":
        number = model.getFrameId(base)
        carried = pin.getFrameJacobian(model, eyes.data, number, pin.LOCAL)
        jacobian -= tip.actInv(eyes.data.oMf[number]).action @ carried
    jacobian[:3] /= LENGTH
    return np.array(np.linalg.svd(jacobian[ROWS[kind]], compute_uv=False))


def measure(kind: str) -> Any:
    def value(eyes: Eyes, f: Frames, q: Array) -> float:
        return math.sqrt(float(np.prod(singular_values(eyes, f, q, kind) ** 2 + FLOOR**2)))

    return value


def subject(kind: str, form: str) -> Subject:
    value = measure(kind)

    def error(eyes: Eyes, f: Frames, q: Array, target: float) -> Array:
        here = value(eyes, f, q)
        return np.array([math.log(here / target) if form == "log" else here - target])

    return Subject(
        Manipulability,
        lambda f, robot: Manipulability(f.tip, kind=kind, relative_to=mount(robot), form=form, length=LENGTH),
        value,
        error,
        usable=lambda eyes, f, q: singular_values(eyes, f, q, kind)[-1] > 0.15,
        reach=0.15,
    )


SUBJECTS: dict[str, Subject] = {
    "positions": subject("position", "linear"),
    "poses, log": subject("pose", "log"),
}


def build(name: str) -> Loop:
    """Both forms, each with its own rows."""
    items = {key: s.declare(FRAMES[name], machine(name)) for key, s in SUBJECTS.items()}
    return Loop(machine(name), items, DT, name)


def climb(loop: Loop, name: str, seed: int = 41, count: int = 8, ticks: int = 400) -> Figures:
    """A target beyond reach, at a gain of 1/dt: w never falls, and ends where it has no slope, without a sign flip."""
    value, rng = SUBJECTS[name].measure, np.random.default_rng(seed)
    loop.only(name)
    loop[name].gain, loop[name].target = 1 / DT, 100.0
    figures: Figures = {"fell": 0.0, "slope": 0.0, "flips": 0.0, "late": 0.0, "gained": np.inf, "unsolved": 0.0}
    found = 0
    while found < count:
        q = anywhere(loop.robot, rng, share=0.5)
        if not SUBJECTS[name].usable(loop.eyes, loop.frames, q):
            continue
        found += 1
        run = loop.run(q, ticks)
        figures["unsolved"] += run.unsolved
        w = np.array([value(loop.eyes, loop.frames, x) for x in run.q])
        figures["fell"] = max(figures["fell"], float(np.max(w[:-1] - w[1:]) / w[0]))
        figures["gained"] = min(figures["gained"], w[-1] / w[0])
        late = run.v[-100:]
        figures["late"] = max(figures["late"], float(np.abs(late).max()))
        flips = (late[1:] * late[:-1] < 0) & (np.abs(late[1:]) > 1e-4)
        figures["flips"] += int(flips.sum())
        figures["slope"] = max(figures["slope"], float(np.abs(slope(loop, value, run.q[-1])).max()) / w[-1])
    assert figures["fell"] < 1e-9, figures
    assert figures["slope"] < 5e-3, figures
    assert figures["flips"] == 0, figures
    assert figures["late"] < 0.1, figures
    assert figures["gained"] > 1.02, figures
    assert figures["unsolved"] == 0, figures
    return figures


def slope(loop: Loop, value: Any, q: Array, step: float = 1e-5) -> Array:
    """dw/dq by central differences."""
    out = []
    for direction in step * np.eye(loop.robot.nv):
        ahead, behind = (pin.integrate(loop.robot.model, q, s * direction) for s in (1.0, -1.0))
        out.append((value(loop.eyes, loop.frames, ahead) - value(loop.eyes, loop.frames, behind)) / (2 * step))
    return np.array(out)

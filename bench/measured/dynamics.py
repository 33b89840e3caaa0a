"""The published arm, its task and its controllers, and today's beside them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bench.sheet import Sheet
from wbc.errors import RangeError
from wbc.motion_control.comparison import TrialCondition, compare
from wbc.motion_control.motion import TorqueController
from wbc.motion_control.trial import AWAY
from wbc.published.newton_euler import (
    Adaptive,
    DecoupledArm,
    DecoupledTwo,
    DriveTrain,
    Linearised,
    Nominal,
    Rigid,
    simulate,
)
from wbc.published.newton_euler.comparison import PUBLISHED, published_scenario
from wbc.published.newton_euler.simulation import PLANTS
from wbc.published.newton_euler.three_link import ELECTRIC, HYDRAULIC, MOTOR, arm, task, tip


def parts() -> dict[str, Sheet | str]:
    """Tracking on the three plants; on other motors; with a payload that nobody knows of."""
    return {"tracking": _tracking(), "drives": _drives(), "payload": _payload()}


def _tracking() -> Sheet:
    chosen, motion, drive, rows = arm(), task(), DriveTrain([MOTOR] * 3), []
    laws: dict[str, Callable[[], TorqueController]] = {
        "nominal torque": lambda: Nominal(chosen, motion),
        "1 linearised": lambda: Linearised(chosen, motion, 0.01),
        "2 decoupled": lambda: DecoupledTwo(motion, 0.01),
        "2 on all joints": lambda: DecoupledArm(Rigid(chosen.model), motion, 0.01),
        "3 adaptive": lambda: Adaptive(chosen, motion, 0.01),
    }
    scenario = published_scenario()
    for name in ("1 with stiff weights", "computed torque", "adaptive, last link", "one-step optimum", "torque stack"):
        maker = scenario.controllers[name]
        laws[name] = lambda maker=maker: maker(scenario.robot, motion, 0.01)
    for name, make in laws.items():
        cells = [name]
        for plant in PLANTS:
            run = simulate(chosen.model, make(), motion, plant=plant, drive=drive)
            off = max(np.linalg.norm(tip(q) - tip(motion(t)[0])) for q, t in zip(run.q, run.times, strict=True))
            cells.append(f"{1e3 * off:.3g}")
            if plant == "torque":
                more = [f"{error:.2g}" for error in run.largest]
        rows.append((*cells, *more))
    heads = ("controller", "listing [mm]", "torque [mm]", "motor [mm]", "joint 1 [rad]", "joint 2 [rad]", "joint 3 [m]")
    return Sheet("", heads, rows)


def _drives() -> Sheet:
    """Largest distance of the tip [mm] on motors of second and of third order."""
    chosen, motion, scenario, rows = arm(), task(), published_scenario(), []
    for name in (*PUBLISHED, "computed torque", "one-step optimum"):
        cells = [name]
        for motor in (MOTOR, ELECTRIC, HYDRAULIC):
            law = scenario.controllers[name](scenario.robot, motion, 0.01)
            try:
                run = simulate(chosen.model, law, motion, plant="motor", drive=DriveTrain([motor] * 3))
            except RangeError:
                cells.append("ran away")
                continue
            off = max(np.linalg.norm(tip(q) - tip(motion(t)[0])) for q, t in zip(run.q, run.times, strict=True))
            cells.append(f"{1e3 * off:.3g}" if off < AWAY else "ran away")
        rows.append(tuple(cells))
    return Sheet("", ("controller", "as printed [mm]", "with inductance [mm]", "hydraulic [mm]"), rows)


def _payload() -> Sheet:
    rows, scenario = [], published_scenario()
    slow, fast = (list(compare(scenario, TrialCondition(scenario.payload, rate=rate))) for rate in (100.0, 1000.0))
    for one, other in zip(slow, fast, strict=True):
        cells = [one.name]
        for found in (one, other):
            off = (found.largest, found.residual)
            cells += ["ran away", ""] if found.trial.away else [f"{1e3 * distance:.3g}" for distance in off]
        mass = "" if other.mass is None else f"{other.mass[0]:.3f} +- {other.mass[1]:.3f}"
        rows.append((*cells, f"{other.microseconds:.0f}", mass))
    heads = ("controller", "100 Hz [mm]", "at the end [mm]", "1 kHz [mm]", "at the end [mm]", "a command [us]",
             "payload learned [kg]")  # fmt: skip
    return Sheet("", heads, rows)

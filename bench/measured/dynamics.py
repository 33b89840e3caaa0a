"""The published arm, its task and its controllers, and some of today beside them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bench.sheet import Sheet
from wbc.motion_control.motion import TorqueController
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
from wbc.published.newton_euler.comparison import published_scenario
from wbc.published.newton_euler.simulation import PLANTS
from wbc.published.newton_euler.three_link import MOTOR, arm, task, tip


def parts() -> dict[str, Sheet | str]:
    """Tracking on the three plants."""
    return {"tracking": _tracking()}


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

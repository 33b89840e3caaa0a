"""Inertias of simulated robots from motions that show much, and from random ones."""

from __future__ import annotations

import numpy as np

from bench.sheet import Sheet
from wbc.identification.experiment import experiment
from wbc.robots import load

ROBOTS = ("ur5", "panda", "xarm7")


def parts() -> dict[str, Sheet | str]:
    """What can be known, what the motion shows, and torques that are not explained."""
    rows = []
    for name in ROBOTS:
        done = experiment(load(name), tries=150)
        found, motion = done.found, done.motion
        share = done.check[0] / done.check[1]
        errors = float(np.sqrt((done.errors**2).mean()))
        rows.append((
            name, f"{found.base.count} of {len(found.parameters)}", f"{motion.law.duration:.1f}",
            f"{motion.score - motion.first:.1f}", f"{found.base.condition:.0f}",
            f"{100 * share.min():.1f} to {100 * share.max():.1f}", f"{errors:.2f}",
        ))  # fmt: skip
    heads = ("robot", "parameters", "motion [s]", "log det above random", "condition", "torques not explained [%]",
             "errors [deviations]")  # fmt: skip
    return {"robots": Sheet("", heads, rows)}

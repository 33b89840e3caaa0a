"""Targets two metres out of reach: how arms come to rest, with the curvature and with the linear model."""

from __future__ import annotations

import numpy as np

from bench.sheet import Sheet
from tests.calm.best import best, random_starts
from tests.calm.scenes import built, machine, run, still, tip_pose
from tests.calm.test_out_of_reach import DIRECTIONS, far_target

GAINS = (1.0, 10.0, 50.0, None)


def parts() -> dict[str, Sheet | str]:
    """A row an arm and gain."""
    rows = []
    for name in DIRECTIONS:
        robot, target = machine(name), far_target(name, DIRECTIONS[name][0])
        _, distance = best(robot, name, target, "pose", random_starts(robot, 20))
        for gain in GAINS:
            dt, cells = 0.02 if gain == 1.0 else 0.01, []
            for calm in (True, False):
                done = run(built(name, dt, calm=calm), 1.0 / dt if gain is None else gain, still(target), 1000)
                off = (
                    float(np.linalg.norm(tip_pose(robot, done.q[-1], name).translation - target.translation)) - distance
                )
                cells += [str(done.flips(100, 1e-9)), f"{np.abs(done.v[900:]).max():.1e}", f"{1e3 * off:+.2f}"]
            rows.append((name.replace("_", " "), "1/dt" if gain is None else f"{gain:g}", *cells))
    own = ("flips", "speed [rad/s]", "distance [mm]")
    return {"rest": Sheet("", ("arm", "gain [1/s]", *own, *(f"{c}, linear model" for c in own)), rows)}

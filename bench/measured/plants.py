"""One walk on servos that are slower and slower: how it ends, and what the external checker says of it."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import wbc
from bench.sheet import Sheet
from tests.simulation.lagging import LaggingPlant
from wbc.walking import cylinder
from wbc.walking.body_path import grid_path
from wbc.walking.checker import check_walk
from wbc.walking.loop.stack import WalkStack
from wbc.walking.loop.walk import Tick, Walk
from wbc.walking.planner.planner import plan_walk
from wbc.walking.run.recording import WalkRecorder

COLUMNS = ("lag, ms", "delay, ms", "noise, rad", "end", "slip of held hands", "body off", "external checker")
#: Lag [s], delay [ms] and noise [rad]
SERVOS = ((0.001, 0, 0.0), (0.01, 0, 0.0), (0.02, 5, 0.0), (0.02, 5, 1e-5), (0.02, 5, 1e-4), (0.03, 10, 0.0),
          (0.05, 10, 0.0))  # fmt: skip


def parts() -> dict[str, Sheet | str]:
    """A row for each servo."""
    machine, structure = wbc.robots.walker(), cylinder(rigid=True)
    stack = WalkStack(machine, structure, collisions=False)
    plan, rows = plan_walk(machine, structure, grid_path([(13, 9), (13, 14)], 0.1016)), []
    for lag, delay, noise in SERVOS:
        walk = Walk(machine, structure, plan, stack=stack, plant=LaggingPlant(machine.robot, lag, delay, noise))
        recorder, worst = WalkRecorder(walk), [0.0, 0.0]

        def keep(tick: Tick, recorder: WalkRecorder = recorder, worst: list[float] = worst) -> None:
            recorder.tick(tick)
            worst[:] = max(worst[0], tick.slip), max(worst[1], tick.body_error)

        end = walk.run(keep)
        with TemporaryDirectory() as folder:
            report = check_walk(recorder.log()[0], machine.urdf(Path(folder) / "robot.urdf"), structure)
        kinds = ", ".join(finding.kind for finding in report.violations)
        slip, off = (f"{1e3 * length:.2g} mm" for length in worst)
        rows.append((f"{1e3 * lag:.0f}", str(delay), f"{noise:g}", f"{end} after {walk.time:.1f} s", slip, off,
                     kinds or "clean"))  # fmt: skip
    return {"servos": Sheet("", COLUMNS, rows)}

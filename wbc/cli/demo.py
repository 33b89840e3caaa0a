"""``wbc demo``: the main job."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import pinocchio as pin
import typer

from wbc import robots, shapes
from wbc.cli import options
from wbc.cli.session import Output, perform
from wbc.track.presets import preset
from wbc.track.setup import ElbowSwing, MovingObstacle, PathRun

#: The hand points down at (0.48, 0.42, 0.30) m, the elbow is up
START = (1.0579, 0.3132, -0.38, -1.7484, 0.1283, 2.0373, 1.4223)
#: Beside the arm, where the elbow swings
LAMP = (0.25, -0.32, 0.62)


def plan(duration: float = 12.0, rate: float = 200.0, solver: str = "daqp", backend: str = "auto") -> PathRun:
    """A Panda's hand goes round a ball of 0.12 m and back, while its elbow plane is commanded to swing by
    0.5 rad; a second ball of 0.10 m hangs where the elbow would have to go.
    """
    robot = robots.load("panda")
    tip = robot.frames["tip"]
    start = np.array(START)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, start)
    found = preset("around-obstacle", data.oMf[robot.model.getFrameId(tip)], duration, 0.12)
    ball, center = found.obstacles[0]
    return PathRun(
        robot,
        tip,
        found.path,
        "around-obstacle",
        start,
        dt=1.0 / rate,
        obstacles={
            "ball": MovingObstacle(ball, pin.SE3(np.eye(3), center)),
            "lamp": MovingObstacle(shapes.Sphere(0.10), pin.SE3(np.eye(3), np.array(LAMP))),
        },
        plane=ElbowSwing(0.5),
        solver=solver,
        backend=backend,
    )


def demo(
    output: options.RunFolder = Path("runs/demo"),
    duration: Annotated[float, typer.Option(help="Seconds.")] = 12.0,
    rate: options.Rate = 200.0,
    solver: options.Solver = "daqp",
    backend: options.Backend = "auto",
    log: options.LogFormat = "parquet",
    record: options.Record = True,
    plots: options.Plots = True,
) -> None:
    """Do the main job: a Panda follows a timed path round an obstacle with its elbow plane commanded."""
    perform(plan(duration, rate, solver, backend), Output(output, True, log, plots, record))

"""The demo: a Panda round a ball, with its elbow plane commanded."""

from __future__ import annotations

import numpy as np

from wbc import robots, shapes
from wbc.multibody import pin
from wbc.track.presets import preset
from wbc.track.setup import ElbowSwing, MovingObstacle, PathRun

#: The hand points down at (0.48, 0.42, 0.30) m, the elbow is up
START = (1.0579, 0.3132, -0.38, -1.7484, 0.1283, 2.0373, 1.4223)
#: Beside the arm, where the elbow swings
LAMP = (0.25, -0.32, 0.62)


def demo(duration: float = 12.0, rate: float = 200.0, solver: str = "daqp", backend: str = "auto") -> PathRun:
    """A Panda's hand goes round a ball of 0.12 m and back, while its elbow plane is commanded to swing by
    0.5 rad; a second ball of 0.10 m hangs where the elbow would have to go.
    """
    robot = robots.load("panda")
    tip, start = robot.frames["tip"], np.array(START)
    found = preset("around-obstacle", robot.pose(start, tip), duration, 0.12)
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

"""The direction that a scaled hand of a Panda keeps."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc
from bench.sheet import Sheet
from wbc.api import Stack
from wbc.tasks import EndEffector, JointLimits, Posture

TIP, DT = "panda_hand_tcp", 0.005
START = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])


def parts() -> dict[str, Sheet | str]:
    """A table."""
    return {"line": line()}


def tip(q: np.ndarray) -> pin.SE3:
    """The hand's pose."""
    model = wbc.robots.load("panda").model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return pin.SE3(data.oMf[model.getFrameId(TIP)])


def line() -> Sheet:
    """400 ticks to a target 0.53 m aside with joints of 0.3 rad/s."""
    robot = wbc.robots.load("panda").with_limits(velocity=0.3, acceleration=20.0)
    way, found = np.array([-0.15, 0.5, 0.1]), []
    for option in (False, True):
        stack = Stack(robot, DT)
        stack.add(EndEffector(TIP, kind="position"), name="hand", scaled=option)
        stack.add(Posture(), name="posture", weight=1e-3).add(JointLimits())
        controller, q = stack.compile(), START
        controller.reset(q)
        start = tip(q).translation
        controller["hand"].target = start + way
        beside, angle = 0.0, 0.0
        for _ in range(400):
            before = tip(q).translation
            q = pin.integrate(robot.model, q, controller.step(q).v * DT)
            here = tip(q).translation
            beside = max(beside, float(np.linalg.norm(np.cross(here - start, way)) / np.linalg.norm(way)))
            moved, asked = here - before, start + way - before
            if np.linalg.norm(moved) > 1e-6:
                cosine = moved @ asked / np.linalg.norm(moved) / np.linalg.norm(asked)
                angle = max(angle, float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))))
        found.append((f"{1e3 * beside:.2g} mm", f"{angle:.2g} degrees"))
    plain, kept = found
    return Sheet("", ("", "least squares", "scaled"), [
        ("furthest from the straight line", plain[0], kept[0]),
        ("angle between a step and the direction to the target, at most", plain[1], kept[1]),
    ])  # fmt: skip

"""What strict levels cost on a Panda."""

from __future__ import annotations

import numpy as np

import wbc
from bench.measured.ticks import median_us
from bench.sheet import Sheet, us
from wbc.api import Controller, Stack
from wbc.tasks import Elbow, EndEffector, JointLimits, Posture

START = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])


def parts() -> dict[str, Sheet | str]:
    """Hand, elbow and posture at one level and at three, in reach and with speed limits that bind."""
    rows = []
    for label, scale in (("nothing binds", 1.0), ("joint speeds bind", 0.02)):
        rows.append((label, *(us(median_us(controller(levels, scale), START)) for levels in ((0, 0, 0), (0, 1, 2)))))
    columns = ("hand, elbow and posture of a Panda: one tick, median [us]", "one level", "three levels")
    return {"cost": Sheet("", columns, rows)}


def controller(levels: tuple[int, int, int], velocity_scale: float) -> Controller:
    """The three tasks, with the hand on its way to a target 0.1 m off."""
    stack = Stack(wbc.robots.load("panda"), dt=0.005)
    stack.add(EndEffector("panda_hand_tcp", kind="position"), name="hand", level=levels[0])
    stack.add(Elbow("panda_link4"), name="elbow", level=levels[1])
    stack.add(Posture(), name="posture", weight=1e-3, level=levels[2])
    out = stack.add(JointLimits(), name="limits").compile(wait=True)
    out["limits"].velocity_scale = velocity_scale
    out.reset(START)
    out.step(START)
    out["hand"].target = out["hand"].target + 0.1
    return out

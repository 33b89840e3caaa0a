"""What soft rows and scaled tasks cost on a Panda, and what a scaled hand does."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import wbc
from bench.measured.ticks import median_us
from bench.sheet import Sheet, us
from wbc.api import Controller, Stack
from wbc.tasks import EndEffector, JointLimits, Posture

TIP, DT = "panda_hand_tcp", 0.005
START = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8])
COUNTS, PRICES = (10, 50, 150), (None, 10.0, 1e6)


def parts() -> dict[str, Sheet | str]:
    """Planes around a hand by number and price; scaled tasks by cost; the direction that they keep."""
    return {"planes": planes(), "scaled": scaled(), "line": line()}


def tip(q: np.ndarray) -> pin.SE3:
    """The hand's pose."""
    model = wbc.robots.load("panda").model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return pin.SE3(data.oMf[model.getFrameId(TIP)])


def planes() -> Sheet:
    """Random half-spaces around the hand, most of them far, some violated."""
    rows = []
    for count in COUNTS:
        cells = [us(median_us(among_planes(count, price), START)) for price in PRICES]
        rows.append((f"{count}", *cells))
    return Sheet(
        "", ("planes around the hand of a Panda: one tick, median [us]", "hard", "price 10", "price 10^6"), rows
    )


def among_planes(count: int, price: float | None) -> Controller:
    """A hand with a posture, and a polyhedron of so many sides."""
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = normals @ tip(START).translation - rng.uniform(0.05, 0.3, count)
    stack = Stack(wbc.robots.load("panda"), DT)
    stack.add(EndEffector(TIP), name="hand").add(Posture(), name="posture", weight=1e-3).add(JointLimits())
    item = wbc.tasks.WorkspacePolyhedron(TIP, normals=tuple(map(tuple, normals)), offsets=tuple(offsets))
    stack.add(item, name="planes", **({} if price is None else {"soft": price}))
    return moving(stack.compile())


def moving(controller: Controller) -> Controller:
    """With a target that is not reached, so that rows and limits matter."""
    controller.reset(START)
    hand = controller["hand"]
    hand.target = tip(START).translation + 0.1 if np.shape(hand.target) == (3,) else tip(START + 0.2)
    return controller


def scaled() -> Sheet:
    """A hand, its direction kept or not, with its posture at the same level or below."""
    rows = []
    for kind, label in (("position", "position of the hand"), ("pose", "pose of the hand")):
        cells = []
        for option, level in ((False, 0), (True, 0), (True, 1)):
            stack = Stack(wbc.robots.load("panda"), DT)
            stack.add(EndEffector(TIP, kind=kind), name="hand", scaled=option)
            stack.add(Posture(), name="posture", weight=1e-3, level=level).add(JointLimits())
            cells.append(us(median_us(moving(stack.compile()), START)))
        rows.append((label, *cells))
    return Sheet("", ("one tick, median [us]", "plain", "scaled", "scaled, posture at the level below"), rows)


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

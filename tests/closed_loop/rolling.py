"""Closed loops of vehicles on wheels: no slip at any contact, and wheel angles that tell where the vehicle went."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import Array, length
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import STARTS
from tests.rates import slip, touching
from tests.wheels import Vehicle, vehicle
from wbc.tasks import EndEffector, JointLimits, Posture, Rolling

DT, TICKS, GAIN = 0.02, 25, 10.0

Figures = dict[str, float]


def build(name: str) -> Loop:
    """The rolling rows, a task on the base, and a posture that pulls every joint, wheels as well."""
    known = vehicle(name)
    items = {
        "rolling": Rolling(known.wheels, gain=GAIN),
        "base": EndEffector(known.base),
        "rest": Posture(joints=known.robot.joint_names),
        "caps": JointLimits(acceleration=False),
    }
    return Loop(known.robot, items, DT, name)


def start(known: Vehicle, rng: np.random.Generator, reach: float) -> Array:
    """A base anywhere, joints within ``reach`` of neutral, wheels at any angle."""
    robot = known.robot
    free = np.where(np.array(robot.dof_units) == "m", 1.0, np.pi)
    spread = np.where(robot.position_index < 0, free, reach)
    if robot.base == "floating":
        spread[:6] = (1.0, 1.0, 0.0, 0.02, 0.02, 0.0)
    q = pin.integrate(robot.model, robot.neutral, spread * rng.uniform(-1.0, 1.0, robot.nv))
    at = robot.position_index
    held = np.flatnonzero(at >= 0)
    q[at[held]] = np.clip(q[at[held]], robot.limits.position_lower[held], robot.limits.position_upper[held])
    return q


def roll(loop: Loop, seed: int = 31) -> Figures:
    """While the base and all joints are pulled elsewhere, the point of each wheel that touches the ground stands still
    along what holds it, and wheels of legs come down to the ground by 1 - gain dt a tick, but for a thousandth of the
    robot's length a second that may be lost.
    """
    known, rng = vehicle(loop.known), np.random.default_rng(seed)
    legs = known.robot.base == "floating"
    wheels = [known.robot.dofs(wheel.joint).start for wheel in known.wheels]
    keys = ("slip", "fall", "left", "astray", "too fast", "unsolved")
    figures: Figures = dict.fromkeys(keys, 0.0) | {"moved": np.inf, "turned": np.inf}
    loop.only("rolling", "base", "rest", "caps")
    loop["rest"].weight = 1e-2
    for _ in range(STARTS):
        q, goal = start(known, rng, 0.05 if legs else 0.5), start(known, rng, 0.1 if legs else 0.5)
        here = loop.eyes.pose(q, known.base)
        aside = np.append(rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.02, 0.02) * legs)
        turn = pin.exp3(rng.uniform(-0.5, 0.5) * np.array([0.0, 0.0, 1.0]))
        loop["base"].target = pin.SE3(turn @ here.rotation, here.translation + aside)
        loop["rest"].target = goal
        ground = pin.SE3.Identity()
        if legs:
            ground.translation[2] = np.mean([touching(known.robot, w, ground, q)[0][2] for w in known.wheels])
        loop["rolling"].ground = ground
        run = loop.run(q, TICKS)
        figures["unsolved"] += run.unsolved
        speeds = [loop.eyes.velocity(a, b, DT) for a, b in pairwise(run.q)]
        for before, v in zip(run.q[:-1:4], speeds[::4], strict=True):
            figures["slip"] = max(figures["slip"], slips(known, ground, before, v))
        if legs:
            h = np.array([[touching(known.robot, w, ground, q)[0][2] for w in known.wheels] for q in run.q])
            h -= ground.translation[2]
            fall = np.abs(np.diff(h, axis=0) / DT + GAIN * h[:-1]) / known.robot.characteristic_length
            figures["fall"] = max(figures["fall"], float(fall.max()))
            figures["left"] = max(figures["left"], float(np.abs(h[-1]).max()))
        else:
            figures["astray"] = max(figures["astray"], astray(loop, known, run.q))
        fastest = np.abs(np.array(speeds)[:, wheels] / known.robot.limits.velocity[wheels]).max()
        figures["too fast"] = max(figures["too fast"], float(fastest) - 1)
        there = loop.eyes.pose(run.q[-1], known.base)
        figures["moved"] = min(figures["moved"], length(there.translation - here.translation))
        figures["turned"] = min(figures["turned"], float(np.abs(np.array(speeds)[:, wheels]).max()))
        assert figures["slip"] < 1e-8, figures
        assert figures["fall"] < 1.01e-3, figures
        assert figures["left"] < 1e-3, figures
        assert figures["astray"] < 1e-8, figures
        assert figures["too fast"] < 1e-9, figures
        assert figures["unsolved"] == 0, figures
    assert figures["moved"] > 1e-4, figures
    assert figures["turned"] > 1e-2, figures
    return figures


def slips(known: Vehicle, ground: pin.SE3, q: Array, v: Array) -> float:
    """Largest slip of a contact along what holds it [m/s]."""
    slipped, up = 0.0, np.array([0.0, 0.0, 1.0])
    for wheel in known.wheels:
        _, forwards = touching(known.robot, wheel, ground, q)
        moved = slip(known.robot, wheel, ground, q, v)
        if wheel.roller is None:
            slipped = max(slipped, length(moved[:2]))
        else:
            roller = pin.AngleAxis(wheel.roller, up).toRotationMatrix() @ forwards
            slipped = max(slipped, abs(float(roller @ moved)))
    return slipped


def astray(loop: Loop, known: Vehicle, path: Array) -> float:
    """Distance between where the base went and where the turns of its wheels alone say, in m and rad."""
    assert known.twist is not None
    wheels = [known.robot.dofs(wheel.joint).start for wheel in known.wheels]
    place = loop.eyes.pose(path[0], known.base)
    for before, after in pairwise(path):
        forwards, sideways, turn = known.twist(np.array(pin.difference(known.robot.model, before, after))[wheels])
        place = place * pin.exp6(pin.Motion(np.array([forwards, sideways, 0.0, 0.0, 0.0, turn])))
    off = place.actInv(loop.eyes.pose(path[-1], known.base))
    return float(np.abs(pin.log6(off).vector).max())

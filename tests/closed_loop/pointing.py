"""Closed loops of axes, cameras, distances and momentum, in a stack of their own; judged with Pinocchio and numpy."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from tests.closed_loop import tasks
from tests.closed_loop.eyes import Array, Eyes, cross, length
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import FEWER, STARTS, anywhere, machine
from tests.closed_loop.subjects import Subject
from tests.closed_loop.tasks import DT, GAIN, TICKS, Figures
from tests.tasks.robots import FRAMES, Frames
from wbc.tasks import AxisAlign, Distance, Item, LookAt, Momentum

#: Of the frames that point: the axis, what turns it round, the point that a camera sits at
AXIS, AROUND, OFFSET = (0.0, -1.0, 2.0), (1.0, 1.0, 0.0), (0.1, -0.2, 0.05)
UNIT = np.array(AXIS) / math.sqrt(5.0)
FIRST = np.array((1.0, 1.0, 0.0)) - UNIT * (UNIT @ np.array((1.0, 1.0, 0.0)))
FIRST = FIRST / length(FIRST)

#: How far ahead of a camera its targets are [m], and the point that a distance is measured from, in the world
AHEAD, CENTER = 0.8, np.array([0.3, -0.4, 1.5])


def shortest(direction: Array, axis: Array) -> Array:
    """Rotation vector of the shortest turn from a direction to a unit vector."""
    turn = cross(direction, axis)
    size = length(turn)
    return math.atan2(size, float(direction @ axis)) / size * turn if size > 0.0 else turn


def across(direction: Array) -> Array:
    """3x2, two unit vectors that are perpendicular to a direction and to each other."""
    return np.linalg.svd(direction[None])[2][1:].T


def axis_seen(eyes: Eyes, f: Frames, q: Array, base: str) -> Array:
    """The axis of the tip in the axes of the base."""
    own, reference = eyes.poses(q, f.tip, base)
    return np.array(reference.rotation.T @ own.rotation @ UNIT)


def sight(eyes: Eyes, f: Frames, q: Array, base: str, target: Array) -> tuple[Array, Array]:
    """(line of sight to a target [m], rotation of the camera's frame), world axes."""
    own, reference = eyes.poses(q, f.tip, base)
    return reference.act(target) - own.act(np.array(OFFSET)), own.rotation


def sight_error(eyes: Eyes, f: Frames, q: Array, base: str, target: Array) -> Array:
    away, rotation = sight(eyes, f, q, base, target)
    turn = shortest(away / length(away), rotation @ UNIT)
    return np.column_stack([FIRST, cross(UNIT, FIRST)]).T @ rotation.T @ turn


def ahead(eyes: Eyes, f: Frames, q: Array, base: str) -> Array:
    own, reference = eyes.poses(q, f.tip, base)
    return np.array(reference.actInv(own.act(np.array(OFFSET) + AHEAD * UNIT)))


def gap(eyes: Eyes, f: Frames, q: Array, base: str) -> float:
    own, reference = eyes.poses(q, f.tip, base)
    other = CENTER if base == "world" else reference.translation
    return length(own.act(np.array(OFFSET)) - other)


def base_of(f: Frames, moving: bool) -> str:
    return f.base if moving else "world"


def align_subject(moving: bool) -> Subject:
    return Subject(
        AxisAlign,
        lambda f, robot: AxisAlign(f.tip, AXIS, relative_to=base_of(f, moving), around=AROUND),
        lambda eyes, f, q: axis_seen(eyes, f, q, base_of(f, moving)),
        lambda eyes, f, q, t: across(t).T @ shortest(t, axis_seen(eyes, f, q, base_of(f, moving))),
    )


def sight_subject(moving: bool) -> Subject:
    return Subject(
        LookAt,
        lambda f, robot: LookAt(f.tip, AXIS, OFFSET, relative_to=base_of(f, moving), around=AROUND),
        lambda eyes, f, q: ahead(eyes, f, q, base_of(f, moving)),
        lambda eyes, f, q, t: sight_error(eyes, f, q, base_of(f, moving), t),
    )


def distance_subject(moving: bool) -> Subject:
    return Subject(
        Distance,
        lambda f, robot: (
            Distance(f.tip, f.base, offset=OFFSET) if moving else Distance(f.tip, offset=OFFSET, point=tuple(CENTER))
        ),
        lambda eyes, f, q: gap(eyes, f, q, base_of(f, moving)),
        lambda eyes, f, q, t: np.array([gap(eyes, f, q, base_of(f, moving)) - t]),
    )


SUBJECTS: dict[str, Subject] = {
    "axis": align_subject(moving=False),
    "axis from a moving frame": align_subject(moving=True),
    "camera": sight_subject(moving=False),
    "camera from a moving frame": sight_subject(moving=True),
    "distance from a point": distance_subject(moving=False),
    "distance of frames": distance_subject(moving=True),
}

#: Subjects whose error falls in size alone
SIZES = [name for name, s in SUBJECTS.items() if s.cls in (LookAt, Distance)]

MOMENTA: dict[str, tuple[str, slice]] = {
    "momentum": ("both", slice(0, 6)),
    "linear momentum": ("linear", slice(0, 3)),
    "angular momentum": ("angular", slice(3, 6)),
}


def size_decay(loop: Loop, name: str, seed: int = 1) -> Figures:
    """The angle to the line of sight, or the lack of distance, falls by 1 - gain dt a tick; sizes below 0.02 count
    as 0.02.
    """
    subject = SUBJECTS[name]
    loop.only(name)
    loop[name].gain = GAIN
    worst = {"left": 0.0, "bend": 0.0, "unsolved": 0.0}
    powers = (1 - GAIN * DT) ** np.arange(0, TICKS + 1, 10)
    for q, goal in tasks.pairs(loop, subject, seed):
        target = subject.measure(loop.eyes, loop.frames, goal)
        loop[name].target = target
        run = loop.run(q, TICKS)
        worst["unsolved"] += run.unsolved
        sizes = np.linalg.norm(tasks.errors(loop, subject, run.q[::10], target), axis=1)
        worst["left"] = max(worst["left"], sizes[-1])
        worst["bend"] = max(worst["bend"], np.abs(sizes - powers * sizes[0]).max() / max(sizes[0], 0.02))
        assert worst["left"] < 1e-4, worst
        assert worst["bend"] < 0.03, worst
        assert worst["unsolved"] == 0, worst
    return worst


def opposite(loop: Loop, name: str = "axis", seed: int = 6, gain: float = 1.0) -> Figures:
    """From any direction, one in four exactly opposite, the angle falls by 1 - gain dt a tick on one great circle.

    From opposite the axis sets out about ``around``. A low gain, for half a turn in a second takes most joints far in
    a tick; fewer starts, since this repeats :func:`decay` for large angles.
    """
    eyes, f, rng = loop.eyes, loop.frames, np.random.default_rng(seed)
    loop.only(name)
    loop[name].gain = gain
    worst = {"bend": 0.0, "off the circle": 0.0, "round": 0.0, "unsolved": 0.0}
    powers = (1 - gain * DT) ** np.arange(TICKS + 1)
    for k, (q, _) in enumerate(tasks.pairs(loop, SUBJECTS[name], seed, count=FEWER)):
        start = axis_seen(eyes, f, q, "world")
        target = -start if k % 4 == 0 else rng.normal(size=3)
        target = target / length(target)
        loop[name].target = target
        run = loop.run(q, TICKS)
        worst["unsolved"] += run.unsolved
        axes = np.array([axis_seen(eyes, f, p, "world") for p in run.q])
        angles = np.array([length(shortest(target, a)) for a in axes])
        angles[0] = math.pi if k % 4 == 0 else angles[0]
        normal = cross(start, axes[1])
        normal = normal / max(length(normal), 1e-12)
        worst["bend"] = max(worst["bend"], np.abs(angles - powers * angles[0]).max() / angles[0])
        worst["off the circle"] = max(worst["off the circle"], np.abs(axes @ normal).max())
        if k % 4 == 0:
            worst["round"] = max(worst["round"], length(cross(normal, eyes.pose(q, f.tip).rotation @ FIRST)))
        assert worst["bend"] < 0.02, worst
        assert worst["off the circle"] < 0.1, worst
        assert worst["round"] < 0.05, worst
        assert worst["unsolved"] == 0, worst
    return worst


def moving_point(loop: Loop, name: str = "distance from a point", seed: int = 7) -> Figures:
    """A distance is held from a point that moves on a circle, with a small part of the lag of a point without rate."""
    eyes, f, radius, omega = loop.eyes, loop.frames, 0.1, 4.0
    loop.only(name)
    loop[name].gain = GAIN
    worst = {"lag": 0.0, "unsolved": 0.0}
    for q, _ in tasks.pairs(loop, SUBJECTS[name], seed, count=FEWER):
        loop[name].target = gap(eyes, f, q, "world")

        def point(time: float) -> Array:
            return CENTER + radius * np.array([math.cos(omega * time) - 1.0, math.sin(omega * time), 0.0])

        def aim(k: int, _: Array) -> None:
            t = omega * k * DT
            loop[name].point = point(k * DT)
            loop[name].point_velocity = radius * omega * np.array([-math.sin(t), math.cos(t), 0.0])

        run = loop.run(q, 60, before=aim)
        worst["unsolved"] += run.unsolved
        for k in range(20, 61, 8):
            here = length(eyes.pose(run.q[k], f.tip).act(np.array(OFFSET)) - point(k * DT))
            worst["lag"] = max(worst["lag"], abs(here - loop[name].target) * GAIN / (radius * omega))
        assert worst["lag"] < 0.08, worst
        assert worst["unsolved"] == 0, worst
    loop[name].point, loop[name].point_velocity = CENTER, np.zeros(3)
    return worst


def momentum(loop: Loop, name: str, seed: int = 8) -> Figures:
    """The momentum of every tick's motion is target + gain lag, for targets that some motion of 1 rad/s has.

    By Pinocchio, for the velocity that leads from one configuration to the next; for the linear part also from
    the mass times the way of the centre of mass, to first order in dt.
    """
    rows, model = MOMENTA[name][1], loop.robot.model
    data, rng, ticks = model.createData(), np.random.default_rng(seed), 10
    mass, mean = pin.computeTotalMass(model), 1.0 / math.sqrt(Momentum("angular").row_weights(loop.robot)[0])
    scales = np.repeat([mass, mean], 3)[rows]
    loop.only(name)
    loop[name].gain = GAIN
    worst = {"momentum": 0.0, "way": 0.0, "unsolved": 0.0}
    for _ in range(STARTS):
        lag = rng.uniform(-0.1, 0.1, len(scales)) * scales
        loop[name].lag = lag
        wanted: list[Array] = []

        def aim(k: int, q: Array, lag: Array = lag, wanted: list[Array] = wanted) -> None:
            some = rng.uniform(-1.0, 1.0, loop.robot.nv)
            wanted.append(np.array(pin.computeCentroidalMomentum(model, data, q, some).vector)[rows])
            loop[name].target = wanted[-1] - GAIN * lag

        run = loop.run(anywhere(loop.robot, rng), ticks, before=aim)
        worst["unsolved"] += run.unsolved
        for before, after, h in zip(run.q[:-1], run.q[1:], wanted, strict=True):
            v = loop.eyes.velocity(before, after, DT)
            found = np.array(pin.computeCentroidalMomentum(model, data, before, v).vector)[rows]
            worst["momentum"] = max(worst["momentum"], float(np.abs((found - h) / scales).max()))
            if rows.start == 0:
                way = loop.eyes.center_of_mass(after) - loop.eyes.center_of_mass(before)
                size = length(h[:3]) / mass + float(np.abs(v).max()) ** 2 * DT
                worst["way"] = max(worst["way"], length(way / DT - h[:3] / mass) / size)
        assert worst["momentum"] < 1e-4, worst
        assert worst["way"] < 1.0, worst
        assert worst["unsolved"] == 0, worst
    loop[name].lag = np.zeros(len(scales))
    return worst


def build(name: str) -> Loop:
    """The stack of all these items."""
    robot = machine(name)
    items: dict[str, Item] = {key: s.declare(FRAMES[name], robot) for key, s in SUBJECTS.items()}
    items |= {key: Momentum(kind) for key, (kind, _) in MOMENTA.items()}
    return Loop(robot, items, DT, name)

"""Closed loops of collision constraints: the hand is pulled into things and into the robot itself; Coal is the judge.

Tick by tick every distance d that Coal measures, less the margin, is at least (1 - rate dt) d - bend of the tick
before: a tick is linear and the robot is not, and over one a point strays from its tangent by at most

    bend = (1/2) (rho w^2 + w u) dt^2

for a point within rho of the axes of joints that turn at w = sum |v_i| in all, on a base that slides at u. Nearest
points of shapes with edges jump to places that have no row when there are more of them than rows; what that adds in a
tick was below :data:`JUMP` in all runs.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import Array, Gaps, Standing, length
from tests.closed_loop.loop import Loop, Run
from tests.closed_loop.machines import FEWER, STARTS, anywhere, machine
from tests.models import placement
from tests.random_robots import unit
from tests.repeats import repeats
from tests.tasks.robots import FRAMES, Frames
from wbc.robot import Robot
from wbc.shapes import Box, Capsule, Convex, Cylinder, PlacedShape, Shape
from wbc.tasks import EndEffector, Item, JointLimits, Obstacle
from wbc.tasks.self_collision import SelfCollision

DT, RATE, TICKS, MARGIN = 0.01, 20.0, 80, 0.01
#: Random starts of a hand that folds, of which a third comes to the limit
FOLDED = repeats(5)

#: Farthest that a point of an obstacle or a link is from a joint's axis [m]
RHO = 2.0
#: How much nearer than the row's points others may be one tick later, and the tolerance of Coal's iterations [m]
JUMP = 1e-3

_turns = np.random.default_rng(5).normal(size=(2, 40, 3))
#: Two lumps that together are not convex
ROCK = tuple(
    Convex(0.08 * turn / np.linalg.norm(turn, axis=1, keepdims=True) + [side * 0.07, 0, 0])
    for turn, side in zip(_turns, (-1, 1), strict=True)
)

Figures = dict[str, float]


def parts(shape: Any) -> tuple[Shape, ...]:
    return shape if isinstance(shape, tuple) else (shape,)


@dataclass(frozen=True, eq=False)
class Thing:
    """An obstacle; ``size``: nothing of it is farther from its origin [m]."""

    shape: Any
    size: float


THINGS: dict[str, Thing] = {
    "rod": Thing(Capsule(0.04, 0.2), 0.14),
    "crate": Thing(Box((0.2, 0.14, 0.1)), 0.14),
    "can": Thing(Cylinder(0.07, 0.2), 0.13),
    "rock": Thing(ROCK, 0.15),
}

#: Items that keep the robot clear of itself, and the method of each
SELF = {"self": "auto", "self, sensed": "sensed"}

#: Share of the joints' speed limits that a check runs at
SPEED = 0.5


def collision_machine(name: str) -> Robot:
    """The robot of the other loops; the humanoid has the shapes of its left arm on its right arm, too."""
    robot = machine(name)
    if name != "talos":
        return robot
    f = FRAMES[name]
    other = {link.replace("left", "right"): robot.shapes[link] for link in (f.tip, f.middle)}
    return robot.with_shapes({**robot.shapes, **other})


def self_pairs(name: str, f: Frames) -> list[tuple[str, str]]:
    """Hand and wrist against the upper arm, or against the other arm."""
    if name == "talos":
        return [(a, b.replace("left", "right")) for a in (f.tip, f.middle) for b in (f.tip, f.middle)]
    return [(f.tip, f.plane[0]), (f.plane[2], f.plane[0]), (f.tip, f.middle)]


def build(name: str) -> Loop:
    """The stack of every constraint under test, and of what pulls against them."""
    robot, f = collision_machine(name), FRAMES[name]
    items: dict[str, Item] = {key: Obstacle(thing.shape, margin=MARGIN) for key, thing in THINGS.items()}
    for key, method in SELF.items():
        items[key] = SelfCollision(self_pairs(name, f), margin=MARGIN, method=method)
    goal = self_pairs(name, f)[0][1]
    items |= {
        "reach": EndEffector(f.tip, kind="position"),
        "fold": EndEffector(f.tip, kind="position", relative_to=goal),
        "caps": JointLimits(acceleration=False),
    }
    return Loop(robot, items, DT)


def bend(loop: Loop, v: Array, spin: float) -> float:
    """See the module [m]; ``spin``: turn of what the point is measured against [rad/s]."""
    slide = length(v[:3]) if loop.robot.base == "floating" else 0.0
    turn = float(np.abs(v[3:] if loop.robot.base == "floating" else v).sum()) + spin
    return 0.5 * (RHO * turn * turn + turn * slide) * loop.dt**2


def beyond(loop: Loop, size: float, gaps: Gaps, rng: np.random.Generator) -> tuple[Array, pin.SE3, Array]:
    """A configuration, a turned obstacle beyond the hand that touches nothing, and the direction into it.

    ``size``: nothing of the obstacle on the hand's side is farther from its origin [m].
    """
    f = FRAMES[loop.robot.name]
    for _ in range(1000):
        q = anywhere(loop.robot, rng)
        shoulder, tip = (placement(loop.robot, name, q).translation for name in (f.plane[0], f.tip))
        inward = (tip - shoulder) / length(tip - shoulder) + 0.3 * unit(rng)
        inward /= length(inward)
        pose = pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), tip + (0.2 + size) * inward)
        if gaps(q, pose).min() > MARGIN + 0.01:
            return q, pose, inward
    raise AssertionError("the obstacle is always in the way")


def judge(figures: Figures, loop: Loop, run: Run, d: Array, spin: float) -> None:
    """Take the distances of a run, less the margin, ticks + 1 x pairs, into the figures; nothing overlaps."""
    allowed = np.array([bend(loop, v, spin) for v in run.v])
    short = (1 - RATE * loop.dt) * d[:-1] - d[1:]
    figures["unsolved"] += run.unsolved
    figures["deepest"] = min(figures["deepest"], float(d.min()))
    figures["excess"] = max(figures["excess"], float((short - allowed[:, None]).max()))
    figures["touching"] += bool(d.min() < 3e-3)
    assert figures["deepest"] > -MARGIN, figures
    assert figures["excess"] < JUMP, figures
    assert figures["unsolved"] == 0, figures


def accept(figures: Figures, starts: int, touching: float) -> Figures:
    """Enough runs come to the limit."""
    assert figures["touching"] > touching * starts, figures
    return figures


def pressed(loop: Loop, name: str, seed: int = 31) -> Figures:
    """The hand is pulled to the origin of a thing that lies beyond it and, every second time, comes and turns."""
    rng, thing = np.random.default_rng(seed), THINGS[name]
    starts = STARTS if name == "rod" and loop.robot.name != "talos" else FEWER
    shapes = [(link, placed) for link, group in loop.robot.shapes.items() for placed in group]
    others: list[Standing] = [(None, PlacedShape(part, pin.SE3.Identity())) for part in parts(thing.shape)]
    gaps = Gaps(loop.robot, list(itertools.product(shapes, others)))
    loop.only(name, "reach", "caps")
    loop["caps"].velocity_scale, loop["reach"].gain = SPEED, 3.0
    figures = {"deepest": np.inf, "excess": -np.inf, "touching": 0.0, "unsolved": 0.0}
    for start in range(starts):
        q, pose, inward = beyond(loop, thing.size, gaps, rng)
        twist = np.zeros(6)
        if start % 2:
            twist = np.concatenate([-0.1 * inward, rng.uniform(-0.3, 0.3, 3)])
        poses = [
            pin.SE3(pin.exp3(t * twist[3:]) @ pose.rotation, pose.translation + t * twist[:3])
            for t in loop.dt * np.arange(TICKS + 1)
        ]

        def aim(k: int, _: Array, poses: list[pin.SE3] = poses, twist: Array = twist) -> None:
            loop[name].pose, loop[name].velocity = poses[k], twist
            loop["reach"].target = poses[k].translation

        run = loop.run(q, TICKS, before=aim)
        d = np.array([gaps(x, p) for x, p in zip(run.q, poses, strict=True)]) - MARGIN
        judge(figures, loop, run, d, length(twist[3:]))
    return accept(figures, starts, 0.5)


def folded(loop: Loop, name: str, starts: int = FOLDED, seed: int = 32) -> Figures:
    """The hand is pulled to the origin of the link that it must not touch."""
    rng, shapes = np.random.default_rng(seed), loop.robot.shapes
    pairs = self_pairs(loop.robot.name, FRAMES[loop.robot.name])
    groups = [([(a, p) for p in shapes[a]], [(b, p) for p in shapes[b]]) for a, b in pairs]
    gaps = Gaps(loop.robot, [pair for group in groups for pair in itertools.product(*group)])
    loop.only(name, "fold", "caps")
    loop["caps"].velocity_scale, loop["fold"].target = SPEED, np.zeros(3)
    loop["fold"].gain = 5.0
    figures = {"deepest": np.inf, "excess": -np.inf, "touching": 0.0, "unsolved": 0.0}
    found = 0
    while found < starts:
        q = anywhere(loop.robot, rng)
        if not MARGIN + 0.01 < gaps(q).min() < 0.3:
            continue
        found += 1
        run = loop.run(q, TICKS)
        d = np.array([gaps(x) for x in run.q]) - MARGIN
        judge(figures, loop, run, d, 0.0)
    return accept(figures, starts, 0.3)


def one_row_a_pair() -> Loop:
    """The two arms of a humanoid, with rows for nearest points only; a few of its runs show what that leads to where
    arms go as fast as they may whatever is left of their task.
    """
    robot, f = collision_machine("talos"), FRAMES["talos"]
    pairs = self_pairs("talos", f)
    items: dict[str, Item] = {
        "self, sensed": SelfCollision(pairs, margin=MARGIN, method="sensed", corners=0),
        "fold": EndEffector(f.tip, kind="position", relative_to=pairs[0][1]),
        "caps": JointLimits(acceleration=False),
    }
    return Loop(robot, items, DT, "vm", calm=False)

"""Closed-loop checks of constraints. Each returns its figures; every run is pulled against the constraint.

A tick is linear and the robot is not: over one tick a point strays from its tangent by at most

    bend = (1/2) (rho w^2 + w u) dt^2

for a point within rho of the axes of joints that turn at w = sum |v_i| in all, on a base that slides at u.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from tests.closed_loop.eyes import Array, Gaps, length, wrap
from tests.closed_loop.loop import Loop
from tests.closed_loop.machines import STARTS, anywhere, machine, near
from tests.models import frame_jacobian
from tests.random_robots import unit
from tests.tasks.robots import FRAMES, Frames
from wbc.robot import Robot
from wbc.shapes import HalfSpace, PlacedShape, Sphere
from wbc.tasks import (
    EndEffector,
    Fixed,
    FrameVelocityLimit,
    Hold,
    Item,
    JointLimits,
    Obstacle,
    PitchPlane,
    PitchPlaneLimit,
    Posture,
)

DT, RATE, TICKS = 0.01, 20.0, 80

#: Farthest that a point of an obstacle or a link is from a joint's axis [m]
RHO = 2.0

BALL, WALL, MARGIN = Sphere(0.1), HalfSpace(), 0.01
SPEED = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
LOWER, UPPER = -0.5, 1.0

Figures = dict[str, float]


def hold_frame(robot: Robot, f: Frames) -> tuple[str, str]:
    """What is held: the whole pose where that leaves a joint free, a sole of the humanoid."""
    frame = "right_sole_link" if robot.base == "floating" else f.tip
    return frame, "pose" if robot.nv > 6 else "position"


def fixed_joint(f: Frames) -> str:
    """A joint in the middle of the arm."""
    return f.axis


def build(name: str) -> Loop:
    """The stack of every constraint under test, and of tasks that pull against them."""
    robot, f = machine(name), FRAMES[name]
    linear, angular = tuple(SPEED[:3]), tuple(SPEED[3:])
    items: dict[str, Item] = {
        "limits": JointLimits(),
        "ball": Obstacle(BALL, margin=MARGIN),
        "wall": Obstacle(WALL, margin=MARGIN),
        "speed, own axes": FrameVelocityLimit(f.tip, linear=linear, angular=angular, axes=f.tip),
        "speed from a moving frame": FrameVelocityLimit(f.tip, linear=linear, angular=angular, relative_to=f.plane[0]),
        "hold": Hold(*hold_frame(robot, f)),
        "fixed": Fixed(fixed_joint(f)),
        "plane limit": PitchPlaneLimit(*f.plane, lower=LOWER, upper=UPPER),
        "reach": EndEffector(f.tip, kind="position"),
        "pose": EndEffector(f.tip),
        "swing": PitchPlane(*f.plane),
        "rest": Posture(joints=robot.joint_names),
        "caps": JointLimits(acceleration=False),
    }
    return Loop(robot, items, DT, name)


def bend(loop: Loop, v: Array, spin: float = 0.0) -> float:
    """See the module [m]; ``spin``: turn of what the point is measured against [rad/s]."""
    slide = length(v[:3]) if loop.robot.base == "floating" else 0.0
    turn = float(np.abs(v[3:] if loop.robot.base == "floating" else v).sum()) + spin
    return 0.5 * (RHO * turn * turn + turn * slide) * loop.dt**2


def obstacle(loop: Loop, name: str, moving: bool, seed: int = 11) -> Figures:
    """The hand is pulled into the obstacle. Tick by tick every distance d that Coal measures, less the margin, is at
    least (1 - rate dt) d - bend of the tick before; so it falls below zero by no more than bends allow, here 5 mm.
    """
    eyes, f, rng = loop.eyes, loop.frames, np.random.default_rng(seed)
    shape = BALL if name == "ball" else WALL
    stand = PlacedShape(shape, pin.SE3.Identity())
    gaps = Gaps(loop.robot, [((a, p), (None, stand)) for a, group in loop.robot.shapes.items() for p in group])
    loop.only(name, "reach", "caps")
    loop["caps"].velocity_scale, loop["reach"].gain = 0.5, 3.0
    figures = {"deepest": np.inf, "excess": -np.inf, "touching": 0.0, "unsolved": 0.0}
    for _ in range(STARTS):
        q, pose, inward = beyond(loop, BALL.radius * (name == "ball"), gaps, rng, against)
        tip = eyes.pose(q, f.tip).translation
        twist = np.zeros(6)
        if moving:
            twist = np.concatenate([-0.1 * inward, rng.uniform(-0.05, 0.05, 3)])
        goal = pose.translation if name == "ball" else tip + 0.5 * inward
        poses = [
            pin.SE3(pin.exp3(t * twist[3:]) @ pose.rotation, pose.translation + t * twist[:3])
            for t in loop.dt * np.arange(TICKS + 1)
        ]

        def aim(k: int, _: Array, poses: list[pin.SE3] = poses, twist: Array = twist, goal: Array = goal) -> None:
            loop[name].pose, loop[name].velocity = poses[k], twist
            loop["reach"].target = goal + k * loop.dt * twist[:3]

        run = loop.run(q, TICKS, before=aim)
        figures["unsolved"] += run.unsolved
        d = np.array([gaps(x, p) for x, p in zip(run.q, poses, strict=True)]) - MARGIN
        allowed = np.array([bend(loop, v, length(twist[3:])) for v in run.v])
        short = (1 - RATE * loop.dt) * d[:-1] - d[1:]
        figures["deepest"] = min(figures["deepest"], float(d.min()))
        figures["excess"] = max(figures["excess"], float((short - allowed[:, None]).max()))
        figures["touching"] += bool(d[-1].min() < 2e-3)
        assert figures["excess"] < 1e-9, figures
        assert figures["deepest"] > -5e-3, figures
        assert figures["unsolved"] == 0, figures
    assert figures["touching"] > 0.6 * STARTS, figures
    return figures


def beyond(
    loop: Loop, size: float, gaps: Gaps, rng: np.random.Generator, turn: Callable[[Array], Array]
) -> tuple[Array, pin.SE3, Array]:
    """A configuration, an obstacle beyond the hand that touches nothing, and the direction into it.

    ``size``: nothing of the obstacle on the hand's side is farther from its origin [m]; ``turn``: its rotation, from
    that direction.
    """
    for _ in range(1000):
        q = anywhere(loop.robot, rng)
        shoulder, tip = (p.translation for p in loop.eyes.poses(q, loop.frames.plane[0], loop.frames.tip))
        inward = (tip - shoulder) / length(tip - shoulder) + 0.3 * unit(rng)
        inward /= length(inward)
        pose = pin.SE3(turn(inward), tip + (0.2 + size) * inward)
        if gaps(q, pose).min() > MARGIN + 0.01:
            return q, pose, inward
    raise AssertionError("the obstacle is always in the way")


def against(inward: Array) -> Array:
    """A rotation whose z axis looks back at the hand."""
    return np.array(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), -inward).matrix())


def frame_speed(loop: Loop, name: str, seed: int = 12) -> Figures:
    """The hand is sent a metre and a radian away at gain 5; the fastest of its velocities, over its limit, is 1."""
    eyes, f, rng = loop.eyes, loop.frames, np.random.default_rng(seed)
    loop.only(name, "pose")
    loop["pose"].gain = 5.0
    figures = {"fastest": 0.0, "at the limit": 0.0, "unsolved": 0.0}
    for _ in range(STARTS):
        q = anywhere(loop.robot, rng)
        here = eyes.pose(q, f.tip)
        loop["pose"].target = pin.SE3(pin.exp3(unit(rng)) @ here.rotation, here.translation + unit(rng))
        run = loop.run(q, 20)
        figures["unsolved"] += run.unsolved
        speeds = []
        for before, after in zip(run.q[:-1], run.q[1:], strict=True):
            v = eyes.velocity(before, after, loop.dt)
            own = name == "speed, own axes"
            twist = eyes.twist(before, v, f.tip, pin.LOCAL) if own else seen_twist(loop, before, v)
            speeds.append(float(np.max(np.abs(twist) / SPEED)))
        figures["fastest"] = max(figures["fastest"], *speeds)
        figures["at the limit"] += bool(max(speeds) > 0.999)
        assert figures["fastest"] < 1 + 1e-6, figures
        assert figures["unsolved"] == 0, figures
    assert figures["at the limit"] > 0.95 * STARTS, figures
    return figures


def seen_twist(loop: Loop, q: Array, v: Array, step: float = 1e-5) -> Array:
    """Velocity of the tip in the axes of the world as seen from a moving frame: differences of the relative pose."""
    eyes, f = loop.eyes, loop.frames
    ahead, behind = (
        eyes.pose(x, f.plane[0]).actInv(eyes.pose(x, f.tip))
        for x in (pin.integrate(loop.robot.model, q, s * step * v) for s in (1.0, -1.0))
    )
    turn = eyes.pose(q, f.plane[0]).rotation
    spin = pin.log3(ahead.rotation @ behind.rotation.T)
    return np.concatenate([turn @ (ahead.translation - behind.translation), turn @ spin]) / (2 * step)


def hold(loop: Loop, name: str = "hold", seed: int = 13) -> Figures:
    """A frame that starts off its place by a centimetre or so comes back by 1 - gain dt a tick, but for a thousandth of
    the robot's length a second that may be lost, while every joint is pulled elsewhere. At the end it is in place.
    """
    eyes, f, rng = loop.eyes, loop.frames, np.random.default_rng(seed)
    frame, kind = hold_frame(loop.robot, f)
    gain = 10.0
    loop.only(name, "rest")
    loop[name].gain, loop["rest"].gain = gain, gain
    figures = {"lost": 0.0, "excess": -np.inf, "left": 0.0, "pulled": np.inf, "unsolved": 0.0}
    scale = np.repeat([loop.robot.characteristic_length, 1.0], 3)

    def drift(q: Array, target: pin.SE3) -> Array:
        here = eyes.pose(q, frame)
        turn = pin.log3(here.rotation @ target.rotation.T)
        return np.concatenate([here.translation - target.translation, turn])[: 6 if kind == "pose" else 3]

    found = 0
    while found < STARTS:
        q = anywhere(loop.robot, rng)
        jacobian = frame_jacobian(loop.robot, frame, q)[: 6 if kind == "pose" else 3]
        if np.linalg.svd(jacobian, compute_uv=False)[-1] < 0.1:
            continue
        found += 1
        here = eyes.pose(q, frame)
        target = pin.SE3(
            pin.exp3(rng.uniform(-0.03, 0.03, 3)) @ here.rotation, here.translation + rng.uniform(-0.01, 0.01, 3)
        )
        loop[name].target, loop["rest"].target = target, near(loop.robot, rng, q, 0.3)
        run = loop.run(q, 2 * TICKS)
        figures["unsolved"] += run.unsolved
        e = np.array([drift(x, target) for x in run.q])
        lost = (np.diff(e, axis=0) / loop.dt + gain * e[:-1]) / scale[: e.shape[1]]
        figures["lost"] = max(figures["lost"], float(np.abs(lost).max()))
        size = np.linalg.norm(e, axis=1)
        # A point bends by rho w^2, a rotation by w^2: no more than the point, as rho is above 1
        allowed = np.sqrt(2) * np.array([bend(loop, v) for v in run.v])
        figures["excess"] = max(figures["excess"], float((size[1:] - (1 - gain * loop.dt) * size[:-1] - allowed).max()))
        figures["left"] = max(figures["left"], float(size[-1]))
        figures["pulled"] = min(figures["pulled"], float(np.abs(run.q[-1] - q).max()))
        assert figures["excess"] < 1e-9, figures
        assert figures["lost"] < 1.01e-3, figures
        assert figures["left"] < 1e-6, figures
        assert figures["unsolved"] == 0, figures
    assert figures["pulled"] > 5e-3, figures
    return figures


def fixed(loop: Loop, name: str = "fixed", seed: int = 14) -> Figures:
    """A joint at rest stays to the last bit, one that moves stops as its acceleration limit lets it and then stays; the
    hand is pulled away meanwhile.
    """
    model, f, rng = loop.robot.model, loop.frames, np.random.default_rng(seed)
    k = loop.robot.dofs(fixed_joint(f)).start
    at, brake = int(loop.robot.position_index[k]), float(loop.robot.limits.acceleration[k]) * loop.dt
    figures = {"moved": 0.0, "braking": 0.0, "hand": np.inf, "unsolved": 0.0}
    loop.only(name, "reach")
    loop["reach"].gain = 5.0
    for start in range(STARTS):
        q, v = anywhere(loop.robot, rng), np.zeros(model.nv)
        here = loop.eyes.pose(q, f.tip).translation
        loop["reach"].target = here + 0.1 * unit(rng)
        v[k] = rng.uniform(-1.0, 1.0) * (start % 2)
        run = loop.run(q, 30, v=v)
        figures["unsolved"] += run.unsolved
        speed = np.concatenate([[v[k]], np.diff(run.q[:, at]) / loop.dt])
        stop = int(np.ceil(abs(v[k]) / brake))
        figures["moved"] = max(figures["moved"], float(np.ptp(run.q[max(stop - 1, 0) :, at])))
        figures["braking"] = max(figures["braking"], float(np.abs(np.diff(speed)).max()) / brake)
        figures["hand"] = min(figures["hand"], length(loop.eyes.pose(run.q[-1], f.tip).translation - here))
        assert figures["moved"] == 0.0, figures
        assert figures["braking"] < 1 + 1e-9, figures
        assert figures["unsolved"] == 0, figures
    assert figures["hand"] > 5e-3, figures
    return figures


def joint_limits(loop: Loop, name: str = "limits", seed: int = 15) -> Figures:
    """Joints are sent far beyond both ends of their ranges in turn, as fast as a task can ask; position, velocity and
    acceleration are worked out from the configurations.
    """
    model, limits, rng = loop.robot.model, loop.robot.limits, np.random.default_rng(seed)
    loop.only(name, "rest")
    loop["rest"].gain, loop["rest"].weight = 1 / loop.dt, 1.0
    at = loop.robot.position_index
    held = np.flatnonzero(at >= 0)
    low, high = model.lowerPositionLimit[at[held]], model.upperPositionLimit[at[held]]
    half = (high - low) / 2
    figures = {"beyond": -np.inf, "velocity": 0.0, "acceleration": 0.0, "at an end": 0.0, "unsolved": 0.0}
    for _ in range(STARTS):
        q, far = anywhere(loop.robot, rng), np.where(at < 0, 0.0, rng.choice([-30.0, 30.0], model.nv))
        # Anywhere in the outer thirds of the ranges, so that slow joints reach an end, too
        side = np.where(rng.random(held.size) < 0.5, -half, half)
        q[at[held]] = (low + high) / 2 + side * rng.uniform(1 / 3, 1, held.size)
        ends = [pin.integrate(model, loop.robot.neutral, s * far) for s in (1.0, -1.0)]

        def aim(k: int, _: Array, ends: list[Array] = ends) -> None:
            if k % 60 == 0:
                loop["rest"].target = ends[k // 60 % 2]

        run = loop.run(q, 120, before=aim)
        figures["unsolved"] += run.unsolved
        v = np.array([loop.eyes.velocity(a, b, loop.dt) for a, b in zip(run.q[:-1], run.q[1:], strict=True)])
        change = np.abs(np.diff(v, axis=0, prepend=np.zeros((1, model.nv)))) / loop.dt
        beyond = np.maximum(low - run.q[:, at[held]], run.q[:, at[held]] - high)
        figures["beyond"] = max(figures["beyond"], float(beyond.max()))
        figures["velocity"] = max(figures["velocity"], float((np.abs(v) / limits.velocity).max()))
        figures["acceleration"] = max(figures["acceleration"], float((change / limits.acceleration).max()))
        figures["at an end"] += bool(beyond.max() > -1e-3)
        assert figures["beyond"] < 1e-9, figures
        assert figures["velocity"] < 1 + 1e-9, figures
        assert figures["acceleration"] < 1 + 1e-6, figures
        assert figures["unsolved"] == 0, figures
    assert figures["at an end"] > 0.4 * STARTS, figures
    return figures


def plane_limit(loop: Loop, name: str = "plane limit", seed: int = 16) -> Figures:
    """A task turns the plane beyond either bound; its angle stays within both, but for the bend of a tick."""
    eyes, f, rng = loop.eyes, loop.frames, np.random.default_rng(seed)
    loop.only(name, "swing", "caps")
    loop["swing"].gain, loop["caps"].velocity_scale = 5.0, 0.5
    figures = {"beyond": -np.inf, "at a bound": 0.0, "clear": 0.0, "unsolved": 0.0}
    found = 0
    while found < STARTS:
        q = anywhere(loop.robot, rng)
        if not eyes.plane_is_clear(q, f.plane) or not LOWER + 0.1 < eyes.plane_angle(q, f.plane) < UPPER - 0.1:
            continue
        found += 1
        loop["swing"].target = UPPER + 0.5 if found % 2 else LOWER - 0.5
        run = loop.run(q, TICKS)
        figures["unsolved"] += run.unsolved
        if not all(eyes.plane_is_clear(x, f.plane) for x in run.q):
            continue
        psi = np.array([eyes.plane_angle(x, f.plane) for x in run.q])
        middle = (LOWER + UPPER) / 2
        off = np.array([abs(wrap(a - middle)) for a in psi]) - (UPPER - LOWER) / 2
        figures["clear"] += 1
        figures["beyond"] = max(figures["beyond"], float(off.max()))
        figures["at a bound"] += bool(abs(off[-1]) < 0.01)
        assert figures["beyond"] < 1e-3, figures
    assert figures["unsolved"] == 0, figures
    assert figures["clear"] > 0.8 * STARTS, figures
    assert figures["at a bound"] > 0.7 * STARTS, figures
    return figures

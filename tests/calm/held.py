"""Floating robots whose frames are held while their bodies, and free limbs, are pulled away."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

import wbc.robots
from tests.random_robots import Drawn, random_model
from wbc.api import Stack
from wbc.robot import Robot
from wbc.tasks import EndEffector, Hold, JointLimits, Posture

Array = np.ndarray

#: Base frame, and frames that can be held
BODIES = {
    "g1": ("pelvis", ("left_ankle_roll_link", "right_ankle_roll_link")),
    "talos": ("base_link", ("left_sole_link", "right_sole_link", "gripper_left_base_link", "gripper_right_base_link")),
    "go2": ("base", ("FL_foot", "FR_foot", "RL_foot", "RR_foot")),
    "anymal_c": ("base", ("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT")),
    "solo12": ("base_link", ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")),
}
#: A joint that moves faster than this one way, and then the other in the next tick, has flipped [rad/s, m/s]
LARGE = 2.0


@dataclass
class Run:
    """Of one run: largest distance of a held frame from where it was [m], ticks in which a joint flipped, largest rate
    of a joint [rad/s], how many ticks ended with each status, largest reported loss per second [m/s, rad/s].
    """

    drift: float = 0.0
    flips: int = 0
    fastest: float = 0.0
    statuses: dict[str, int] = field(default_factory=dict)
    lost: float = 0.0
    said: bool = True


#: A trunk with limbs whose joints turn, most of them about an axis of their own
TREE = Drawn(
    pin.JointModelFreeFlyer,
    limbs=(2, 4),
    joints=(3, 6),
    kinds={"aligned": 0.63, "turning": 0.27, "sliding": 0.1},
    mass=(0.5, 2.0),
)


def tree(rng: np.random.Generator) -> tuple[Robot, str, tuple[str, ...]]:
    """A robot, its trunk, and the tips of its limbs."""
    robot = wbc.robots.load(random_model(rng, TREE))
    return robot, "trunk", tuple(name for name in robot.frame_names if name.endswith("_tip"))


def begin(robot: Robot, rng: np.random.Generator) -> Array:
    """The neutral configuration, as stretched as it is, or one near it within the limits."""
    away = np.zeros(robot.nv)
    away[6:] = rng.normal(0.0, 0.3, robot.nv - 6) * (rng.random() < 0.6)
    q = np.array(robot.integrate(robot.neutral, away, 1.0))
    at = robot.position_index
    for i in np.flatnonzero(at >= 0):
        low, high = robot.limits.position_lower[i], robot.limits.position_upper[i]
        if np.isfinite(low) and np.isfinite(high):
            q[at[i]] = np.clip(q[at[i]], low + 0.01, high - 0.01)
    return q


def pulled(
    robot: Robot,
    base: str,
    held: tuple[str, ...],
    dt: float,
    ticks: int,
    *,
    q: Array,
    speed: Array,
    hand: str = "",
    hand_speed: Array | None = None,
    kind: str = "pose",
    base_kind: str = "pose",
    gain: float = 10.0,
    posture: float = 1e-3,
    limits: bool = True,
    calm: bool = True,
    backend: str = "vm",
) -> Run:
    """Frames are held at ``q`` while the targets of base and hand leave at ``speed`` and ``hand_speed`` [m/s]."""
    stack = Stack(robot, dt, calm=calm)
    for frame in held:
        stack.add(Hold(frame, kind=kind), name=frame)
    stack.add(EndEffector(base, kind=base_kind, gain=gain), name="base")
    if hand:
        stack.add(EndEffector(hand, kind="position", gain=gain), name="hand")
    stack.add(Posture(), name="posture", weight=posture)
    if limits:
        stack.add(JointLimits(), name="limits")
    controller = stack.compile(backend=backend)
    data = robot.model.createData()

    def place(frame: str) -> pin.SE3:
        return data.oMf[robot.model.getFrameId(frame)].copy()

    pin.framesForwardKinematics(robot.model, data, q)
    home = {frame: place(frame) for frame in (base, hand, *held) if frame}
    run, before = Run(), np.zeros(robot.nv - 6)
    for k in range(ticks):
        target = home[base].translation + k * dt * speed
        controller["base"].target = pin.SE3(home[base].rotation, target) if base_kind == "pose" else target
        if hand:
            controller["hand"].target = home[hand].translation + k * dt * hand_speed
        step = controller.step(q)
        run.statuses[str(step.status)] = run.statuses.get(str(step.status), 0) + 1
        rates = {name: np.abs(lost).max() / dt for name, lost in step.lost.items()}
        run.lost = max(run.lost, *rates.values())
        run.said &= step.status != "solved" or run.lost < 1.1e-3 * max(1.0, stack.length)
        q = robot.integrate(q, step.v, dt)
        pin.framesForwardKinematics(robot.model, data, q)
        run.drift = max(run.drift, *(float(np.linalg.norm(place(f).translation - home[f].translation)) for f in held))
        now = step.v[6:]
        run.flips += bool(((before * now < 0.0) & (np.minimum(np.abs(before), np.abs(now)) > LARGE)).any())
        run.fastest = max(run.fastest, float(np.abs(now).max()))
        before = now
    return run


def drawn(seed: int, ticks: int) -> Run:
    """One member of the family: robot, held frames, limits, tick, gains and pulls are drawn."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(["tree", *BODIES]))
    robot, base, feet = tree(rng) if name == "tree" else (wbc.robots.load(name), *BODIES[name])
    dt, calm = float(np.exp(rng.uniform(np.log(1e-3), np.log(1 / 60)))), bool(rng.random() < 0.7)
    held = tuple(str(f) for f in rng.permutation(feet)[: rng.integers(1, len(feet) + 1)])
    free = [f for f in feet if f not in held]
    if rng.random() < 0.5:
        limit = np.full(robot.nv, np.exp(rng.uniform(np.log(20.0), np.log(500.0))))
        limit[:6] = np.inf if rng.random() < 0.5 else limit[:6]
        robot = robot.with_limits(acceleration=limit)
    ways = rng.normal(size=(2, 3))
    ways *= np.exp(rng.uniform(np.log(0.1), np.log(2.0))) / np.linalg.norm(ways, axis=1)[:, None]
    return pulled(
        robot,
        base,
        held,
        dt,
        min(ticks, round(1.5 / dt)),
        q=begin(robot, rng),
        speed=ways[0],
        # without calm motion what no held frame resists chatters out of reach
        hand=free[0] if free and calm and rng.random() < 0.5 else "",
        hand_speed=ways[1],
        kind=str(rng.choice(["pose", "position"])) if len(held) < 3 else "position",
        base_kind=str(rng.choice(["pose", "position"])),
        gain=float(np.exp(rng.uniform(np.log(2.0), np.log(min(80.0, 0.6 / dt))))),
        posture=float(10.0 ** rng.uniform(-5, -1)),
        limits=bool(rng.random() < 0.85),
        calm=calm,
    )

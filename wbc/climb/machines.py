"""Climbers by name: a robot, the tips by which it holds, and how."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from math import pi

import numpy as np

from wbc import validation
from wbc.climb.climber import Climber, ClimbLimb
from wbc.climb.contacts import ContactKind, FlatFoot, GripHand, PointFoot
from wbc.climb.scene import FLIP
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.robots.catalogue import load
from wbc.robots.feet import ball_radius, sole_of
from wbc.robots.limbed import arms_on_body, limbed
from wbc.robots.pairs import find_self_pairs
from wbc.robots.walker_masses import hold_rating, with_masses
from wbc.robots.walker_robot import Walker, walker

log = logging.getLogger("wbc")

#: Acceleration of the joints of robots whose description has none [rad/s^2]: full torque on a leg without load
QUICK = 60.0
#: The same for a humanoid, whose limbs are heavier [rad/s^2]
HEAVY = 20.0
#: Speed of the joints of robots whose description has none, as MJCF has not [rad/s, m/s]: that of geared motors
RATE = 10.0
#: Friction that feet count on [1]: rubber on concrete has some 0.8
FRICTION = 0.6
#: Half lengths of the soles of TALOS [m]
SOLE = (0.1, 0.06)
#: Most that a hand of TALOS bears [N; N m]: 6 kg, and about half of what the motors of its wrist give; assumed
HAND = (60.0, 3.0)
#: Where the fingers of TALOS close, in the frame of its gripper, whose z axis points back to the wrist [m]
BETWEEN_FINGERS = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.12]))


def climber(name: str) -> Climber:
    """A climber of the table.

        climber("anymal_c").limbs[0].name       # "LF_FOOT"

    Raises:
        UnknownNameError: no such climber.
    """
    return _MADE[validation.one_of("climber", name, names())](name)


def names() -> tuple[str, ...]:
    """Names that :func:`climber` knows."""
    return tuple(_MADE)


def _limbed(contact: ContactKind) -> Callable[[str], Climber]:
    def make(name: str) -> Climber:
        robot = limbed(name)
        tips = [frame for frame in robot.frame_names if frame.endswith("_tip")]
        place = FLIP if contact.fixed != "position" else pin.SE3.Identity()
        return Climber(robot, [ClimbLimb(tip, contact, place, tip.removesuffix("_tip")) for tip in tips], name=name)

    return make


def _table(frames: Sequence[str], shapes: str, acceleration: float) -> Callable[[str], Climber]:
    def make(name: str) -> Climber:
        robot = ready(load(name, shapes=shapes, acceleration=acceleration))
        return Climber(robot, [point_foot(robot, robot.frames[frame]) for frame in frames], name=name)

    return make


def walking_arms(machine: Walker, name: str) -> Climber:
    """A body with arms as a climber; of two arms one alone says where the body is, so that hands do not roll."""
    rating, heavy = hold_rating(), with_masses(machine)
    hand = GripHand(rating.force, rating.torque, rolls=len(machine.arms) > 2)
    limbs = [ClimbLimb(arm.hand, hand, FLIP, arm.name) for arm in heavy.arms]
    return Climber(heavy.robot, limbs, name=name, height=heavy.arm_data.body_height)


def _walker(name: str) -> Climber:
    return walking_arms(walker(), name)


def _two_ended(name: str) -> Climber:
    machine = walker(two_ended=True)
    return Climber(machine.robot, [ClimbLimb(arm.hand, GripHand(), FLIP, arm.name) for arm in machine.arms], name=name)


def _three_pandas(name: str) -> Climber:
    arm = ready(load("panda", shapes="fit", neutral={"panda_joint6": pi}))
    # The base stands on the body's side, its x axis downwards: the hands of arms at rest are below the body
    side = pin.SE3(np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]), np.array([0.25, 0.0, 0.0]))
    places = [pin.SE3(pin.utils.rotate("z", 2 * pi * k / 3), np.zeros(3)) * side for k in range(3)]
    robot = arms_on_body(arm, places, 0.3, 20.0)
    hands = [ClimbLimb(f"arm{k}_panda_hand_tcp", GripHand(), FLIP, f"arm{k}") for k in (1, 2, 3)]
    return Climber(robot, hands, name=name)


def _talos(*hands: str) -> Callable[[str], Climber]:
    def make(name: str) -> Climber:
        robot = ready(load("talos", shapes="convex", acceleration=HEAVY))
        sole, grip = FlatFoot(SOLE, FRICTION), GripHand(*HAND)
        limbs = [ClimbLimb(robot.frames[f"{side}_foot"], sole, name=f"{side}_foot") for side in ("left", "right")]
        limbs += [ClimbLimb(robot.frames[hand], grip, BETWEEN_FINGERS, hand) for hand in hands]
        return Climber(robot, limbs, name=name)

    return make


def point_foot(robot: Robot, frame: str, friction: float = FRICTION) -> ClimbLimb:
    """A limb that stands on the ball about a frame, or on the frame's origin where there is none."""
    if radius := ball_radius(robot, frame):
        log.info("%s: %s is the centre of a ball of %.4g m, on which it stands", robot.name, frame, radius)
    return ClimbLimb(frame, PointFoot(friction, radius=radius))


def flat_foot(robot: Robot, frame: str, friction: float = FRICTION) -> ClimbLimb:
    """A limb that stands on the sole of the links about a frame, which says nothing of where that is.

    Raises:
        ShapeError: there is no such sole; why, in numbers.
    """
    sole = sole_of(robot, frame)
    at, (x, y) = sole.placement.translation, sole.half_lengths
    log.info("%s: %s stands on %.3g by %.3g m about %.3g, %.3g, %.3g m", robot.name, frame, 2 * x, 2 * y, *at)
    return ClimbLimb(frame, FlatFoot(sole.half_lengths, friction), sole.placement)


def ready(robot: Robot) -> Robot:
    """The robot with pairs of links that must not touch, where it has shapes."""
    if robot.self_pairs is not None or not robot.shapes:
        return robot
    return robot.with_self_pairs(find_self_pairs(robot, samples=300).kept)


def with_rates(robot: Robot) -> Robot:
    """The robot with largest speeds :data:`RATE` and accelerations :data:`QUICK` of joints that have none; which joints
    have no speed of their own is a warning in the log.
    """
    rows = np.arange(robot.nv) >= robot.base_nv
    slow, lazy = (rows & ~np.isfinite(part) for part in (robot.limits.velocity, robot.limits.acceleration))
    if slow.any():
        names = ", ".join(name for name, unknown in zip(robot.dof_names, slow, strict=True) if unknown)
        log.warning("%s: joints without a limit of speed move at %g rad/s or m/s at most: %s", robot.name, RATE, names)
    return robot.with_limits(
        velocity=np.where(slow, RATE, robot.limits.velocity),
        acceleration=np.where(lazy, QUICK, robot.limits.acceleration),
    )


_FEET = ("front_left_foot", "front_right_foot", "hind_left_foot", "hind_right_foot")
_MADE: dict[str, Callable[[str], Climber]] = {
    "walker": _walker,
    "two_ended": _two_ended,
    "three_pandas": _three_pandas,
    "truss_climber": _limbed(GripHand()),
    "hexapod": _limbed(PointFoot(FRICTION)),
    "hexapod_grips": _limbed(GripHand(300.0, 20.0)),
    "anymal_c": _table(_FEET, "exact", QUICK),
    "solo12": _table(_FEET, "fit", QUICK),
    "a1": _table(_FEET, "exact", QUICK),
    "go1": _table(_FEET, "exact", QUICK),
    "talos": _talos(),
    "talos_hand": _talos("right_hand"),
    "talos_hands": _talos("left_hand", "right_hand"),
    "wall_climber": _limbed(GripHand(300.0, 20.0, swivels=True)),
    "octopod": _limbed(PointFoot(FRICTION)),
}

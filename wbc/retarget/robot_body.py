"""The body of a robot: limbs or fingers, hinges and soles, found from axes of joints and bodies of links."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from wbc.multibody import pin
from wbc.retarget.body import BodyError, BodyPlan, find_body
from wbc.retarget.clip import Array, Skeleton, ancestors
from wbc.retarget.hands import find_hand
from wbc.retarget.solids import balls_of_joints
from wbc.retarget.words import ARM_WORDS, LEG_WORDS, side_of
from wbc.robot import Robot
from wbc.robot.geometry.link_balls import LinkBalls

log = logging.getLogger("wbc")

#: Cosine of the angle by which right and left may be off a coordinate axis: rest poses of robots are not symmetric
STRAIGHT = 0.9
#: Angles to which each joint is turned to see what it changes [rad]
SWEEP = np.linspace(-np.pi, np.pi, 17)
#: An axis whose part along a bone is below this turns the next bone against it; above, about itself
ACROSS = 0.7
#: A knee that is bent by less than this is straight [rad]
STRAIGHT_KNEE = 0.05
#: A joint at least this share of the way from the middle hinge to the end may be an ankle or a wrist
DISTAL = 0.5
#: Joints before the middle hinge whose axes meet in the hip or the shoulder
MEETING = 3
#: A meeting point this share of the limb away from all joints before the middle hinge is none
OFF = 0.3
#: How much the place of a joint counts against the distance of axes when their meeting point is sought
NEAR = 1e-2
#: Points of a foot within this height above its lowest are its sole [m]
SOLE = 0.012
#: A sole at least this long and wide is flat, a smaller one is a point [m]
FLAT = 0.03
#: Height of the ankle above the sole, as share of the leg, where the description has no body of the foot
ANKLE = 0.09
#: A last link is no longer than this share of the chain before it: bodies in other units lie far away
LONGEST = 0.6
#: Radius of a hand or foot of which no body is known [m]
TIP = 0.02
#: Length of a last link of which nothing is known, as share of the bone before it
HAND = 0.25
#: A point foot's ball is no larger than this many times that of its collision body [1]
BALL = 1.4
#: Corners of the hull of a limb's end, at most
CORNERS = 500
#: Fewer do where they are within this of it [m]
EXACT = 1e-5
#: Where a sole of which no body is known begins and ends: before the ankle and to its left [m]
GUESSED_SOLE = ((-0.04, -0.03), (0.10, 0.03))
#: Fingers are no longer than this [m]
LONGEST_FINGER = 0.25


@dataclass(frozen=True)
class RobotLimb:
    """A leg or an arm of a robot, or a finger, whose knuckles are base, middle and wrist; the world is at rest.

    Attributes:
        joints: numbers of its joints from the trunk on. middle, wrist: frames at knee and ankle, or elbow and wrist;
            no wrist, "", where the last bone ends in the contact point itself.
        end: frame of the contact: of a flat foot below the ankle in the sole, with the body's axes; of a point foot,
            and of a hand, at the centre of its ball. places: of base, middle, wrist, end [4, 3] [m].
        radius: of the ball; 0 of a flat foot [m]. corners: of the sole, or the ball's centre, in the contact frame.
        surface: corners of the hull of what the end is made of, in the contact frame [corners, 3] [m].
        thickness: height of middle, wrist and end above the ground where the limb lies on it [m].
        pitch: least and most turn of the end against its last bone, from the bone along the end's z axis, about the
            axis to the left, that joints behind the middle hinge allow [2] [rad].
        bend: 1 where its middle hinge lies ahead of the line from base to wrist as it bends, -1 where it lies behind.
        guessed: the description says nothing of the foot's or hand's size.
    """

    joints: tuple[int, ...]
    middle: str
    wrist: str
    end: str
    places: Array
    radius: float = TIP
    corners: Array = field(default_factory=lambda: np.zeros((1, 3)))
    surface: Array = field(default_factory=lambda: np.zeros((1, 3)))
    thickness: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pitch: tuple[float, float] = (0.0, 0.0)
    bend: float = 1.0
    guessed: bool = False

    @property
    def base(self) -> Array:
        """Hip or shoulder: where the axes before the middle hinge meet [3]."""
        return np.asarray(self.places[0])

    @property
    def contact(self) -> Literal["flat", "point"]:
        """How its end stands."""
        return "flat" if len(self.corners) > 1 else "point"

    @cached_property
    def lengths(self) -> tuple[float, float]:
        """Base to middle, middle to wrist [m]."""
        upper, lower = np.linalg.norm(np.diff(self.places[:3], axis=0), axis=1)
        return float(upper), float(lower)

    @cached_property
    def ankle(self) -> float:
        """Height of the ankle above the sole [m]."""
        return float(np.linalg.norm(self.places[2] - self.places[3]))


@dataclass(frozen=True)
class RobotBody:
    """What retargeting knows of a robot.

    Attributes:
        robot: with the frames of pelvis, chest, feet and hands added. plan: of its joints.
        limbs: by name of :data:`wbc.retarget.body.LIMBS`, or :data:`wbc.retarget.hands.FINGERS`.
        pelvis, chest: frames between hips and between shoulders, or in a palm, with the body's axes at rest.
        places: of the two at rest [2, 3]. waist: where the axes between them meet; None where one link is both.
        head: frame of the head, with the body's axes at rest; "" without a neck.
        height: of the pelvis above the ground where the robot stands as at rest [m].
        balls: what links are made of, by the number of the joint that carries them, in its frame; {} of a hand.
    """

    robot: Robot
    plan: BodyPlan
    limbs: dict[str, RobotLimb]
    pelvis: str
    chest: str
    places: Array
    waist: Array | None
    head: str
    height: float
    balls: dict[int, LinkBalls]

    @property
    def axes(self) -> Array:
        """Forward, left and up at rest in the world, as columns [3, 3]."""
        return self.plan.axes

    @property
    def is_hand(self) -> bool:
        """Whether its limbs are fingers."""
        return "index" in self.limbs

    @cached_property
    def bent(self) -> Array:
        """Points of the plan's tree where joints are in the middle of their ranges, as fingers bend [points, 3] [m]."""
        robot, points = self.robot, self.plan.tree.rest.copy()
        data, v = robot.model.createData(), 0.5 * (robot.limits.position_lower + robot.limits.position_upper)
        pin.forwardKinematics(robot.model, data, pin.integrate(robot.model, pin.neutral(robot.model), v))
        points[: robot.model.njoints] = [pose.translation for pose in data.oMi]
        return points

    def is_foot(self, name: str) -> bool:
        """Whether a limb walks."""
        return _is_foot(name, self.plan, self.robot.base == "fixed")


class RestPose:
    """A robot at ``robot.neutral``.

    Attributes:
        poses: of its joints. axes: directions of the joints in the world, zero of those of several degrees of freedom
            [joints, 3]. balls: of its links, by joint. tree: of its joints, with one more at the end of each last link.
        frames: that were found -> the joint that carries one, and its pose.
    """

    def __init__(self, robot: Robot, balls: dict[int, LinkBalls]) -> None:
        model, data = robot.model, robot.model.createData()
        pin.forwardKinematics(model, data, robot.neutral)
        pin.updateFramePlacements(model, data)
        pin.computeJointJacobians(model, data, robot.neutral)
        self.robot, self.fixed, self.balls = robot, robot.base == "fixed", balls
        self.frames: dict[str, tuple[int, pin.SE3]] = {}
        self.poses, self.axes = list(data.oMi), np.zeros((model.njoints, 3))
        self._links = [(int(f.parentJoint), np.array(data.oMf[k].translation)) for k, f in enumerate(model.frames)]
        for joint in np.flatnonzero(np.array(model.nvs) == 1).tolist():
            twist = data.J[:, int(model.idx_vs[joint])]
            self.axes[joint] = twist[3:] if np.abs(twist[3:]).max() > 1e-9 else twist[:3]
        names, parents = [str(name) for name in list(model.names)], [-1, *map(int, list(model.parents)[1:])]
        points = [np.array(pose.translation) for pose in self.poses]
        if not self.fixed:
            # The world is no part of a body that moves in it
            points[0] = points[1].copy()
        for joint in sorted({*range(1, model.njoints)} - {*parents}):
            names.append(f"{names[joint]} end")
            points.append(self._tip(joint, ancestors(parents, joint)[:-1]))
            parents.append(joint)
        self.points = np.array(points)
        offsets = self.points - np.where(np.array(parents)[:, None] >= 0, self.points[parents], 0.0)
        self.tree = Skeleton(tuple(names), tuple(parents), offsets, (False,) * len(names))

    def _tip(self, joint: int, chain: list[int]) -> Array:
        """The point of a last link that is farthest from the joint before; ``chain``: it and the joints above it."""
        places = np.array([self.poses[k].translation for k in (*chain, 0)])
        here, points = places[0], [place for carrier, place in self._links if carrier == joint]
        if joint in self.balls:
            points.append(self.poses[joint].act(self.balls[joint].middle))
        most = max(LONGEST * float(np.linalg.norm(np.diff(places[:-1], axis=0), axis=1).sum()), 0.05)
        away = np.array([float(np.linalg.norm(point - here)) for point in points])
        away[away >= most] = 0.0
        if away.max(initial=0.0) > 1e-3:
            return points[int(np.argmax(away))]
        before = 2 if len(chain) > 1 and float(np.linalg.norm(here - places[1])) < 1e-9 else 1
        return np.asarray(here + HAND * (here - places[before]))

    def meeting(self, joints: Sequence[int], start: Array) -> Array:
        """The point nearest to the axes of some joints, and a little to where they are."""
        joints = list(joints)
        across = np.eye(3) - self.axes[joints, :, None] * self.axes[joints, None, :]
        side = NEAR * start + np.einsum("jab,jb->a", across, self.points[joints])
        return np.asarray(np.linalg.solve(NEAR * np.eye(3) + across.sum(axis=0), side))

    def reach(self, joint: int, way: Array) -> float:
        """How far a link stands out from its joint along a direction [m]; 0 without bodies."""
        balls = self.balls.get(joint) if joint else None
        if balls is None:
            return 0.0
        return float((balls.centers @ (self.poses[joint].rotation.T @ way) + balls.radii).max())

    def framed(self) -> Robot:
        """The robot with the frames that were found."""
        robot = self.robot
        for frame, (joint, pose) in self.frames.items():
            robot = with_frame(robot, frame, joint, self.poses[joint].actInv(pose))
        return robot


def body_of(robot: Robot) -> RobotBody:
    """Limbs, trunk and soles of a robot, or fingers of a hand; :class:`BodyError` where it has no pair of limbs."""
    if robot.base not in ("fixed", "floating"):
        raise BodyError("robot", robot.name, f"its base is {robot.base}; load it with base='floating' or 'fixed'")
    rest = RestPose(robot, {})
    plan, fill = hand_plan(rest), _finger
    if plan is None:
        rest, fill = RestPose(robot, balls_of_joints(robot)), _limb
        plan = find_body(rest.tree, field="robot", arms=rest.fixed, straight=STRAIGHT, up=np.eye(3)[2])
    said = plan.tree.said([*plan.limbs.values()])
    if not rest.fixed and "left_arm" not in plan.limbs and said & ARM_WORDS and not said & LEG_WORDS:
        raise BodyError("robot", robot.name, "it has arms and no legs to stand on; load it with base='fixed'")
    limbs = {name: fill(name, rest, plan) for name in plan.limbs}
    places, waist, up = list[Array](), None, plan.axes[:, 2]
    for kind in ("arm" if rest.fixed else "leg", "arm"):
        # Of a hand between the first and the last finger
        bases = [limb.base for name, limb in limbs.items() if name.endswith(kind)] or [k.base for k in limbs.values()]
        places.append(np.asarray(0.5 * (bases[0] + bases[-1])))
    carriers = {"pelvis": (plan.pelvis, places[0]), "chest": (plan.chest, places[1])}
    if plan.head and plan.upright:
        carriers["head"] = (max(joint for joint in plan.head if joint < robot.model.njoints), rest.points[plan.head[0]])
    rest.frames |= {f"retarget_{name}": (joint, pin.SE3(plan.axes, place)) for name, (joint, place) in carriers.items()}
    if plan.chest != plan.pelvis:
        between = [j for j in plan.tree.path(plan.pelvis, plan.chest)[1:] if j < robot.model.njoints]
        waist = rest.meeting(between[:MEETING], np.mean(rest.points[between], axis=0))
    feet = [limb for name, limb in limbs.items() if _is_foot(name, plan, rest.fixed)]
    balls, lowest = rest.balls, rest.points[plan.pelvis] @ up - rest.reach(plan.pelvis, -up)
    stretched = [limb.base @ up - np.linalg.norm(np.diff(limb.places, axis=0), axis=1).sum() for limb in feet]
    if lowest < min(stretched, default=-np.inf):
        log.warning("%s: its trunk reaches below its soles wherever they are, and is let into the ground", robot.name)
        balls = {joint: own for joint, own in balls.items() if joint != plan.pelvis}
    ground = min((limb.places[3] @ up - limb.radius for limb in feet), default=0.0)
    return RobotBody(
        rest.framed(), plan, limbs, "retarget_pelvis", "retarget_chest", np.array(places), waist,
        "retarget_head" if "head" in carriers else "", float(places[0] @ up - ground), balls,
    )  # fmt: skip


def with_frame(robot: Robot, name: str, joint: int, placement: pin.SE3) -> Robot:
    """The robot with a frame at a placement in a joint's own; names of joints may be those of links elsewhere."""
    if joint == 0:
        return robot.with_frame(name, "world", placement)
    frames = [(k, frame) for k, frame in enumerate(robot.model.frames) if int(frame.parentJoint) == joint]
    parent = next(frame for k, frame in frames if int(robot.model.getFrameId(str(frame.name))) == k)
    return robot.with_frame(name, str(parent.name), parent.placement.actInv(placement))


def _is_foot(name: str, plan: BodyPlan, fixed: bool) -> bool:
    return not fixed and (name.endswith("leg") or not plan.upright)


def hand_plan(rest: RestPose) -> BodyPlan | None:
    """The fingers of a robot that is a hand; None where it is none."""
    try:
        plan = find_hand(rest.tree, side_of(rest.robot.name))
    except BodyError:
        return None
    longest = max(rest.tree.length(chain) for chain in plan.limbs.values())
    return plan if rest.fixed and longest <= LONGEST_FINGER else None


def _finger(name: str, rest: RestPose, plan: BodyPlan) -> RobotLimb:
    """A finger; its frames are put among those of the pose."""
    chain, frame = plan.limbs[name], f"retarget_{name}"
    places = rest.points[list(chain)]
    joints = tuple(k for k in plan.tree.path(plan.pelvis, chain[-1])[1:] if k < rest.robot.model.njoints)
    wrist = f"{frame}_wrist" * (len(chain) > 3)
    parts = {f"{frame}_middle": (chain[1], 1), frame: (joints[-1], -1)} | ({wrist: (chain[2], 2)} if wrist else {})
    rest.frames |= {part: (joint, pin.SE3(plan.axes, places[k])) for part, (joint, k) in parts.items()}
    return RobotLimb(joints, f"{frame}_middle", wrist, frame, places if wrist else places[[0, 1, 2, 2]])


def _limb(name: str, rest: RestPose, plan: BodyPlan) -> RobotLimb:
    """A leg or an arm; its frames are put among those of the pose."""
    points, frame, chain, foot = rest.points, f"retarget_{name}", plan.limbs[name], _is_foot(name, plan, rest.fixed)
    joints, tip = tuple(joint for joint in chain if joint < rest.robot.model.njoints), points[chain[-1]]
    last, size = joints[-1], float(np.linalg.norm(tip - points[joints[0]]))
    middle = _middle_hinge(rest, joints, tip)
    before = list(joints[: joints.index(middle)]) or [joints[0]]
    base = rest.meeting(before[-MEETING:], points[before[-MEETING:][0]])
    if float(np.linalg.norm(points[before] - base, axis=1).min()) > OFF * size:
        base = points[before[0]]
    wrist = _wrist(rest, joints, middle, tip)
    ankle, own = points[wrist] if wrist else tip, rest.balls.get(last)
    known = own is not None and float(np.linalg.norm(own.middle)) <= size
    there = own.moved(rest.poses[last]) if own is not None and known else None
    end, radius, corners = _end(there, plan.axes, ankle, tip, size, foot=foot)
    solid = LinkBalls(corners, np.full(len(corners), radius)) if there is None else there.moved(end.inverse())
    surface = solid.corners(CORNERS, EXACT)
    if foot and len(corners) == 1 and radius > 0.0:
        # Its ball covers what is drawn of the foot, beyond the ball's middle as seen from the knee
        far = surface[surface @ (end.rotation.T @ (end.translation - points[middle])) > 0.0]
        radius = float(np.clip(np.linalg.norm(far, axis=1).max(initial=radius), radius, BALL * radius))
    places = np.array([base, points[middle], ankle if wrist else end.translation, end.translation])
    carriers = {frame: (last, end), f"{frame}_middle": (middle, rest.poses[middle])}
    rest.frames |= carriers | ({f"{frame}_wrist": (wrist, rest.poses[wrist])} if wrist else {})
    # A knee lies on its front, an elbow on its back: the outer sides of their bends
    outer = plan.axes[:, 0] if name.endswith("leg") else -plan.axes[:, 0]
    return RobotLimb(
        joints, f"{frame}_middle", f"{frame}_wrist" if wrist else "", frame, places, radius, corners, surface,
        (rest.reach(middle, outer), rest.reach(wrist, outer), radius),
        _pitch(rest, plan.axes, joints[joints.index(middle) + 1 :], places),
        _bend(rest, plan.axes[:, 1], middle, places), there is None,
    )  # fmt: skip


def _pitch(rest: RestPose, axes: Array, joints: tuple[int, ...], places: Array) -> tuple[float, float]:
    """Least and most turn of an end against its last bone about the axis to the left [rad]."""
    robot = rest.robot
    forward, _, up = (places[1] - places[2]) @ axes
    least = most = -float(np.arctan2(forward, up))
    for joint in joints:
        along = float(rest.axes[joint] @ axes[:, 1])
        if abs(along) > ACROSS:
            number = int(robot.model.idx_vs[joint])
            limits = np.array([robot.limits.position_lower[number], robot.limits.position_upper[number]])
            ends = np.sign(along) * (limits - robot.neutral[int(robot.model.idx_qs[joint])])
            least, most = least + float(ends.min()), most + float(ends.max())
    return least, most


def _bend(rest: RestPose, left: Array, middle: int, places: Array) -> float:
    """Which way a middle hinge is bent at rest, and where it is straight there bends farthest; see ``RobotLimb``."""
    robot, number, axis = rest.robot, int(rest.robot.model.idx_vs[middle]), rest.axes[middle]
    upper, lower, _ = np.diff(places, axis=0)
    bent = float(np.arctan2(np.cross(upper, lower) @ axis, upper @ lower))
    if abs(bent) < STRAIGHT_KNEE:
        bent = float(robot.limits.position_lower[number] + robot.limits.position_upper[number])
    return float(np.sign(bent * (axis @ left))) or 1.0


def _middle_hinge(rest: RestPose, joints: tuple[int, ...], tip: Array) -> int:
    """The knee or elbow: the joint that most, and most evenly, changes how far the end is from hip or shoulder."""

    def score(count: int) -> float:
        axis, place = rest.axes[joints[count]], rest.points[joints[count]]
        start = rest.meeting(joints[max(count - MEETING, 0) : count], rest.points[joints[count - 1]])
        distances = [float(np.linalg.norm(place + pin.exp3(axis * angle) @ (tip - place) - start)) for angle in SWEEP]
        even = min(float(np.linalg.norm(place - start)), float(np.linalg.norm(tip - place)))
        return (max(distances) - min(distances)) * even

    return joints[max(range(1, len(joints)), key=score)]


def _wrist(rest: RestPose, joints: tuple[int, ...], middle: int, tip: Array) -> int:
    """The first joint far enough behind the middle hinge that turns across the bone; 0 without one."""
    start = rest.points[middle]
    reach = float(np.linalg.norm(tip - start))
    for joint in joints[joints.index(middle) + 1 :]:
        bone = rest.points[joint] - start
        length = float(np.linalg.norm(bone))
        if length > DISTAL * reach and abs(float(rest.axes[joint] @ bone)) < ACROSS * length:
            return joint
    return 0


def _end(
    balls: LinkBalls | None, axes: Array, ankle: Array, tip: Array, size: float, *, foot: bool
) -> tuple[pin.SE3, float, Array]:
    """Pose of the contact frame, radius of its ball, and corners in it, of a last link's balls in the world, if any."""
    flat, point = foot and float(np.linalg.norm(ankle - tip)) > 1e-9, np.zeros((1, 3))
    if balls is None:
        if flat:
            return pin.SE3(axes, ankle - ANKLE * size * axes[:, 2]), 0.0, _rectangle(*np.array(GUESSED_SOLE))
        return pin.SE3(axes, tip), TIP, point
    local, radii = balls.centers @ axes, balls.radii[:, None]
    heights = local[:, 2] - balls.radii
    low = heights < heights.min() + SOLE
    if flat and bool((np.ptp(local[low, :2], axis=0) > FLAT).all()):
        place = np.array([*(ankle @ axes)[:2], heights.min()])
        lower, upper = (local - radii)[low, :2].min(axis=0), (local + radii)[low, :2].max(axis=0)
        return pin.SE3(axes, axes @ place), 0.0, _rectangle(lower - place[:2], upper - place[:2])
    if foot:
        center, radius = _ball(balls.centers, balls.radii, tip)
        return pin.SE3(axes, center), radius, point
    # A hand is a ball as wide as it is, neither as long nor as thick
    middle = LinkBalls(local, balls.radii).middle
    half = (np.abs(local - middle) + radii).max(axis=0)
    return pin.SE3(axes, axes @ middle), float(np.median(half)), point


def _rectangle(lower: Array, upper: Array) -> Array:
    """Corners at the height 0 [4, 3]."""
    return np.array([[x, y, 0.0] for x in (lower[0], upper[0]) for y in (lower[1], upper[1])])


def _ball(centers: Array, radii: Array, tip: Array) -> tuple[Array, float]:
    """Centre and radius of the ball at the end of a point foot."""
    if (radii > 0.0).any():
        away = np.where(radii > 0.0, np.linalg.norm(centers - tip, axis=1), np.inf)
        # Of several at one place, as of a shin that ends in a foot, the largest
        nearest = np.lexsort((-radii, np.round(away, 4)))[0]
        return centers[nearest], float(radii[nearest])
    # Corners of a mesh: the ball through those near the tip
    away = np.linalg.norm(centers - tip, axis=1)
    near = centers[away < max(0.03, 1.5 * away.min())]
    matrix = np.hstack([2.0 * near, np.ones((len(near), 1))])
    center = np.linalg.lstsq(matrix, np.sum(near**2, axis=1), rcond=None)[0][:3]
    if float(np.linalg.norm(center - tip)) > 0.05:
        center = tip
    return center, float(np.linalg.norm(near - center, axis=1).max())

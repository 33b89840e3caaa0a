"""Hands: fingers of a skeleton or a robot in which one body carries all of them."""

from __future__ import annotations

import numpy as np

from wbc.multibody import pin
from wbc.retarget.body import BodyError, BodyPlan, PointTree, longest_chain
from wbc.retarget.clip import Array
from wbc.retarget.robot_body import TIP, RestPose, RobotBody, RobotLimb, with_frame
from wbc.retarget.solids import balls_of_joints
from wbc.retarget.words import LEG_WORDS, side_of
from wbc.robot import Robot

#: Fingers, of which the first and the last are at the palm's edges, and words of their names
FINGERS = {
    "index": {"index", "ff", "forefinger"}, "thumb": {"thumb", "th"}, "middle": {"middle", "mid", "mf"},
    "ring": {"ring", "rf"}, "little": {"little", "pinky", "lf"},
}  # fmt: skip
#: Fewest fingers of a hand: a thumb and two
FEWEST = 3
#: A robot's fingers are no longer than this [m]
LONGEST_FINGER = 0.25
#: Joints nearer to each other than this share of their finger are one knuckle
KNUCKLE = 0.05


def hand_of(robot: Robot) -> RobotBody | None:
    """The fingers of a robot that is a hand, as limbs of a body whose pelvis is the palm; None where it is none."""
    if robot.base != "fixed":
        return None
    rest = RestPose(robot, {})
    tree = rest.tree
    try:
        plan = find_hand(tree, side_of(robot.name))
    except BodyError:
        return None
    if max(tree.length(chain) for chain in plan.limbs.values()) > LONGEST_FINGER:
        return None
    limbs: dict[str, RobotLimb] = {}
    axes, new, point = plan.axes, robot, np.zeros((1, 3))
    for name, chain in plan.limbs.items():
        places, frame = tree.points[list(chain)], f"retarget_{name}"
        joints = tuple(joint for joint in plan.tree.path(plan.pelvis, chain[-1])[1:] if joint < robot.model.njoints)
        three = len(chain) > 3
        parts = {f"{frame}_middle": (chain[1], places[1]), frame: (joints[-1], places[-1])}
        parts |= {f"{frame}_wrist": (chain[2], places[2])} if three else {}
        for part, (joint, place) in parts.items():
            new = with_frame(new, part, joint, rest.poses[joint].actInv(pin.SE3(axes, place)))
        limbs[name] = RobotLimb(
            joints=joints, base=places[0], middle=f"{frame}_middle", wrist=f"{frame}_wrist" * three, end=frame,
            places=places if three else places[[0, 1, 2, 2]], contact="point", radius=TIP, corners=point, surface=point,
            thickness=(0.0, 0.0, 0.0), pitch=(0.0, 0.0), guessed=False,
        )  # fmt: skip
    palm = np.mean([list(limbs.values())[k].base for k in (0, -1)], axis=0)
    for frame in ("retarget_pelvis", "retarget_chest"):
        new = with_frame(new, frame, plan.pelvis, rest.poses[plan.pelvis].actInv(pin.SE3(axes, palm)))
    return RobotBody(
        robot=new, plan=plan, limbs=limbs, pelvis="retarget_pelvis", chest="retarget_chest",
        places=np.array([palm, palm]), waist=None, head="", height=0.0, balls=balls_of_joints(robot),
    )  # fmt: skip


def find_hand(tree: PointTree, side: int = 0) -> BodyPlan:
    """The palm, and knuckles and tip of each finger, at most four points, in the order of :data:`FINGERS`.

    The plan's axes are out of the back of a right hand, from its last finger to the index, and from fingers to wrist;
    of a left one the first is out of the palm.

    Args:
        side: of several hands the one whose names say it, 1: left, -1: right.

    Raises:
        BodyError: no point carries a thumb and two fingers.
    """
    branches = [[_knuckles(tree, longest_chain(tree, child)) for child in own] for own in tree.children()]
    hands = [[chain for chain in own if len(chain) > 2] for own in branches]

    def rank(palm: int) -> int:
        return len(hands[palm]) + (side * sum(side_of(tree.names[chain[-1]]) for chain in hands[palm]) > 0)

    palm = max(range(len(hands)), key=rank)
    found = hands[palm]
    if len(found) < FEWEST or tree.said(found) & LEG_WORDS:
        raise BodyError("skeleton", ", ".join(tree.names[:8]), "no hand: no point carries a thumb and two fingers")
    said = {name: [k for k, chain in enumerate(found) if own & tree.said([chain])] for name, own in FINGERS.items()}
    if sorted(k for own in said.values() for k in own) == list(range(len(found))):
        named = {name: own[0] for name, own in said.items() if own}
    else:
        # The thumb is farthest from the two fingers next to it; the others follow by their distance from it
        middles = np.array([tree.points[list(chain)].mean(axis=0) for chain in found])
        apart = np.linalg.norm(middles[:, None] - middles, axis=2)
        thumb = int(np.sort(apart, axis=1)[:, 1:3].sum(axis=1).argmax())
        order = np.argsort(apart[thumb], kind="stable").tolist()
        named = dict(zip(("thumb", "index", "middle", "ring", "little"), order, strict=False))
    limbs = {name: found[named[name]] for name in FINGERS if name in named}
    firsts = np.array([tree.points[chain[0]] for name, chain in limbs.items() if name != "thumb"])
    tips = np.array([tree.points[chain[-1]] for name, chain in limbs.items() if name != "thumb"])
    across = firsts[0] - firsts[-1]
    wrist = tree.points[palm] - firsts.mean(axis=0)
    # Where the palm is among its fingers' first joints these say where the wrist is
    wrist = wrist if np.linalg.norm(np.cross(wrist, across)) > 0.5 * across @ across else (firsts - tips).mean(axis=0)
    y = across / np.linalg.norm(across)
    x = np.cross(y, wrist)
    x /= np.linalg.norm(x)
    return BodyPlan(tree, limbs, palm, palm, (), np.stack([x, y, np.cross(x, y)], axis=1), True)


def handedness(plan: BodyPlan, points: Array) -> float:
    """1 of a right hand, -1 of a left one, by where its fingers are bent to; 0 where they are straight.

    Args:
        points: of the plan's tree [points, 3] [m].
    """
    bones = [np.diff(points[list(chain[:3])], axis=0) for name, chain in plan.limbs.items() if name != "thumb"]
    return float(np.sign(sum(np.cross(first, second) @ plan.axes[:, 1] for first, second in bones)))


def bent(body: RobotBody) -> Array:
    """Points of a hand whose joints are in the middle of their ranges, where fingers are bent [points, 3] [m]."""
    robot, points = body.robot, body.plan.tree.points.copy()
    data, v = robot.model.createData(), 0.5 * (robot.limits.position_lower + robot.limits.position_upper)
    pin.forwardKinematics(robot.model, data, pin.integrate(robot.model, pin.neutral(robot.model), v))
    points[: robot.model.njoints] = [pose.translation for pose in data.oMi]
    return points


def _knuckles(tree: PointTree, chain: tuple[int, ...]) -> tuple[int, ...]:
    """The last points of a finger, at most four; of several at one place the last one that turns it."""
    apart = KNUCKLE * tree.length(chain)
    kept = [
        point
        for point, after in zip(chain, (*chain[1:], -1), strict=True)
        if after < 0 or tree.length((point, after)) > apart
    ]
    return tuple(kept[-4:])

"""A second checker: the log and the robot read anew, through numpy and Pinocchio, and clearances proven between ticks.

It shares nothing with ``wbc.walking.checker`` but the numbers of the rules. A hand may be nearer than the clearance to
what a hold is mounted on while it is about to grasp, holds or leaves that hold, and no deeper in it than :data:`DEPTH`
beyond its own roundness.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from wbc.clearance import EndlessCylinder, Exemption, Motion, Pair, Sweeper, SweptBody, SweptScene, Tree
from wbc.robots import Walker
from wbc.shapes import Capsule, HalfSpace, Sphere
from wbc.validation import Array
from wbc.walking import PlaneSurface, Structure
from wbc.walking.log import WalkLog

#: Least distance, and by how much it may be missed [m]
CLEARANCE, SLACK = 0.0254, 1e-4
#: A hand this near to its hold may be near to what that is mounted on, which is this near to the hold, so deep [m]
NEAR, MOUNTED, DEPTH = 0.0762, 0.005, 0.005
#: What is thicker than NEAR less the clearance is near within its radius, the clearance and what plans keep beside [m]
THICKER = 0.04
#: Of hands at their holds [m, rad], and of joints' accelerations, in parts of their limits
OFF, TURNED, HARDER = 0.002, np.radians(0.5), 1.01
#: By which the velocity of the body may change from tick to tick: ten times the ramp to 0.1 m/s in 0.5 s [m/s, rad/s]
JUMP, SPIN_JUMP = 0.02, 0.02
#: States of hands in a log, and rolls
CLOSED, FREE_ROLL = 2, 0

Columns = dict[str, Any]


def second_check(file: Path, walker: Walker, urdf: Path, structure: Structure) -> list[str]:
    """What a log violates; empty: nothing.

    Args:
        file: ``run.npz``. urdf: of the robot. walker: its accelerations, which no URDF has.
    """
    log = vars(WalkLog.load(file))
    model = pin.buildModelFromUrdf(str(urdf))
    limits = walker.robot.limits.acceleration[6:]
    return [*_touched(log, model, urdf, structure), *_loose(log, model), *_jumps(log), *_hard(log, limits)]


def _touched(log: Columns, model: pin.Model, urdf: Path, structure: Structure) -> Iterator[str]:
    """Bodies that are too near to each other."""
    tree = Tree.of_model(model, floating=True)
    parts = _parts(model, urdf, {str(hand): i for i, hand in enumerate(log["hands"])})
    things = _things(structure)
    joints = {str(name): k for k, name in enumerate(log["joints"])}
    q = log["q"][:, [joints[name] for name in tree.coordinates]]
    motion = Motion.linear(tree, log["t"], q, log["pose_body_in_structure"])
    neighbours, least = _neighbours(model, {part.link for part in parts}), CLEARANCE - SLACK
    moved = {part.name: tree.link("link", part.link)[0] for part in parts}
    pairs = [
        Pair(a.name, b.name, least)
        for a, b in combinations(parts, 2)
        if moved[a.name] != moved[b.name] and frozenset((a.link, b.link)) not in neighbours
    ]
    pairs += [Pair(a.name, b.name, least) for a in parts for b in things]
    scene = SweptScene(tree, [*parts, *things], pairs)
    sweeper = Sweeper(scene)
    exemptions = list(_exemptions(log, model, parts, structure))
    swept = sweeper.sweep(motion, exemptions=exemptions, aim="every", tolerance=1e-4)
    for k in np.argsort(swept.found):
        if swept.found[k] < 0.0:
            pair = pairs[int(swept.pairs[k])]
            where = f"at {swept.times[k]:.3f} s, {pair.first} and {pair.second}"
            yield f"clearance: {1e3 * (swept.found[k] + least):.2f} mm {where}"
    if swept.violation is None and not swept.clear:
        yield f"clearance: not proven, {float(swept.bound.min()):.3g} m"


def _parts(model: pin.Model, urdf: Path, hands: dict[str, int]) -> list[SweptBody]:
    """Collision bodies of the links; a cylinder and the balls at its ends are a capsule."""
    shapes = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION)
    found: list[SweptBody] = []
    balls = []
    for one in shapes.geometryObjects:
        frame = model.frames[one.parentFrame]
        # In the frame of its joint, as links without a joint of their own have it too
        at, name = frame.placement.inverse() * one.placement, str(frame.name)
        if type(one.geometry).__name__ == "Sphere":
            balls.append((name, at, float(one.geometry.radius)))
            continue
        body = Capsule(float(one.geometry.radius), 2.0 * float(one.geometry.halfLength))
        found.append(SweptBody(name, body, name, at))
    for name, at, radius in balls:
        ends = [
            body.placement * np.array([0.0, 0.0, side * body.shape.length / 2])
            for body in found
            for side in (-1.0, 1.0)
            if body.link == name and isinstance(body.shape, Capsule) and body.placement is not None
        ]
        if not any(np.linalg.norm(at.translation - end) < 1e-9 for end in ends):
            found.append(SweptBody(name, Sphere(radius), name, at))
    # What moves with a hand's frame is the hand
    carried = {int(model.frames[model.getFrameId(hand)].parentJoint): hand for hand in hands}
    out, count = list[SweptBody](), dict[str, int]()
    for body in found:
        count[body.name] = count.get(body.name, 0) + 1
        name = body.name if count[body.name] == 1 else f"{body.name}, body {count[body.name]}"
        frame = model.frames[model.getFrameId(body.link)]
        hand = carried.get(int(frame.parentJoint))
        grasp = None
        if hand is not None:
            grasp = (frame.placement.inverse() * model.frames[model.getFrameId(hand)].placement).translation
        out.append(SweptBody(name, body.shape, body.link, body.placement, grasp))
    return out


def _things(structure: Structure) -> list[SweptBody]:
    """Surface and obstacles."""
    out = [SweptBody(one.id, one.shape, "world", one.placement) for one in structure.obstacles]
    surface = structure.surface
    if surface is not None:
        shape = HalfSpace() if isinstance(surface, PlaneSurface) else EndlessCylinder(surface.radius)
        out.append(SweptBody("surface", shape, "world", surface.pose))
    return out


def _neighbours(model: pin.Model, shaped: set[str]) -> set[frozenset[str]]:
    """Links with bodies between which there is none."""
    out = set()
    for name in shaped:
        frame = model.getFrameId(name)
        while frame != 0:
            frame = int(model.frames[frame].parentFrame)
            if str(model.frames[frame].name) in shaped:
                out.add(frozenset((name, str(model.frames[frame].name))))
                break
    return out


def _exemptions(log: Columns, model: pin.Model, parts: list[SweptBody], structure: Structure) -> Iterator[Exemption]:
    """Hands at the holds that the log has them at, against what these are mounted on."""
    mounts, places = dict[int, list[str]](), np.array([[at.translation for at in row] for row in _hands(log, model)])
    for arm, hand in enumerate(log["hands"]):
        joint = model.frames[model.getFrameId(str(hand))].parentJoint
        mine = [p for p in parts if model.frames[model.getFrameId(p.link)].parentJoint == joint]
        rows = log["hand_hold"][:, arm]
        starts = np.flatnonzero(np.diff(rows, prepend=-2))
        for start, end in zip(starts, np.append(starts[1:], len(rows)) - 1, strict=True):
            row = int(rows[start])
            if row < 0:
                continue
            if row not in mounts:
                mounts[row] = list(_mounts(structure, log["hold_pose"][row, :3]))
            # As long as the hand is near the hold without a break
            point, k, last = log["hold_pose"][row, :3], int(start), int(end)
            gaps, wide = np.linalg.norm(places[:, arm] - point, axis=1), max(_radius(part) for part in mine)
            within = NEAR if wide + CLEARANCE <= NEAR + 1e-9 else wide + CLEARANCE + THICKER
            near = gaps <= within
            if _vanished(log, row, log["t"][end]):
                # No hand stops at once: it comes nearer for a while
                while last < len(near) - 1 and gaps[last + 1] < gaps[last]:
                    last += 1
            while k > 0 and near[k]:
                k -= 1
            while last < len(near) - 1 and near[last]:
                last += 1
            since, until = float(log["t"][k]), float(log["t"][last])
            for part in mine:
                for mount in mounts[row]:
                    yield Exemption(part.name, mount, point, within, DEPTH + _radius(part), since, until)


def _radius(part: SweptBody) -> float:
    return float(getattr(part.shape, "radius", 0.0))


def _vanished(log: Columns, row: int, t: float) -> bool:
    """Whether a hold that was there is gone a tick after a time [s]."""
    ends = log["presence_span"][log["presence_hold"] == row, 1]
    return bool((np.abs(ends - t) < 0.015).any())


def _mounts(structure: Structure, point: Array) -> Iterator[str]:
    if structure.surface is not None and abs(float(structure.surface.height(point))) <= MOUNTED:
        yield "surface"
    for one in structure.obstacles:
        if abs(float(one.distance(point))) <= MOUNTED:
            yield one.id


def _loose(log: Columns, model: pin.Model) -> Iterator[str]:
    """Closed hands off their holds."""
    worst = dict[str, tuple[float, float, str]]()
    for k, (t, there) in enumerate(zip(log["t"], _hands(log, model), strict=True)):
        for arm, at in enumerate(there):
            row = int(log["hand_hold"][k, arm])
            if log["hand_state"][k, arm] != CLOSED or row < 0:
                continue
            off = pin.XYZQUATToSE3(log["hold_pose"][row]).actInv(at)
            tilt = float(np.arccos(np.clip(off.rotation[2, 2], -1.0, 1.0))) - float(log["hold_max_tilt"][row])
            for kind, value in (
                ("hand off its hold [m]", float(np.linalg.norm(off.translation))),
                ("tilt [rad]", tilt),
            ):
                if value > worst.get(kind, (-1.0, 0.0, ""))[0]:
                    worst[kind] = value, float(t), str(log["arms"][arm])
    for kind, limit in (("hand off its hold [m]", OFF), ("tilt [rad]", TURNED)):
        value, time, arm_name = worst.get(kind, (0.0, 0.0, ""))
        if value > limit:
            yield f"{kind}: {value:.4g} at {time:.3f} s, {arm_name}"


def _hands(log: Columns, model: pin.Model) -> Iterator[list[pin.SE3]]:
    """Where the hands are at every tick, the body as logged."""
    data, q = model.createData(), pin.neutral(model)
    index = [model.joints[model.getJointId(str(name))].idx_q for name in log["joints"]]
    hands = [model.getFrameId(str(hand)) for hand in log["hands"]]
    for joints, pose in zip(log["q"], log["pose_body_in_structure"], strict=True):
        q[index] = joints
        pin.framesForwardKinematics(model, data, q)
        yield [pin.XYZQUATToSE3(pose) * data.oMf[frame] for frame in hands]


def _jumps(log: Columns) -> Iterator[str]:
    """A body whose velocity is not continuous; it comes from rest."""
    poses = [pin.XYZQUATToSE3(row) for row in log["pose_body_in_structure"]]
    gap = np.diff(log["t"])[:, None]
    rates = np.diff(log["pose_body_in_structure"][:, :3], axis=0) / gap
    spins = np.array([pin.log3(a.rotation.T @ b.rotation) for a, b in pairwise(poses)]) / gap
    for kind, values, limit in (("velocity [m/s]", rates, JUMP), ("turn rate [rad/s]", spins, SPIN_JUMP)):
        steps = np.linalg.norm(np.diff(values, axis=0, prepend=0.0 * values[:1]), axis=1)
        k = int(np.argmax(steps))
        if steps[k] > limit:
            yield f"jump of the body's {kind}: {steps[k]:.3f} at {float(log['t'][k]):.3f} s"


def _hard(log: Columns, limits: Array) -> Iterator[str]:
    """Joints that change their rates faster than they can."""
    before = np.vstack([np.zeros_like(log["v"][:1]), log["v"][:-1]])
    parts = (
        np.abs(log["v"] - before) / np.diff(log["t"], prepend=log["t"][0] - log["t"][1] + log["t"][0])[:, None] / limits
    )
    k, joint = np.unravel_index(int(np.argmax(parts)), parts.shape)
    if parts[k, joint] > HARDER:
        name = str(log["joints"][joint])
        yield f"acceleration: {parts[k, joint]:.1f} times the limit at {float(log['t'][k]):.3f} s, {name}"
